"""Frequency responses as findings: bandwidths, transfer function, curves; for sines and for multisines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hil.errors import InputError
from hil.identification.frequency.bands import bode_band
from hil.identification.frequency.bandwidth import Bandwidth, Crossing, bandwidth
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.frequency.linear_evidence import LEAST_FIT_PERCENT, doubts, unresolved
from hil.identification.frequency.measuring_chain import check_chain, corrected
from hil.identification.frequency.order_choice import fit_together, fit_transfer_function
from hil.identification.frequency.transfer_function import TransferFunctionFit
from hil.identification.uncertainty.fit import fit_percent
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, about, draws_of
from hil.language.note import Note
from hil.physics.formula import formula
from hil.record.measurement import COVERAGE_FACTOR, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.signals.decibel import decibels
from procedures._recorded import calibration_share, chain_of, reading_of, roles_of, settings_of

GAIN = Measurement("gain", "", "amplitude ratio at the reference frequency")
BANDWIDTH_3DB = Measurement("bandwidth_3db", "Hz", "frequency at which the amplitude ratio is 3 dB below the reference")
BANDWIDTH_90DEG = Measurement("bandwidth_90deg", "Hz", "frequency at which the response lags by 90°")
MODEL_FIT = Measurement("model_fit", "%", "fit of the transfer function to the response")
MEASURED = (GAIN, BANDWIDTH_3DB, BANDWIDTH_90DEG, MODEL_FIT)

_CURVE_POINTS = 200
_TINY = 1e-300  # a covariance of nothing has a root too
_THIRD = 1  # place of harmonic 3 among harmonics 2…


@dataclass(frozen=True, slots=True)
class Evaluated:
    """One response with what was made of it.

    Attributes:
        fit: None where the lines bear out no linear model; `notes` say why.
        poor_percent: the least fit that was asked for, where the best fit is below it.
        gain_share: what the calibrations add to the gain, as a share.
    """

    label: str
    response: FrequencyResponse
    bandwidth: Bandwidth
    fit: TransferFunctionFit | None
    notes: tuple[Note, ...]
    poor_percent: float | None = None
    gain_share: float = 0.0

    @property
    def follows(self) -> bool:
        """Whether the response at the reference stands out of its noise: else nothing can be counted from there."""
        return COVERAGE_FACTOR * float(self.response.gain_std[0]) < float(abs(self.response.response[0]))

    def measured(self) -> tuple[Measured, ...]:
        """The quantities of `MEASURED`."""
        at, unit = self.response, self.response.gain_unit
        gain, std = float(abs(at.response[0])), float(at.gain_std[0])
        known = GAIN.at(self.label, unit).size(gain, std, calibration=self.gain_share * gain)
        crossings = ((BANDWIDTH_3DB, self.bandwidth.amplitude), (BANDWIDTH_90DEG, self.bandwidth.phase))
        found = [
            crossed(what.at(self.label), one) if self.follows else what.at(self.label).of(None)
            for what, one in crossings
        ]
        return (known, *found, self._model_fit())

    def explained(self) -> tuple[Note, ...]:
        """The notes; where the valve does not follow, this alone."""
        if self.follows:
            return self.notes
        at = self.response
        why = Note(
            "the valve does not follow here: its response at {reference_hz:g} Hz, the reference, is within its noise, "
            "so no bandwidth can be determined. Drive it about another bias or with a larger amplitude.",
            reference_hz=at.frequency_hz[0],
        )
        return (why.at(self.label),)

    def _model_fit(self) -> Measured:
        asked = MODEL_FIT.at(self.label)
        if self.poor_percent is not None:
            return asked.of(self.poor_percent, 0.0, relation="<")
        return asked.of(None) if self.fit is None else _fit_known(asked, self.fit, self.response)

    def curve(self, **more: Any) -> dict[str, Any]:
        """The entry of `responses` (docs/reference/procedures.md)."""
        at, relative = self.response, self.response.normalised()
        amplitude, phase = self.bandwidth.amplitude, self.bandwidth.phase
        if not self.follows:
            amplitude, phase = (replace(one, frequency_hz=None, std_hz=math.nan) for one in (amplitude, phase))
        alternative = None if self.fit is None else self.fit.alternative
        if alternative is not None and doubts(alternative):
            alternative = None
        return {
            "label": self.label, "amplitude": at.amplitude, "bias": at.bias,
            "command_unit": at.input_unit, "response_unit": at.output_unit,
            "frequency_hz": at.frequency_hz,
            "gain": np.abs(at.response), "gain_std": at.gain_std, "gain_unit": at.gain_unit,
            "reference_hz": self.bandwidth.reference_hz,
            "magnitude_db": relative.magnitude_db, "magnitude_std_db": relative.magnitude_std_db,
            "phase_deg": at.phase_deg, "phase_std_deg": at.phase_std_deg,
            "bandwidth_3db_hz": amplitude.frequency_hz, "bandwidth_3db_std_hz": _finite(amplitude.std_hz),
            "bandwidth_90deg_hz": phase.frequency_hz, "bandwidth_90deg_std_hz": _finite(phase.std_hz),
            "model": None if self.fit is None else _model(self.fit, at),
            "alternative": None if alternative is None else _model(alternative, at),
            "thd_percent": None, "overlays": [], "noise_db": None, "odd_db": None, "even_db": None,
            **more,
        }  # fmt: skip


def evaluated(recording: Recording, responses: Iterable[FrequencyResponse]) -> tuple[Evaluated, ...]:
    """Each response without the measuring chain (if the run asks for it), with bandwidths and transfer function."""
    settings, chain = settings_of(recording), chain_of(recording)
    share = math.hypot(*(calibration_share(channel) for channel in roles_of(recording)))
    found = [corrected(raw, chain) if settings["correct_chain"] else raw for raw in responses]
    least = [_least_fit(recording, one.label) for one in found]
    asked = {name: settings[name] for name in ("poles", "zeros", "dead_time")}
    fits = fit_together([_to_be_linear(one) for one in found], **asked)
    if not any(fit and not doubts(fit, low) for fit, low in zip(fits, least, strict=True)):
        fits = (None,) * len(found)  # no lines bear the form out: each may have fewer poles
    return tuple(
        replace(_with_model(one, fit, settings, low), gain_share=share)
        for one, fit, low in zip(found, fits, least, strict=True)
    )


def chain_notes(recording: Recording, frequency_hz: Array) -> tuple[tuple[Note, ...], tuple[Note, ...]]:
    """(notes, deviations) about the measuring chain's own effect."""
    chain = chain_of(recording)
    check = check_chain(chain, frequency_hz)
    if check.broken_from_hz is None:
        return (check.sentence,), ()
    if not settings_of(recording)["correct_chain"]:
        return (), (check.sentence,)
    worst = int(np.argmax(np.abs(check.phase_deg)))
    note = Note(
        "The measuring chain has been taken out of the responses: sensor lag {lag_ms:g} ms, {reading}, command held "
        "{hold_ms:.4g} ms. At {worst_hz:g} Hz it is {amplitude:+.1f} % and {phase_deg:+.1f}°.",
        lag_ms=1e3 * chain.sensor_lag_s, reading=reading_of(recording, chain), hold_ms=1e3 * chain.hold_s,
        worst_hz=frequency_hz[worst], amplitude=100 * check.amplitude_change[worst],
        phase_deg=check.phase_deg[worst],
    )  # fmt: skip
    return (note,), ()


