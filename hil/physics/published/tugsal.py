"""Cummins EFC as Tugsal's thesis publishes it: specification, transfer functions, table 4.1 and its classifiers.

U. Tugsal: Fault diagnosis of electronic fuel control (EFC) valves via dynamic performance test method, Purdue
University 2009. Numbers are as printed; what is wrong with some of them, and what had to be chosen because
the thesis leaves it open, stands in docs/explanation/efc-thesis.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hil.language.words import marked
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Array, Complex
from hil.signals.recursion import filtered

Level = Literal["low", "high"]
Class = Literal["good", "malfunctioned", "severely malfunctioned"]
CLASSES: tuple[Class, ...] = (marked("good"), marked("malfunctioned"), marked("severely malfunctioned"))

# Section 3.1.2: resistance at 72 °F, by nominal voltage.
RESISTANCE_OHM = {12: (2.1, 0.4), 24: (7.2, 0.4)}
INDUCTANCE_LIMIT_H = 0.120

# Limits of the specification that no bench of this kind drives: pressure at which nothing bursts, voltage over nominal
# and its time.
BURST_PSI = 400.0
OVERVOLTAGE, OVERVOLTAGE_H = 1.33, 48.0

# Section 3.1.3.1: pressures between which each sweep swings. The names are levels: "high" is the smallest but one.
SWEEPS_PSI = {"low": (19.0, 21.0), marked("medium"): (20.0, 140.0), "high": (133.0, 147.0)}

# Section 3.1.3.2: step currents and the mean largest pressure that each reaches.
STEP_CURRENTS_A = (1.2, 1.4, 1.6, 1.8, 2.0)
STEP_PRESSURES_PSI = (3.1, 26.0, 120.0, 160.0, 210.0)
CLASSIFIED_CURRENT_A: Mapping[Level, float] = {"low": 1.4, "high": 1.6}

DECLARED = {
    "unit of the corner frequencies": "rad/s for what is recomputed here (the thesis does not say rad/s or Hz)",
    "damping of the quadratic factors": "the same ζ above and below, as the same letter is printed; then they cancel",
    "kdc": "1/DC of the other factors, because the gains are called normalised",
    "s² over 6.5s², 8.5s², 7.5s²": "s²/6.5², s²/8.5², s²/7.5²: as printed there would be no s² at all",
    "DC gain and sample period of the models in z": "not stated; the models are unstable and generate nothing here",
}


@dataclass(frozen=True, slots=True)
class FrequencyModel:
    """A transfer function of section 3.2.1.3 with its printed factors.

    (s/a + b)·Q(w)²·kdc / ((s/c + d)·Q(w)²·tail), Q(w) = s²/w² + 2ζs/w + 1.

    Attributes:
        lead, lag: (a, b) and (c, d).
        cancelled: w of the quadratic factor that stands squared above and below.
        tail: corner of the remaining factors. `tail_order`: their number of poles; the prototype's are two Q.
    """

    name: str
    lead: tuple[float, float]
    lag: tuple[float, float]
    cancelled: float
    tail: float
    tail_order: int
    quadratic_tail: bool = False

    def reduced(self, damping: float = 0.5) -> TransferFunction:
        """What is left when the equal factors have cancelled, gain at rest 1."""
        return transfer_function(self._corner(self.lead), np.convolve(self._corner(self.lag), self._tail(damping)))

    @staticmethod
    def _corner(factor: tuple[float, float]) -> Array:
        rate, constant = factor
        return np.array([1.0 / (rate * constant), 1.0])

    def _tail(self, damping: float) -> Array:
        one = _quadratic(self.tail, damping) if self.quadratic_tail else np.array([1.0 / self.tail, 1.0])
        made = np.ones(1)
        while len(made) - 1 < self.tail_order:
            made = np.convolve(made, one)
        return made


FREQUENCY_MODELS = {
    "prototype": FrequencyModel("prototype", (0.5, 12.5), (12.25, 12.5), 6.5, 9.75, 4, quadratic_tail=True),
    "good": FrequencyModel("good", (1.05, 12.5), (1.75, 3.5), 8.5, 10.0, 2),
    "return": FrequencyModel("return", (1.05, 12.5), (1.05, 3.5), 7.5, 10.0, 3),
}


@dataclass(frozen=True, slots=True)
class SampledModel:
    """B(z⁻¹)/A(z⁻¹), coefficients from z⁰ on."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    @property
    def poles(self) -> Complex:
        """In z, largest first."""
        found = np.roots(self.denominator).astype(np.complex128)
        return found[np.argsort(-np.abs(found), kind="stable")]

    @property
    def dc_gain(self) -> float:
        """B(1)/A(1); the gain at rest only if the model is stable."""
        return sum(self.numerator) / sum(self.denominator)

    def response(self, command: Array) -> Array:
        """Output for a command of shape (n,), from rest."""
        return filtered(self.numerator, self.denominator, command)


