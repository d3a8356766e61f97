"""A standing wave against the line that it stands for."""

from __future__ import annotations

import numpy as np
import pytest

from hil.physics.effects.standing_wave import EFFECT
from hil.record.recording import Array

PERIOD_S, STEP_S = 0.16, 0.001


def passed(values: Array, reflection: float) -> Array:
    state = np.zeros(EFFECT.memory({}, STEP_S))
    assert EFFECT.settle is not None
    EFFECT.settle(values[0], state, STEP_S, reflection, PERIOD_S)
    return np.array([EFFECT.transform(value, state, reflection, PERIOD_S) for value in values])


def gain(frequency_hz: float, reflection: float) -> complex:
    time_s = np.arange(8000) * STEP_S
    out = passed(np.sin(2.0 * np.pi * frequency_hz * time_s), reflection)
    last = time_s >= 4.0  # whole periods of every frequency asked for
    return complex(2.0 * np.mean(out[last] * 1j * np.exp(-2j * np.pi * frequency_hz * time_s[last])))


@pytest.mark.parametrize("reflection", [0.2, 0.6])
@pytest.mark.parametrize("frequency_hz", [0.5, 3.0, 1.0 / PERIOD_S])
def test_it_passes_what_a_line_with_a_reflecting_end_passes(frequency_hz: float, reflection: float) -> None:
    """Up to the first resonance, where losses that grow with frequency do not tell: (1 + r)/(1 + r·exp(−2jωT))."""
    there_and_back = np.exp(-2j * np.pi * frequency_hz * PERIOD_S / 2.0)
    line = (1.0 + reflection) / (1.0 + reflection * there_and_back)
    assert abs(gain(frequency_hz, reflection) - line) < 0.08 * abs(line)


def test_the_higher_waves_are_odd_multiples_and_gone_sooner() -> None:
    peaks = [abs(gain(order / PERIOD_S, 0.6)) for order in (1.0, 2.0, 3.0, 4.0, 5.0)]
    assert peaks[0] > peaks[2] > peaks[4] > 1.5 > max(peaks[1], peaks[3])


def test_it_rests_at_its_first_value_and_nothing_comes_back_from_an_open_end() -> None:
    assert passed(np.full(500, 7.0), 0.6) == pytest.approx(np.full(500, 7.0), abs=1e-9)
    values = np.random.default_rng(1).standard_normal(200)
    assert passed(values, 0.0) == pytest.approx(values)