def reference_deviations(found: Sequence[Evaluated]) -> tuple[Note, ...]:
    """Where the reference frequency is not that of the standard, alike ones together."""
    labels: dict[Note, list[str]] = {}
    for one in found:
        for note in one.bandwidth.notes if one.follows else ():
            labels.setdefault(note, []).append(one.label)
    return tuple(note.at(", ".join(where)).stopped for note, where in labels.items())


def crossed(measurement: Measurement, crossing: Crossing) -> Measured:
    """A crossing as a measured value; a bound where it lies above the top frequency or before the lowest."""
    if crossing.below_hz is not None:
        return measurement.of(crossing.below_hz, 0.0, relation="<")
    if crossing.frequency_hz is None:
        return measurement.of(crossing.beyond_hz, 0.0, relation=">") if crossing.beyond_hz else measurement.of(None)
    return measurement.of(crossing.frequency_hz, _finite(crossing.std_hz))


def _fit_known(what: Measurement, fit: TransferFunctionFit, at: FrequencyResponse) -> Measured:
    """The fit of the model to the response without noise: what noise adds to the misfit makes it look worse."""
    noise = draws_of(at.response).normal(size=(DRAWS, len(at), 2))
    parts = np.einsum("nij,dnj->dni", np.linalg.cholesky(at.covariance + _TINY * np.eye(2)), noise)
    modelled = np.asarray(fit.model.at(at.frequency_hz), dtype=np.complex128)
    drawn = [fit_percent(at.response + one[:, 0] + 1j * one[:, 1], modelled) for one in parts]
    return what.of(fit.fit_percent, about(np.array(drawn), fit.fit_percent))


