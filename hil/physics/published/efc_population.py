"""Good, prototype and returned EFC valves as parameter sets, and populations of valves drawn about them.

What the thesis leaves open is chosen here and listed in `DECLARED`. The populations are ours: the thesis tested four
valves.
"""

from __future__ import annotations

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
    "friction of the three sets": "0.5, 1 and 2 mA, what a dither leaves: with more, a sine of the low level (±6 mA) "
    "would not move the returned valve, and the published order at that level would not show",
    "friction and leakage of a population": "stickiness and leakage are named as causes, without numbers; WEAR has "
    "4 mA and 80 ml/min for a new valve, 16 and 45 mA for worn ones",
    "spread of a population": "see SPREAD; classes overlap",
}

_SETS: Mapping[str, Mapping[str, float]] = {
    "good": {"rotor_frequency": 187.0, "rotor_damping": 3.14},
    "prototype": {"rotor_frequency": 57.4, "rotor_damping": 1.38},
    "return": {"rotor_frequency": 33.0, "rotor_damping": 1.09, "leakage": 100.0},
}
_FRICTION_A = {"good": 0.0005, "prototype": 0.001, "return": 0.002}


@dataclass(frozen=True, slots=True)
class Wear:
    """What a class of valves is drawn from: medians, and standard deviations of their logarithms.

    Attributes:
        friction_a: Coulomb friction as the current it withstands.
        slowing: damping of the rotor over that of a new valve.
        leakage_ml_min: at 220 psi.
    """

    friction_a: tuple[float, float]
    slowing: tuple[float, float]
    leakage_ml_min: tuple[float, float]


# By class, in the order of CLASSES.
WEAR = (
    Wear((0.004, 0.5), (1.0, 0.06), (80.0, 0.15)),
    Wear((0.016, 0.45), (1.25, 0.12), (90.0, 0.20)),
    Wear((0.045, 0.45), (1.7, 0.18), (110.0, 0.30)),
)
# Of every valve, new or worn: standard deviations; of the logarithm but for the shift of the curve, in A.
SPREAD = {"curve_shift": 0.02, "curve_stretch": 0.05, "pressure_span": 0.03, "rotor_frequency": 0.08, "coil_lag": 0.10}


def valve(name: str, friction_a: float | None = None) -> Model:
    """One of the sets, `good`, `prototype` or `return`, as a model of the plant `efc-drive`."""
    friction = _FRICTION_A[name] if friction_a is None else friction_a
    return _made(_SETS[name], friction, {"source": f"Tugsal, {name} valve", "declared": DECLARED})


def population(count: int, seed: int) -> tuple[tuple[Model, ...], np.ndarray[tuple[int], np.dtype[np.int64]]]:
    """Valves of all classes in equal parts, and the place of each one's class in `CLASSES`."""
    rng = np.random.default_rng(seed)
    labels = np.arange(count, dtype=np.int64) % len(CLASSES)
    return tuple(_drawn(WEAR[label], rng) for label in labels), labels


def _drawn(wear: Wear, rng: np.random.Generator) -> Model:
    base = typical_model("efc-drive")

    def about(median_and_spread: tuple[float, float]) -> float:
        median, spread = median_and_spread
        return float(median * np.exp(spread * rng.normal()))

    values = {
        name: spread * rng.normal() if name == "curve_shift" else about((base.parameters[name].value, spread))
        for name, spread in SPREAD.items()
    }
    values["rotor_damping"] = base.parameters["rotor_damping"].value * about(wear.slowing)
    values["leakage"] = about(wear.leakage_ml_min)
    return _made(values, about(wear.friction_a), {"source": "population"})


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