# Section 3.2.2.3, to the last printed digit.
SAMPLED_MODELS = {
    "prototype": SampledModel(
        (-0.001, 0.001, 0.0, 0.0, 0.001), (1.0, -4.679, 9.469, -11.31, 9.644, -6.813, 3.919, -1.493)
    ),
    "good": SampledModel(
        (-0.001, 0.0, 0.0, 0.002, 0.0, 0.05), (1.0, -2.501, 2.209, -1.0, 0.464, -0.208, 0.078, -0.007)
    ),
    "return": SampledModel((0.0, 0.0, 0.0, 0.001, 0.001), (1.0, -5.058, 11.2, -14.6, 12.93, -8.539, 4.261, -1.416)),
}

# Section 3.2.2.2: the example, and the estimates from its sine; those from the step are exact but for the sign
# of b0, which is −0.0010 in the text and +0.001 in table 3.2.
EXAMPLE = SampledModel((0.001, 0.0, 1.0), (1.0, 0.0, 0.3, 0.0, -0.5))
EXAMPLE_FROM_SINE = SampledModel((-0.0105, 0.0488, 0.9186), (1.0, -0.0578, 0.3069, -0.0221, -0.4623))

# Table 4.1, cell by cell as printed. Two things slipped: the group of 15969046 begins one row too early, and the
# last two rows have lost their first two, empty, cells.
TABLE_4_1_AS_PRINTED: tuple[tuple[str, str, str, str], ...] = (
    ("16011093", "New", "1.0156", "0.9048"), ("", "", "1.0030", "0.9174"), ("", "", "1.0378", "0.9229"),
    ("", "", "1.0396", "0.8740"), ("", "", "1.0233", "0.8837"), ("", "", "1.0611", "0.8788"),
    ("", "", "1.0634", "0.8328"), ("", "", "1.0476", "0.9143"), ("", "", "1.0536", "0.8498"),
    ("", "", "1.0249", "0.9128"),
    ("16011094", "New", "1.0025", "0.8931"), ("", "", "0.9742", "0.8553"), ("", "", "0.9740", "0.8388"),
    ("", "", "0.9810", "0.8046"), ("", "", "0.9746", "0.8814"), ("", "", "0.9682", "0.8076"),
    ("", "", "0.9704", "0.8168"), ("", "", "0.9704", "0.8321"), ("", "", "0.9793", "0.7948"),
    ("15969045", "Return", "1.8048", "1.0689"), ("", "", "1.8048", "1.0659"), ("", "", "1.6242", "1.0763"),
    ("", "", "1.5982", "1.0706"), ("", "", "1.6573", "1.1234"), ("", "", "1.6254", "1.0779"),
    ("", "", "1.5485", "1.1019"), ("", "", "1.6291", "1.0546"), ("", "", "1.7645", "1.0782"),
    ("15969046", "Return", "1.6671", "1.0934"), ("", "", "1.2697", "0.9865"), ("", "", "1.2176", "1.0326"),
    ("", "", "1.3267", "1.0139"), ("", "", "1.3357", "1.0078"), ("", "", "1.2477", "0.9998"),
    ("", "", "1.2507", "1.0061"), ("", "", "1.1917", "1.0025"), ("", "", "1.2510", "0.9852"),
    ("1.2268", "1.0106", "", ""), ("1.2363", "0.9862", "", ""),
)  # fmt: skip

