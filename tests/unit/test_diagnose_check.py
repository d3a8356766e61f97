"""Recordings that cannot be what their headings say are refused, or warned of, before any physics is blamed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hil.diagnose.check import check
from hil.errors import FileError
from hil.identify.experiment import for_model
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Recording, recording
from tests.concealed import DURATION_S, NOISE, PLANT, RATE_HZ, bound, noise, nominal, records


def changed(change: Callable[[Recording], None]) -> list[Recording]:
    made = records(seed=20)
    for each in made:
        change(each)
    return made


def cut(made: list[Recording], samples: int) -> list[Recording]:
    return [
        replace(
            each,
            time_s=each.time_s[:samples],
            channels={name: replace(c, values=c.values[:samples]) for name, c in each.channels.items()},
        )
        for each in made
    ]


@pytest.mark.parametrize("factor", [10.0, 0.1, 60.0, 1.0 / 60.0])
def test_an_output_in_a_wrong_unit_is_refused_with_its_factor(factor: float) -> None:
    def scale(each: Recording) -> None:
        each.channels["flow"].values[:] *= factor

    with pytest.raises(FileError, match=rf"'flow \[l/min\]'.*factor near {factor:.4g}"):
        check(nominal(), bound(nominal(), changed(scale)))


@pytest.mark.parametrize("factor", [10.0, 0.1, 60.0])
def test_a_wrong_unit_is_refused_though_a_sticking_part_moves_less(factor: float) -> None:
    sticking = ActiveEffect("friction", "force", {"coulomb": 2.5, "stiction": 1.2, "stribeck": 5.0, "presliding": 0.05})
    valve, time_s = plant(PLANT), np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    command = -50.0 + 10.0 * np.sin(2.0 * np.pi * 0.3 * time_s)
    flow = simulate(valve, valve.typical, Drive(command[None, :], 0.0, 1.0 / RATE_HZ, 0.0), (sticking,))[0]
    flow += NOISE * noise(np.random.default_rng(22), len(flow))
    made = recording("small sine", time_s, {"command [%]": command, "flow [l/min]": factor * flow})
    with pytest.raises(FileError, match=rf"'flow \[l/min\]'.*factor near {factor:.4g}"):
        check(nominal(), bound(nominal(), [made]))


@pytest.mark.parametrize("factor", [60.0, 10.0, 0.1, 1.0 / 60.0])
def test_a_wrong_unit_is_refused_though_the_supply_gives_way(factor: float) -> None:
    shape = {"droop": 0.5, "recovery": 0.3, "power": 1.0, "line": 0.0, "lean": 0.0}
    (made, *_) = records((ActiveEffect("supply_droop", "supply", shape),), seed=23)
    made.channels["flow"].values[:] *= factor
    with pytest.raises(FileError, match=r"'flow \[l/min\]'.*wrong unit"):
        check(nominal(), bound(nominal(), [made]))


@pytest.mark.parametrize("factor", [1000.0, 60.0, 10.0, 0.1])
def test_a_loop_whose_output_has_a_wrong_unit_is_refused(factor: float) -> None:
    loop, time_s = typical_model("hydraforce-sp08-47c"), np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    request = 125.0 + 40.0 * np.sin(2.0 * np.pi * 0.3 * time_s)
    drive = Drive(request[None, :], 125.0, 1.0 / RATE_HZ, 0.0)
    position = simulate(loop.definition, loop.values, drive) + 0.05 * noise(np.random.default_rng(24), len(time_s))
    made = recording("loop", time_s, {"request [mm]": request, "position [mm]": factor * position[0]})
    with pytest.raises(FileError, match=r"'position \[mm\]'.*wrong unit"):
        check(loop, [for_model(loop, made)])


def test_an_offset_many_times_what_moves_is_no_unit() -> None:
    def offset(each: Recording) -> None:
        each.channels["flow"].values[:] += 130.0

    check(nominal(), bound(nominal(), changed(offset)))


def test_a_command_in_a_wrong_unit_is_refused() -> None:
    def scale(each: Recording) -> None:
        each.channels["command"].values[:] /= 10.0

    with pytest.raises(FileError, match=r"'command \[%\]'.*multiplied by 10"):
        check(nominal(), bound(nominal(), changed(scale)))


def test_swapped_columns_are_refused() -> None:
    def swap(each: Recording) -> None:
        command, flow = each.channels["command"].values, each.channels["flow"].values
        kept = command.copy()
        command[:], flow[:] = flow, kept

    with pytest.raises(FileError, match="look swapped"):
        check(nominal(), bound(nominal(), changed(swap)))


def test_a_recording_shorter_than_a_time_constant_is_refused() -> None:
    with pytest.raises(FileError, match="at least one time constant"):
        check(nominal(), bound(nominal(), cut(records(seed=21), 20)))


def test_a_constant_command_is_refused() -> None:
    def stand_still(each: Recording) -> None:
        each.channels["command"].values[:] = 50.0

    with pytest.raises(FileError, match="never changes"):
        check(nominal(), bound(nominal(), changed(stand_still)))


def test_a_clipped_channel_is_left_out_and_said() -> None:
    def clip(each: Recording) -> None:
        flow = each.channels["flow"].values
        flow[:] = np.clip(flow, -20.0, 20.0)

    checked = check(nominal(), bound(nominal(), changed(clip)))
    assert any("clipped at" in text for text in checked.warnings)
    assert all(e.ignored is not None and e.ignored.any() for e in checked.experiments)


def test_a_gap_in_the_samples_is_said() -> None:
    made = [
        replace(
            each,
            time_s=np.delete(each.time_s, slice(800, 1200)),
            channels={n: replace(c, values=np.delete(c.values, slice(800, 1200))) for n, c in each.channels.items()},
        )
        for each in records(seed=22)
    ]
    checked = check(nominal(), bound(nominal(), made))
    assert any("gap in the samples, the longest 1.6 s" in text for text in checked.warnings)


def test_good_recordings_pass_without_a_word() -> None:
    assert check(nominal(), bound(nominal(), records(seed=23))).warnings == ()
