"""Rates and ranges that every backend checks before the first sample."""

from __future__ import annotations

import numpy as np
import pytest

from hil.daq.channel import OutputChannel
from hil.daq.check import check_waveform, checked_task, coerced_rate
from hil.daq.contract import Promises, Waveform
from hil.errors import RangeError

PROMISES = Promises("hardware", True, 0.0, 0.0, True, 1.0, 20_000.0, clock_hz=100_000.0)
OUTPUTS = {"command": OutputChannel("command", "ao0", "voltage", "V", -10.0, 10.0)}


@pytest.mark.parametrize(("asked", "actual"), [(1000.0, 1000.0), (3000.0, 100_000 / 33), (19_999.0, 20_000.0)])
def test_rate_is_the_nearest_whole_division_of_the_clock(asked: float, actual: float) -> None:
    assert coerced_rate(PROMISES, asked) == pytest.approx(actual)


@pytest.mark.parametrize("asked", [0.5, 20_001.0, 0.0, -1.0, np.nan, np.inf])
def test_rate_that_the_device_does_not_have_is_refused(asked: float) -> None:
    with pytest.raises(RangeError, match="Hz"):
        coerced_rate(PROMISES, asked)


def test_sample_beyond_the_range_is_named() -> None:
    waveform = Waveform(1000.0, {"command": np.array([0.0, 10.0, 10.1])})
    with pytest.raises(RangeError, match=r"'command', sample 2: 10.1 V is outside the device's -10 … 10 V"):
        check_waveform(waveform, OUTPUTS, PROMISES)


def test_nan_is_outside_every_range() -> None:
    with pytest.raises(RangeError, match="sample 1: nan"):
        check_waveform(Waveform(1000.0, {"command": np.array([0.0, np.nan])}), OUTPUTS, PROMISES)


def test_rate_that_was_not_coerced_is_refused() -> None:
    with pytest.raises(RangeError, match="actual rate"):
        check_waveform(Waveform(3000.0, {"command": np.zeros(3)}), OUTPUTS, PROMISES)


def test_unknown_output_lists_those_there_are() -> None:
    with pytest.raises(RangeError, match="no output 'valve'; the device drives: command"):
        check_waveform(Waveform(1000.0, {"valve": np.zeros(3)}), OUTPUTS, PROMISES)


@pytest.mark.parametrize("outputs", [{}, {"a": np.zeros(0)}, {"a": np.zeros(2), "b": np.zeros(3)}])
def test_waveform_has_samples_of_one_length(outputs: dict[str, np.ndarray]) -> None:
    with pytest.raises(RangeError, match="same number of samples"):
        Waveform(1000.0, outputs)


def test_one_task_keeps_its_rate() -> None:
    waveforms = [Waveform(1000.0, {"command": np.zeros(3)}), Waveform(500.0, {"command": np.zeros(3)})]
    task = checked_task(waveforms, OUTPUTS, PROMISES)
    next(task)
    with pytest.raises(RangeError, match="began with 1000 Hz"):
        next(task)


def test_one_task_keeps_its_outputs() -> None:
    outputs = {**OUTPUTS, "other": OutputChannel("other", "ao1", "voltage", "V", -10.0, 10.0)}
    waveforms = [Waveform(1000.0, {"command": np.zeros(3)}), Waveform(1000.0, {"other": np.zeros(3)})]
    task = checked_task(waveforms, outputs, PROMISES)
    next(task)
    with pytest.raises(RangeError, match="began with 1000 Hz and command, then came 1000 Hz and other"):
        next(task)


def test_sampling_says_when_each_input_was_read() -> None:
    promises = Promises("hardware", False, 10e-6, 0.5, True, 1.0, 20_000.0)
    sampling = promises.sampling(["flow", "pressure"], 1000.0)
    assert sampling["delay_s"] == {"flow": pytest.approx(0.5e-3), "pressure": pytest.approx(0.51e-3)}
    assert sampling["read_at"] == 0.5
