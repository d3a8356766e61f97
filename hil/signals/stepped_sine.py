"""The stepped sine: one frequency after another, each held until steady, then measured over whole periods."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil.arrays import Array
from hil.errors import SettingError

# Twenty samples per period keep the steps of a held output 26 dB below the sine and harmonic 5 well inside.
SAMPLES_PER_PERIOD = 20
_LEAST_REFERENCE_HZ, _REFERENCE_RATIO = 0.1, 49.0  # of the HPV41 paper: 0.1 … 4.9 Hz


def sine(
    frequency_hz: float, amplitude: float, rate_hz: float, periods: float, *, bias: float = 0.0, phase_rad: float = 0.0
) -> Array:
    """Samples of bias + amplitude·sin(2πf·t + phase) nearest to that many periods, from t = 0.

    Whole periods need not be whole samples: the fit knows the frequency, and blocks that follow one another
    join with a phase step below half a sample.
    """
    time_s = np.arange(max(1, round(periods * rate_hz / frequency_hz))) / rate_hz
    return bias + amplitude * np.sin(2.0 * math.pi * frequency_hz * time_s + phase_rad)


def check_frequencies(frequencies_hz: Sequence[float], rate_hz: float) -> None:
    """Raise `SettingError` unless frequencies are above 0, rising, and the rate is 20 times the top one."""
    if not len(frequencies_hz):
        raise SettingError("frequencies: none given; at least one is needed")
    before = 0.0
    for f in frequencies_hz:
        if not f > before:
            reason = "must be above 0" if not f > 0.0 else f"must come before {before:g} Hz; sort them"
            raise SettingError(f"frequencies: {f:g} Hz {reason}")
        before = f
    if rate_hz < SAMPLES_PER_PERIOD * before:
        raise SettingError(
            f"sample rate {rate_hz:g} Hz is below {SAMPLES_PER_PERIOD} × the top frequency {before:g} Hz; "
            f"at least {SAMPLES_PER_PERIOD * before:g} Hz is needed"
        )


def reference_and_band(top_hz: float) -> tuple[float, ...]:
    """A reference far below, and six frequencies in equal ratios over 2.75 octaves up to the top one, for bandwidths.

    The reference is a 49th of the top one, at least 0.1 Hz, and at half the lowest of the others at most. A curve over
    a wider gap scatters so much in it that a bandwidth could lie there.
    """
    band = [float(f"{hz:.3g}") for hz in np.geomspace(top_hz / 2.0**2.75, top_hz, 6)[:-1]]
    reference_hz = float(f"{max(_LEAST_REFERENCE_HZ, top_hz / _REFERENCE_RATIO):.3g}")
    return (min(reference_hz, band[0] / 2.0), *band, top_hz)
