"""Good, prototype and returned EFC valves as parameter sets, and populations of valves drawn about them.

What the thesis leaves open is chosen here and listed in `DECLARED`. The populations are ours: the thesis tested four
valves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hil.physics.model import Model, ModelEffect, Value, typical_model
from hil.physics.published.tugsal import CLASSES

# Corner frequencies (−3 dB, −90°) in Hz that the sets have from current to pressure at small amplitude, sensor
# and friction left out. Good and return: the thesis's reduced transfer functions with corners read as Hz.
CORNERS_HZ = {"good": (4.52, 6.91), "prototype": (3.64, 5.00), "return": (2.93, 3.68)}

DECLARED = {
    "unit of the corner frequencies": "Hz: with rad/s a governor's valve would have a bandwidth below 1 Hz",
    "prototype": "between return and good as the text and its figures say; the printed transfer function would make "
    "it the fastest of the three",
    "damping": "what the two corners ask of a rotor behind a current loop of 250 rad/s, 8 ms of eddy currents and "
    "2 ms of dead time",
    "friction of the three sets": "1, 1 and 2 mA, what a dither leaves: with more, a sine of the low level (±6 mA) "
    "would not move the returned valve, and the published order at that level would not show",
    "a returned valve": "the thesis has two, one malfunctioned and one severely so, and one transfer function for "
    "both: the classes lie along the line from the set good (0) to the set return (1), at 0.7 and 1.3",
    "friction and leakage of a population": "stickiness and leakage are named as causes, without numbers: along the "
    "same line, with a spread that grows with wear",
    "spread of a population": "see CLASS and SPREAD; classes overlap",
}


@dataclass(frozen=True, slots=True)
class ValveSet:
    """What makes a valve of the thesis in the plant `efc-drive`.

    Attributes:
        rotor_frequency: rad/s. `rotor_damping`: ratio.
        leakage_ml_min: at 220 psi.
        friction_a: Coulomb friction as the current it withstands.
    """

    rotor_frequency: float
    rotor_damping: float
    leakage_ml_min: float
    friction_a: float

    @property
    def row(self) -> tuple[float, ...]:
        """Slow and fast time constant of the rotor in s, leakage, friction."""
        apart = math.sqrt(self.rotor_damping**2 - 1.0)
        slow, fast = (1.0 / (self.rotor_frequency * (self.rotor_damping + side * apart)) for side in (-1.0, 1.0))
        return slow, fast, self.leakage_ml_min, self.friction_a

    def toward(self, other: ValveSet, share: float) -> ValveSet:
        """On the line to another set, beyond it with a share above 1; equal steps are equal ratios of each `row`."""
        slow, fast, leakage, friction = (
            own * (wanted / own) ** share for own, wanted in zip(self.row, other.row, strict=True)
        )
        return ValveSet(1.0 / math.sqrt(slow * fast), (slow + fast) / (2.0 * math.sqrt(slow * fast)), leakage, friction)


SETS: Mapping[str, ValveSet] = {
    "good": ValveSet(187.0, 3.14, 80.0, 0.001),
    "prototype": ValveSet(57.4, 1.38, 80.0, 0.001),
    "return": ValveSet(33.0, 1.09, 100.0, 0.002),
}


@dataclass(frozen=True, slots=True)
class Wear:
    """Where the valves of a class lie on the line from the good to the returned set, and how they scatter.

    Attributes:
        place: 0 is the good set, 1 the returned one. `place_std`: within the class.
        friction_std, leakage_std: of the logarithms, about the friction and leakage of the place.
    """

    place: float
    place_std: float
    friction_std: float
    leakage_std: float


CLASS: Mapping[str, Wear] = {
    "good": Wear(0.0, 0.12, 0.5, 0.10),
    "malfunctioned": Wear(0.7, 0.15, 0.7, 0.15),
    "severely malfunctioned": Wear(1.3, 0.20, 0.9, 0.20),
}
# Of every valve, new or worn: standard deviations; of the logarithm but for the shift of the curve, in A.
SPREAD = {"curve_shift": 0.02, "curve_stretch": 0.05, "pressure_span": 0.03, "rotor_frequency": 0.08, "coil_lag": 0.10}


def valve(name: str, friction_a: float | None = None) -> Model:
    """One of the sets, `good`, `prototype` or `return`, as a model of the plant `efc-drive`."""
    one = SETS[name] if friction_a is None else replace(SETS[name], friction_a=friction_a)
    return _made(_parameters(one), one.friction_a, {"source": f"Tugsal, {name} valve", "declared": DECLARED})


def population(
    count: int, seed: int, normally_open: bool = False
) -> tuple[tuple[Model, ...], np.ndarray[tuple[int], np.dtype[np.int64]]]:
    """Valves of all classes in equal parts, and the place of each one's class in `CLASSES`."""
    rng = np.random.default_rng(seed)
    labels = np.arange(count, dtype=np.int64) % len(CLASSES)
    return tuple(_drawn(CLASS[CLASSES[label]], rng, normally_open) for label in labels), labels


def _drawn(wear: Wear, rng: np.random.Generator, normally_open: bool) -> Model:
    base = typical_model("efc-drive")
    one = SETS["good"].toward(SETS["return"], wear.place + wear.place_std * rng.normal())

    def about(median: float, spread: float) -> float:
        return float(median * np.exp(spread * rng.normal()))

    values = _parameters(one) | {"normally_open": float(normally_open)}
    for name, spread in SPREAD.items():
        usual = values.get(name, base.parameters[name].value)
        values[name] = spread * rng.normal() if name == "curve_shift" else about(usual, spread)
    values["leakage"] = about(one.leakage_ml_min, wear.leakage_std)
    return _made(values, about(one.friction_a, wear.friction_std), {"source": "population"})


def _parameters(one: ValveSet) -> dict[str, float]:
    return {"rotor_frequency": one.rotor_frequency, "rotor_damping": one.rotor_damping, "leakage": one.leakage_ml_min}


def _made(changed: Mapping[str, float], friction_a: float, origin: Mapping[str, object]) -> Model:
    from hil.physics.compose import effect

    base = typical_model("efc-drive")
    parameters = {
        name: replace(old, value=float(changed[name])) if name in changed else old
        for name, old in base.parameters.items()
    }
    friction = {
        p.name: Value(p.typical, p.unit) for p in effect("friction").parameters_at(base.definition.hook("force"))
    }
    friction["coulomb"] = replace(friction["coulomb"], value=friction_a)
    return replace(
        base, parameters=parameters, effects=(ModelEffect("friction", "force", friction),), origin=dict(origin)
    )
