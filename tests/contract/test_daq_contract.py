"""What every backend keeps, whatever is behind it: run on every bench that installed packages bring along."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.daq.contract import Daq, Waveform, joined
from hil.errors import RangeError
from tests.driven import played

TIMED_BY_THEMSELVES = sorted(n for n, path in benches().items() if "in_process" in path.read_text(encoding="utf-8"))


@pytest.fixture(params=TIMED_BY_THEMSELVES)
def file(request):
    return read_bench(benches()[request.param])


@pytest.fixture
def daq(file):
    return file.open()


def rate_hz(daq: Daq) -> float:
    return daq.actual_rate_hz(min(500.0, daq.promises.highest_rate_hz))


def sweep(daq: Daq, samples: int = 300) -> Waveform:
    """Every output from a tenth to a quarter of its range."""
    share = np.linspace(0.1, 0.25, samples)
    return Waveform(rate_hz(daq), {name: c.low + share * (c.high - c.low) for name, c in daq.outputs.items()})


def test_channels_are_those_of_the_bench(daq, file):
    assert {*daq.outputs, *daq.inputs} == set(file.bench.channels)


def test_actual_rate_is_a_fixed_point(daq):
    actual = daq.actual_rate_hz(0.371 * daq.promises.highest_rate_hz)
    assert daq.actual_rate_hz(actual) == actual


@pytest.mark.parametrize("share", [1.5, 1e-9, -1.0])
def test_rate_that_it_does_not_have_is_refused(daq, share):
    with pytest.raises(RangeError, match="Hz"):
        daq.actual_rate_hz(share * daq.promises.highest_rate_hz)


def test_one_reading_of_every_input_for_each_sample(daq):
    waveform = sweep(daq)
    blocks = list(daq.play(waveform, 70))
    assert [len(block) for block in blocks] == [70, 70, 70, 70, 20]
    block = joined(blocks)
    for name, values in waveform.outputs.items():
        assert np.array_equal(block.outputs[name], values)
    for name, channel in daq.inputs.items():
        values = block.inputs[name]
        assert values.shape == block.time_s.shape
        over = channel.over * (channel.high - channel.low)
        assert np.isfinite(values).all() and values.min() >= channel.low - over and values.max() <= channel.high + over


def test_time_goes_on_from_task_to_task_at_the_actual_rate(daq):
    tasks = [played(daq, sweep(daq)), joined(list(daq.stream([sweep(daq)])))]
    for task in tasks:
        assert np.diff(task.time_s) == pytest.approx(1.0 / rate_hz(daq))
    assert tasks[1].time_s[0] > tasks[0].time_s[-1]


def test_finite_and_continuous_acquisition_say_the_same(file):
    def run(finite):
        daq = file.open()
        waveform = sweep(daq)
        return joined(list(daq.play(waveform) if finite else daq.stream(waveform.slices(70))))

    finite, continuous = run(True), run(False)
    for name in finite.inputs:
        assert np.array_equal(finite.inputs[name], continuous.inputs[name])


def test_last_value_is_held_and_told(daq):
    waveform = sweep(daq)
    played(daq, waveform)
    for name, values in waveform.outputs.items():
        assert daq.levels[name] == values[-1]


def test_output_that_is_not_named_keeps_its_level(daq):
    played(daq, sweep(daq))
    name = next(iter(daq.outputs))
    before = {other: level for other, level in daq.levels.items() if other != name}
    block = played(daq, Waveform(rate_hz(daq), {name: np.full(5, daq.outputs[name].safe)}))
    assert all((block.outputs[other] == level).all() for other, level in before.items())


def test_sample_beyond_the_range_is_refused_before_the_first(daq):
    name, channel = next(iter(daq.outputs.items()))
    before = daq.levels[name]
    beyond = np.append(np.full(10, channel.high), channel.high + 0.01 * (channel.high - channel.low))
    with pytest.raises(RangeError, match=f"'{name}', sample 10"):
        played(daq, Waveform(rate_hz(daq), {name: beyond}))
    assert daq.levels[name] == before


def test_safe_at_once_in_the_middle_of_a_task_and_again(daq):
    blocks = daq.play(sweep(daq), 10)
    next(blocks)
    for _ in range(2):
        daq.make_safe()
        assert daq.levels == {name: channel.safe for name, channel in daq.outputs.items()}


def test_closing_makes_safe_and_may_be_repeated(daq):
    played(daq, sweep(daq))
    daq.close()
    daq.close()
    assert daq.levels == {name: channel.safe for name, channel in daq.outputs.items()}


def test_first_input_is_read_when_the_promises_say(daq):
    """A step in the command is first seen after the update, so never in a reading that comes with it."""
    assert 0.0 <= daq.promises.read_at <= 1.0
    name, channel = next(iter(daq.outputs.items()))
    first = next(iter(daq.inputs))
    quiet = played(daq, Waveform(rate_hz(daq), {name: np.full(500, channel.safe)})).inputs[first]
    moved = played(daq, Waveform(rate_hz(daq), {name: np.full(2, channel.high)})).inputs[first]
    assert abs(moved[0] - quiet.mean()) <= 6.0 * quiet.std() + 1e-3


def test_benches_are_found_by_bare_name(file):
    assert isinstance(file.path, Path) and file.path.parent.name == "benches"
