"""Rates and ranges that every backend checks before the first sample."""

import numpy as np
import pytest

from hil.daq.check import check_waveform, checked_task, coerced_rate
from hil.daq.contract import Promises, Waveform
from hil.errors import RangeError
from tests.channels import outputs

PROMISES = Promises("hardware", True, 0.0, 0.0, True, 1.0, 20_000.0, clock_hz=100_000.0)
OUTPUTS = outputs({"command": "ao0"})


@pytest.mark.parametrize(("asked", "actual"), [(1000.0, 1000.0), (3000.0, 100_000 / 33), (19_999.0, 20_000.0)])
def test_rate_is_the_nearest_whole_division_of_the_clock(asked, actual):
    assert coerced_rate(PROMISES, asked) == pytest.approx(actual)


@pytest.mark.parametrize("asked", [0.5, 20_001.0, 0.0, -1.0, np.nan, np.inf])
def test_rate_that_the_device_does_not_have_is_refused(asked):
    with pytest.raises(RangeError, match="Hz"):
        coerced_rate(PROMISES, asked)


@pytest.mark.parametrize(
    ("rate_hz", "name", "values", "says"),
    [
        (1000.0, "command", [0.0, 10.0, 10.1], r"'command', sample 2: 10.1 V is outside the device's -10 … 10 V"),
        (1000.0, "command", [0.0, np.nan], "sample 1: nan"),
        (3000.0, "command", [0.0], "actual rate"),
        (1000.0, "valve", [0.0], "no output 'valve'; the device drives: command"),
    ],
    ids=["range", "nan", "rate", "name"],
)
def test_waveform_that_cannot_be_is_refused(rate_hz, name, values, says):
    with pytest.raises(RangeError, match=says):
        check_waveform(Waveform(rate_hz, {name: np.array(values)}), OUTPUTS, PROMISES)


@pytest.mark.parametrize("outputs", [{}, {"a": np.zeros(0)}, {"a": np.zeros(2), "b": np.zeros(3)}])
def test_waveform_has_samples_of_one_length(outputs):
    with pytest.raises(RangeError, match="same number of samples"):
        Waveform(1000.0, outputs)


@pytest.mark.parametrize(
    ("rate_hz", "name", "says"),
    [(500.0, "command", "then came 500 Hz and command"), (1000.0, "other", "then came 1000 Hz and other")],
)
def test_one_task_keeps_its_rate_and_outputs(rate_hz, name, says):
    task = checked_task(
        [Waveform(1000.0, {"command": np.zeros(3)}), Waveform(rate_hz, {name: np.zeros(3)})],
        outputs({"command": "ao0", "other": "ao1"}),
        PROMISES,
    )
    next(task)
    with pytest.raises(RangeError, match=f"began with 1000 Hz and command, {says}"):
        next(task)


def test_sampling_says_when_each_input_was_read():
    promises = Promises("hardware", False, 10e-6, 0.5, True, 1.0, 20_000.0)
    sampling = promises.sampling(["flow", "pressure"], 1000.0)
    assert sampling["delay_s"] == {"flow": pytest.approx(0.5e-3), "pressure": pytest.approx(0.51e-3)}
    assert sampling["read_at"] == 0.5
