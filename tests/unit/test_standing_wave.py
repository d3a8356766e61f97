"""A standing wave against the line that it stands for."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hil.physics.effects.standing_wave import EFFECT
from hil.physics.plant import Hook
from hil.record.recording import Array

pytestmark = pytest.mark.xdist_group("standing wave")  # gains are worked out once

PERIOD_S, STEP_S = 0.16, 0.001
HOOK = Hook(EFFECT.hooks[0], "flow", "l/min", 100.0)
ORDERS = (1.0, 2.0, 3.0, 4.0, 5.0)
FREQUENCIES_HZ = (0.5, 3.0, *(order / PERIOD_S for order in ORDERS))


def passed(values: Array, reflection: float) -> Array:
    state = np.zeros(EFFECT.words_at(HOOK, STEP_S))
    assert EFFECT.settle is not None
    EFFECT.settle(values[0], state, STEP_S, reflection, PERIOD_S)
    return np.array([EFFECT.transform(value, state, reflection, PERIOD_S) for value in values])


@cache
def gains(reflection: float) -> dict[float, complex]:
    """Gain at each of `FREQUENCIES_HZ`, from all at once: the effect is linear, and each has its own line."""
    time_s = np.arange(8000) * STEP_S
    out = passed(np.sum([np.sin(2.0 * np.pi * f * time_s) for f in FREQUENCIES_HZ], axis=0), reflection)
    last = time_s >= 4.0  # whole periods of every frequency asked for
    lines = {f: np.exp(-2j * np.pi * f * time_s[last]) for f in FREQUENCIES_HZ}
    return {f: complex(2.0 * np.mean(out[last] * 1j * line)) for f, line in lines.items()}


@pytest.mark.parametrize("reflection", [0.2, 0.6])
def test_it_passes_what_a_line_with_a_reflecting_end_passes(reflection):
    """Up to the first resonance, where losses that grow with frequency do not tell: (1 + r)/(1 + r·exp(−2jωT))."""
    for frequency_hz in (0.5, 3.0, 1.0 / PERIOD_S):
        there_and_back = np.exp(-2j * np.pi * frequency_hz * PERIOD_S / 2.0)
        line = (1.0 + reflection) / (1.0 + reflection * there_and_back)
        assert abs(gains(reflection)[frequency_hz] - line) < 0.08 * abs(line)


def test_the_higher_waves_are_odd_multiples_and_gone_sooner():
    peaks = [abs(gains(0.6)[order / PERIOD_S]) for order in ORDERS]
    assert peaks[0] > peaks[2] > peaks[4] > 1.5 > max(peaks[1], peaks[3])


def test_it_rests_at_its_first_value_and_nothing_comes_back_from_an_open_end():
    assert passed(np.full(500, 7.0), 0.6) == pytest.approx(np.full(500, 7.0), abs=1e-9)
    values = np.random.default_rng(1).standard_normal(200)
    assert passed(values, 0.0) == pytest.approx(values)