def _least_fit(recording: Recording, label: str) -> float:
    """The fit from which on a response is called linear, in per cent: the limit of `model_fit`, if it has one."""
    limits = recording.meta.get("limits", {})
    given = limits.get(f"{MODEL_FIT.name}, {label}") or limits.get(MODEL_FIT.name) or {}
    low = given.get("low")
    return LEAST_FIT_PERCENT if low is None else float(low)


def _with_model(
    response: FrequencyResponse, common: TransferFunctionFit | None, settings: Mapping[str, Any], least_percent: float
) -> Evaluated:
    """The response with its bandwidths, and a transfer function where the lines bear one out.

    `common` is its fit in the form of all responses, which those bear out.
    """
    label, corners = response.label, bandwidth(response)
    try:
        fit, why, fewer = _borne_out(response, common, settings, least_percent)
    except InputError as error:
        none = Note("no transfer function: {why}", why=str(error))
        return Evaluated(label, response, corners, None, (none.at(label),))
    if why:
        poor = least_percent if fit.fit_percent < least_percent else None
        note = Note("no linear model with {n} poles: {reasons:; }.", n=fit.form.poles, reasons=why)
        return Evaluated(label, response, corners, None, (note.at(label),), poor)
    notes = [*fewer, *fit.notes]
    if fit.fit_percent < LEAST_FIT_PERCENT:
        notes.append(Note(
            "the transfer function fits {fit:.1f} %, less than the customary {usual:g} %; this bench asks for "
            "{least:g} %.",
            fit=fit.fit_percent, usual=LEAST_FIT_PERCENT, least=least_percent,
        ))  # fmt: skip
    return Evaluated(label, response, corners, fit, tuple(note.at(label) for note in notes))


def _borne_out(
    response: FrequencyResponse, common: TransferFunctionFit | None, settings: Mapping[str, Any], least_percent: float
) -> tuple[TransferFunctionFit, tuple[Note, ...], tuple[Note, ...]]:
    """A fit with as many poles as were asked for, or fewer where the lines bear out only those.

    Returns:
        The fit, why it is none, and a sentence where it has fewer poles or needs the other responses.
    """
    if common is not None and common.fit_percent >= least_percent:
        alone = unresolved(common)
        note = Note("other responses bear out this form, these lines alone do not ({reasons:; }).", reasons=alone)
        return common, (), (note,) if alone else ()
    poles, lines = settings["poles"], _to_be_linear(response)
    asked = {name: settings[name] for name in ("zeros", "dead_time")}
    first = fit_transfer_function(lines, poles=poles, **asked)
    why = doubts(first, least_percent)
    for fewer in range((poles or 1) - 1, max(asked["zeros"] or 0, 1) - 1, -1) if why else ():
        fit = fit_transfer_function(lines, poles=fewer, **asked)
        if not doubts(fit, least_percent):
            less = Note("{n} poles are not borne out ({reasons:; }); {fewer} are.", n=poles, reasons=why, fewer=fewer)
            return fit, (), (less,)
    return first, why, ()


def _to_be_linear(response: FrequencyResponse) -> FrequencyResponse:
    """The response as a linear model is asked to explain it: no closer than its third harmonic.

    What bends a sine into a third harmonic moves its fundamental by as much; with little noise, a fit would buy poles
    to follow that.
    """
    if response.harmonics.shape[1] < _THIRD + 1:
        return response
    moved = np.abs(response.harmonics[:, _THIRD] * response.response) ** 2 / 2.0
    return replace(response, covariance=response.covariance + moved[:, None, None] * np.eye(2))


def _model(fit: TransferFunctionFit, response: FrequencyResponse) -> dict[str, Any]:
    low, high = float(response.frequency_hz[0]), float(response.frequency_hz[-1])
    frequency_hz = np.geomspace(low, high, _CURVE_POINTS) if high > low else response.frequency_hz
    band = bode_band(fit, frequency_hz)
    reference_db = float(decibels(response.response[0]))
    return {
        "text": fit.summary(), "formula": formula(fit.model), "fit_percent": fit.fit_percent,
        **asdict(fit.model), "unit": response.gain_unit,
        "coefficients": fit.coefficient_names, "covariance": fit.coefficient_covariance,
        "dead_time_std_s": float(fit.coefficient_std[-1]) if fit.form.dead_time else None, "frequency_hz": frequency_hz,
        "magnitude_db": band.magnitude_db - reference_db, "magnitude_std_db": band.magnitude_std_db,
        "phase_deg": band.phase_deg + _turns(band.phase_deg[0], response.phase_deg[0]),
        "phase_std_deg": band.phase_std_deg,
    }  # fmt: skip


def _turns(modelled_deg: float, measured_deg: float) -> float:
    """Whole turns between two unwrapped phases that mean the same."""
    return 360.0 * round((measured_deg - modelled_deg) / 360.0)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
