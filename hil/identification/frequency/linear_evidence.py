"""Is a transfer function borne out by the lines that it was fitted to, or is it only a curve through them?

What a fit says outside the band that was measured is its own invention: a pole far beyond it, or a gain at rest that no
line comes near. A coefficient whose interval is wider than its value was not measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hil.identification.frequency.criteria import CRITERIA
from hil.identification.frequency.transfer_function import TransferFunctionFit
from hil.language.note import Note
from hil.signals.interval import COVERED

LEAST_FIT_PERCENT = 80.0  # below it a response is not called linear, unless its bench says otherwise


def doubts(fit: TransferFunctionFit, least_fit_percent: float = LEAST_FIT_PERCENT) -> tuple[Note, ...]:
    """Why the fit is no linear model of what was measured; empty when the lines bear it out."""
    return (*unresolved(fit), *_poor(fit.fit_percent, least_fit_percent))


def unresolved(fit: TransferFunctionFit) -> tuple[Note, ...]:
    """What the fit states that its lines say nothing of."""
    return (*_poles(fit), *_gain_at_rest(fit), *_coefficients(fit))


def _poor(fit_percent: float, least: float) -> Iterator[Note]:
    if not fit_percent > 0.0:
        yield Note("it fits no better than a constant, where {least:g} % are asked for", least=least)
    elif fit_percent < least:
        yield Note("its fit is {fit:.1f} %, where {least:g} % are asked for", fit=fit_percent, least=least)


def _poles(fit: TransferFunctionFit) -> Iterator[Note]:
    low_hz, high_hz = float(fit.frequency_hz[0]), float(fit.frequency_hz[-1])
    corners_hz = np.abs(fit.model.poles) / (2.0 * math.pi)
    if np.any(corners_hz < low_hz / CRITERIA.beyond):
        yield Note("a pole lies below a tenth of the lowest line, {line_hz:.4g} Hz", line_hz=low_hz)
    if np.any(corners_hz > CRITERIA.beyond * high_hz):
        yield Note(
            "a pole lies beyond {times:g} times the highest line, {line_hz:.4g} Hz",
            times=CRITERIA.beyond,
            line_hz=high_hz,
        )


def _gain_at_rest(fit: TransferFunctionFit) -> Iterator[Note]:
    at_rest = abs(fit.model.dc_gain)
    gains = np.abs(fit.response)
    nearest = float(gains[np.argmin(np.abs(gains - at_rest))])
    if not math.isfinite(at_rest) or not nearest / CRITERIA.near <= at_rest <= nearest * CRITERIA.near:
        yield Note("no line comes near its gain at rest; the nearest has a gain of {nearest:.4g}", nearest=nearest)


def _coefficients(fit: TransferFunctionFit) -> Iterator[Note]:
    stds = fit.scatter
    wide = [
        name
        for name, value, std in zip(fit.coefficient_names, fit.coefficients, stds, strict=True)
        if not COVERED * std < abs(value)
    ]
    if wide:
        names = tuple(Note("dead time") if name == "dead_time_s" else name for name in wide)
        yield Note("the interval of {names} is wider than the value", names=names)