CLASS_OF_SERIAL: Mapping[str, Class] = {
    "16011093": "good", "16011094": "good", "15969045": "severely malfunctioned", "15969046": "malfunctioned",
}  # fmt: skip

# Section 4.1.3: from which error on a valve is malfunctioned, and severely so.
THRESHOLDS: Mapping[Level, tuple[float, float]] = {"low": (1.065, 1.535), "high": (0.923, 1.041)}


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """A row of table 4.1: the error of eq. 4.1 at the low and the high current."""

    serial: str
    low: float
    high: float

    def error(self, level: Level) -> float:
        """One of the two."""
        return self.low if level == "low" else self.high


def table_4_1() -> tuple[ErrorRow, ...]:
    """Table 4.1 with both slips repaired: 39 rows, 78 errors."""
    rows: list[tuple[str, ...]] = [row if row[2] else ("", "", *row[:2]) for row in TABLE_4_1_AS_PRINTED]
    late = [serial for serial, *_ in rows].index("15969046")
    (serial, condition, *first), (_, _, *second) = rows[late], rows[late + 1]
    rows[late : late + 2] = [("", "", *first), (serial, condition, *second)]
    made, current = [], ""
    for serial, _, low, high in rows:
        current = serial or current
        made.append(ErrorRow(current, float(low), float(high)))
    return tuple(made)


def crisp_class(error: float, level: Level) -> Class:
    """The rule of section 4.1.3."""
    malfunctioned, severe = THRESHOLDS[level]
    return CLASSES[(error >= malfunctioned) + (error >= severe)]


def error_4_1(measured: Array, simulated: Array, duration_s: float) -> float:
    """Eq. 4.1: √Σ(measured − simulated)² over the duration. It grows with the root of the sample rate."""
    return float(np.linalg.norm(measured - simulated)) / duration_s


def rms_error(measured: Array, simulated: Array) -> float:
    """The form of eq. 4.1 that does not depend on the sampling: the root mean square error."""
    return float(np.linalg.norm(measured - simulated)) / math.sqrt(len(measured))


# -- membership functions, eqs 4.2 to 4.7 ------------------------------------------------------------------

_CURRENT_A = (1.4, 1.45, 1.55, 1.6)
_ERROR = (0.4, 0.5, 0.8, 0.9, 1.1, 1.2, 1.3, 1.5, 1.6, 1.8)


def current_memberships(current_a: float) -> dict[Level, float]:
    """Eqs 4.2 and 4.3: how far a current is low and high."""
    x1, x2, x3, x4 = _CURRENT_A
    return {"low": _share(x3 - current_a, x3 - x1), "high": _share(current_a - x2, x4 - x2)}


def error_memberships(error: float) -> tuple[float, float, float, float]:
    """Eqs 4.4 to 4.7: left trapezoid, left triangle, right triangle, right trapezoid."""
    x1, x2, x3, x4, x5, x6, x7, x8, x9, x10 = _ERROR
    return (
        _share(x3 - error, x3 - x1),
        min(_share(error - x2, x4 - x2), _share(x6 - error, x6 - x4)),
        min(_share(error - x5, x7 - x5), _share(x9 - error, x9 - x7)),
        _share(error - x8, x10 - x8),
    )


def _quadratic(corner: float, damping: float) -> Array:
    return np.array([1.0 / corner**2, 2.0 * damping / corner, 1.0])


def _share(part: float, whole: float) -> float:
    return min(max(part / whole, 0.0), 1.0)
