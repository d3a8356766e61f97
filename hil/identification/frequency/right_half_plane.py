"""A zero in the right half plane is more often a dead time: say so, and offer the dead time instead.

A first-order Padé approximation of a delay τ has a zero at +2/τ. A fit of poles and zeros to a frequency
response with a delay in it finds that zero, and with it a step response that starts the wrong way, which
the valve does not do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hil.errors import InputError
from hil.identification.frequency.criteria import EFFORT
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.frequency.held_out import held_out
from hil.identification.frequency.transfer_function import TransferFunctionFit, fit_form
from hil.language.note import Note
from hil.physics.transfer_function import TransferFunction
from hil.signals.decibel import decibels


@dataclass(frozen=True, slots=True)
class WrongWay:
    """How far and until when a step response goes the wrong way.

    Attributes:
        share: largest excursion against the final value, as a share of it. `time_s`: when.
        back_s: when the response passes zero again.
    """

    share: float
    time_s: float
    back_s: float


def wrong_way(model: TransferFunction) -> WrongWay:
    """The false start of a stable model's step response; nothing at all gives a share of 0."""
    time_s = np.linspace(0.0, _horizon(model), EFFORT.step_samples)
    relative = model.step(time_s) / model.dc_gain
    lowest = int(np.argmin(relative))
    if relative[lowest] >= 0.0:
        return WrongWay(0.0, 0.0, 0.0)
    back = lowest + int(np.argmax(relative[lowest:] > 0.0))
    return WrongWay(-float(relative[lowest]), float(time_s[lowest]), float(time_s[back]))


def with_alternative(fit: TransferFunctionFit, response: FrequencyResponse) -> TransferFunctionFit:
    """The fit, with a note and an alternative if it has zeros in the right half plane."""
    bad = len(fit.model.right_half_plane_zeros)
    if not bad or fit.form.dead_time or not fit.model.is_stable:
        return fit
    form = replace(fit.form, zeros=fit.form.zeros - bad, dead_time=True, minimum_phase=True)
    try:
        other = fit_form(response, form, fit.weights)
    except InputError:  # too few lines for one more unknown: nothing to offer
        return fit
    note = _note(fit, other, response)
    return replace(fit, alternative=other, notes=(*fit.notes, note))


def _note(fit: TransferFunctionFit, other: TransferFunctionFit, response: FrequencyResponse) -> Note:
    zero = fit.model.right_half_plane_zeros[0]
    start = wrong_way(fit.model)
    ratio = other.model.at(response.frequency_hz) / fit.model.at(response.frequency_hz)
    decibel, degrees = np.max(np.abs(decibels(ratio))), np.max(np.abs(np.degrees(np.angle(ratio))))
    apart, when = _steps_apart(fit.model, other.model)
    return Note(
        "zero at {zero!l} rad/s in the right half plane: a step would first go {share:.2g} % the wrong way (at "
        "{time_ms:.0f} ms). Without it, poles {poles}, zeros {zeros} and a dead time of {dead_time_ms:.1f} ms fit "
        "{other_fit:.1f} % against {fit:.1f} %, within {decibel:.2f} dB and {degrees:.1f}°; {preference}. Their steps "
        "differ most {when!l} after the step, by {apart:.1f} % of it: a step response decides",
        zero=_signed(zero), share=100 * start.share, time_ms=1e3 * start.time_s, poles=other.form.poles,
        zeros=other.form.zeros, dead_time_ms=1e3 * other.model.dead_time_s, other_fit=other.fit_percent,
        fit=fit.fit_percent, decibel=decibel, degrees=degrees, preference=_preference(fit, other, response),
        when=_duration(when), apart=100 * apart,
    )  # fmt: skip


def _preference(fit: TransferFunctionFit, other: TransferFunctionFit, response: FrequencyResponse) -> Note:
    errors = [held_out(response, f) for f in (fit, other)]
    if not all(e.size and np.isfinite(e).all() for e in errors):
        return Note("too few lines to hold some out")
    with_zero, with_delay = (float(np.mean(e)) for e in errors)
    ratio = math.sqrt(with_delay / with_zero) if with_zero else math.inf
    if 0.9 < ratio < 1.1:
        return Note("held-out lines prefer neither")
    better = Note("the zero") if ratio > 1.0 else Note("the dead time")
    times = max(ratio, 1.0 / ratio)
    return Note("held-out lines prefer {better} (rms error {times:.2g} times smaller)", better=better, times=times)


def _steps_apart(a: TransferFunction, b: TransferFunction) -> tuple[float, float]:
    """Largest difference of two unit steps, as a share of the final value, and when."""
    time_s = np.linspace(0.0, max(_horizon(a), _horizon(b)), EFFORT.step_samples)
    difference = np.abs(a.step(time_s) - b.step(time_s)) / abs(a.dc_gain)
    worst = int(np.argmax(difference))
    return float(difference[worst]), float(time_s[worst])


def _horizon(model: TransferFunction) -> float:
    """Time by which a stable model has settled."""
    return model.dead_time_s + 8.0 / float(np.min(np.abs(model.poles.real)))


def _signed(root: complex) -> str:
    return f"{root.real:+.3g}" if abs(root.imag) < 1e-9 else f"{root.real:+.3g} ± {abs(root.imag):.3g}j"


def _duration(duration_s: float) -> str:
    return f"{1e3 * duration_s:.0f} ms" if duration_s < 1.0 else f"{duration_s:.3g} s"
