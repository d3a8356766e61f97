"""The models that a step alone supports, and how far each is from a measured response: eqs 9 to 22 of the HPV41 paper.

Two first-order models, from the rise and from the settling time, and the second-order one that has both. Beside a
measured frequency response stands the third-order model that is fitted to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hil.errors import InputError
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.frequency.rational import Form
from hil.identification.frequency.transfer_function import fit_form
from hil.identification.step.step_response import (
    damping_roots,
    dead_time_explaining,
    first_order_from_rise,
    first_order_from_settling,
    second_order_from_step,
)
from hil.identification.uncertainty.fit import bode_errors, fit_percent
from hil.identification.uncertainty.propagation import central_slopes
from hil.language.note import Note
from hil.physics.formula import formula, root_text
from hil.physics.transfer_function import TransferFunction, coefficient_names
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.plain import plain
from hil.record.recording import Array, Complex
from hil.signals.interval import rounded, width

SCHEMA = "hil.step-models/1"

_PAPER_BAND, _PAPER_CONSTANT = 0.02, 4.0
_STEP = 1e-4  # of a time, for the slopes of coefficients
_LEAST_DELAY = 0.1  # of the settling time, from which a dead time is worth a word


@dataclass(frozen=True, slots=True)
class StepModel:
    """A model of unit gain, and how it agrees with a measured response (see `over_lowest`).

    Attributes:
        name: what it was made from.
        model: of unit gain.
        covariance: of numerator and denominator without its leading 1, by those of the two times; (0, 0) when unknown.
        fit_percent: complex fit to the response, None without one.
        gain_error_db, phase_error_deg: rms, likewise.
    """

    name: str
    model: TransferFunction
    covariance: Array
    fit_percent: float | None = None
    gain_error_db: float | None = None
    phase_error_deg: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """As a fitted function among results, with the errors beside it."""
        known = bool(self.covariance.size)
        above, below = self.model.numerator, self.model.denominator
        names = coefficient_names(len(above) - 1, len(below) - 1) if known else ()
        return {
            "label": self.name, "numerator": above, "denominator": below, "dead_time_s": 0.0, "unit": "1",
            "coefficients": list(names), "covariance": self.covariance, "fit_percent": self.fit_percent,
            "gain_error_db": self.gain_error_db, "phase_error_deg": self.phase_error_deg,
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class StepModels:
    """Every model of one step.

    Attributes:
        rise_s, settling_s: T_r and T_s.
        roots: of eq. 17.
        models: the two of first order, that of second order if there is one, the third-order fit to a response.
        notes: what the reader should know.
        label: from which command to which, where that is known.
        std_s: standard uncertainties of T_r and T_s; infinite where noise can move one past the record.
    """

    rise_s: float
    settling_s: float
    roots: Complex
    models: tuple[StepModel, ...]
    notes: tuple[Note, ...]
    label: str = ""
    std_s: tuple[float, float] | None = None

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        roots = [{"re": float(root.real), "im": float(root.imag)} for root in self.roots]
        return plain({
            "schema": SCHEMA, "step": self.label, "rise_s": self.rise_s, "settling_s": self.settling_s,
            "rise_std_s": self.std_s and self.std_s[0], "settling_std_s": self.std_s and self.std_s[1],
            "damping_roots": roots,
            "models": [model.as_dict() for model in self.models], "notes": list(self.notes),
        })  # fmt: skip

    def as_text(self) -> str:
        """As lines for a terminal."""
        roots = ", ".join(root_text(root) for root in self.roots)
        times = f"rise {self._time(0)}, settling {self._time(1)}"
        of = f"{self.label}: " if self.label else ""
        rows = [f"{of}{times}{', roots of eq. 17: ' + roots if roots else ''}"]
        for one in self.models:
            error = ""
            if one.fit_percent is not None:
                rms = f"{one.gain_error_db:.2g} dB and {one.phase_error_deg:.2g}°"
                error = f"; fit {one.fit_percent:.1f} %, rms error {rms}"
            rows.append(f"  {one.name}: {formula(one.model)}{error}")
        return "\n".join([*rows, *(f"  note: {note}" for note in self.notes)])

    def _time(self, which: int) -> str:
        value = (self.rise_s, self.settling_s)[which]
        if not math.isfinite(value):
            return "not reached"
        if self.std_s is None:
            return f"{value:.4g} s"
        std_s = self.std_s[which]
        return (
            f"{rounded(value, std_s)} {width(std_s)} s" if math.isfinite(std_s) else f"{value:.4g} s, not identifiable"
        )


def step_models(
    rise_s: float,
    settling_s: float,
    response: FrequencyResponse | None = None,
    *,
    band: float = _PAPER_BAND,
    std_s: tuple[float, float] | None = None,
) -> StepModels:
    """The models of a step.

    Args:
        rise_s: from 10 % to 90 % of the change.
        settling_s: after which the response stays within the band.
        response: measured, to stand beside.
        band: share of the change that counts as settled; 4/T_s of the paper belongs to 2 %, other bands take −ln(band).
        std_s: standard uncertainties of the two times, taken as independent.

    Raises:
        InputError: a time that is not above 0 or not known.
    """
    for name, value in (("rise", rise_s), ("settling", settling_s)):
        if not (value > 0.0 and math.isfinite(value)):
            known = f"is {value:g} s; it must be above 0" if math.isfinite(value) else "is not known"
            raise InputError(f"models of a step: the {name} time {known}")
    constant = _PAPER_CONSTANT if band == _PAPER_BAND else -math.log(band)
    effective_s = settling_s * _PAPER_CONSTANT / constant
    notes = []
    of_step = partial(_model, times=(rise_s, effective_s), std_s=std_s)
    made = [
        of_step(Note("first order, from the rise"), lambda t: first_order_from_rise(t[0])),
        of_step(Note("first order, from settling"), lambda t: first_order_from_settling(t[1])),
    ]
    try:
        made.append(of_step(Note("second order"), lambda t: second_order_from_step(*t)))
    except InputError as error:
        notes.append(Note("{why}", why=str(error)))
    lag_s, late_s = dead_time_explaining(rise_s, settling_s, band)
    late_std_s = math.hypot(std_s[1], std_s[0] * (settling_s - late_s) / rise_s) if std_s else 0.0
    if late_s > max(_LEAST_DELAY * settling_s, COVERAGE_FACTOR * late_std_s):
        notes.append(Note(
            "settling is longer than a lag of this rise settles; a lag of {lag_s:.3g} s and a dead time of "
            "{late_s:.3g} s have both times",
            lag_s=lag_s, late_s=late_s,
        ))  # fmt: skip
    if response is not None:
        over = over_lowest(response)
        made = [_beside(one, over) for one in made]
        made.append(_third_order(over))
    roots = damping_roots(rise_s, effective_s)
    return StepModels(rise_s, settling_s, roots, tuple(made), tuple(notes), std_s=std_s)


def over_lowest(response: FrequencyResponse) -> FrequencyResponse:
    """A response over its gain at the lowest frequency (eq. 1); one without a unit is a ratio already, and stays."""
    return response if (response.input_unit, response.output_unit) == ("1", "1") else response.normalised()


def _model(
    name: str,
    make: Callable[[tuple[float, float]], TransferFunction],
    times: tuple[float, float],
    std_s: tuple[float, float] | None,
) -> StepModel:
    model = make(times)
    if std_s is None or not all(map(math.isfinite, std_s)):
        return StepModel(name, model, np.zeros((0, 0)))
    at = np.array(times)
    slopes = central_slopes(lambda moved: _coefficients(make((moved[0], moved[1]))), at, _STEP * at)
    return StepModel(name, model, slopes @ np.diag(np.square(std_s)) @ slopes.T)


def _coefficients(model: TransferFunction) -> Array:
    return np.concatenate((model.numerator, model.denominator[1:]))


def _beside(one: StepModel, response: FrequencyResponse) -> StepModel:
    found = one.model.at(response.frequency_hz)
    fit, errors = fit_percent(response.response, found), bode_errors(response.response, found)
    return StepModel(one.name, one.model, one.covariance, fit, *errors)


def _third_order(response: FrequencyResponse) -> StepModel:
    fit = fit_form(response, Form(3, 1))
    name = Note("third order, fitted to the response")
    return _beside(StepModel(name, fit.model, fit.coefficient_covariance), response)
