"""A sine fit whose noise is free of the response's own harmonics, however many there are.

What a dead band or friction adds to a slow sine reaches far beyond the fifth harmonic and repeats in every period: left
in the residual it would count as noise, and as noise of the worst colour.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.arrays import Array
from hil.signals.information_criterion import bic
from hil.signals.sine_fit import SineFit, sine_fit

_MOST = 80
_FASTEST = 0.2  # of the sample rate: beyond it no valve answers


def sine_fit_beyond(
    time_s: Array, values: Array, frequency_hz: float, *, harmonics: int = 5, drift_order: int = 0
) -> SineFit:
    """As `sine_fit`, with more harmonics beside those asked for as long as the samples pay for them (BIC).

    Raises:
        SettingError: as `sine_fit`.
    """
    n = len(values)
    rate_hz = (n - 1) / float(time_s[-1] - time_s[0])
    most = min(_MOST, int(_FASTEST * rate_hz / frequency_hz), n // 8)
    used = harmonics
    found = sine_fit(time_s, values, frequency_hz, harmonics=used, drift_order=drift_order)
    while 2 * used <= most:
        more = sine_fit(time_s, values, frequency_hz, harmonics=2 * used, drift_order=drift_order)
        if bic(more.residual_std**2, n, 4 * used) >= bic(found.residual_std**2, n, 2 * used):
            break
        found, used = more, 2 * used
    return found if used == harmonics else _as_asked(found, harmonics, used)


def _as_asked(fit: SineFit, harmonics: int, used: int) -> SineFit:
    """Without the harmonics that nobody asked for."""
    kept = np.r_[0 : 1 + 2 * harmonics, 1 + 2 * used : len(fit.covariance)]
    return replace(
        fit, phasors=fit.phasors[:harmonics], covariance=fit.covariance[np.ix_(kept, kept)],
        bound=fit.bound[np.ix_(kept, kept)],
    )  # fmt: skip
