"""The rig of a bench: engineering units, the run folder, parts, limits."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.bench.recorder import Recorder
from hil.bench.rig import BenchRig
from hil.daq.contract import Block
from hil.errors import FileError, RangeError, TrippedError
from hil.identification.preparation.experiment import declared_read_at
from hil.physics.model import Value, save_model, typical_model
from hil.record.folder import RunWriter
from hil.record.read import read_recording
from hil.rig import Rig
from tests.bench_files import bench_file
from tests.driven import silent_rig

QUICK = {"protection": {"block_s": 0.1}}


@contextmanager
def rig_of(tmp_path: Path, run: str = "run", **tables: Any) -> Iterator[BenchRig]:
    path = bench_file(tmp_path / f"{run}.toml", "brevini-hpv41", **tables)
    with silent_rig(path, tmp_path / run, {"procedure": "test"}) as rig:
        yield rig


def test_what_is_played_comes_back_in_engineering_units_and_is_on_disk(tmp_path):
    with rig_of(tmp_path) as rig:
        assert isinstance(rig.rate_hz, float)
        rig.ramp_to(50.0)
        part = {"kind": "sine", "frequency_hz": 2.0, "bias": 50.0}
        command = 50.0 + 10.0 * np.sin(2 * np.pi * 2.0 * np.arange(1500) / 1000.0)
        played = rig.play(command, part=part)
        stored = read_recording(tmp_path / "run")  # while the run goes on
    assert played.values("command") == pytest.approx(command)
    assert played.channel("flow").unit == "l/min"
    assert played.channel("flow").calibration["slope"] == 10.0
    assert np.array_equal(stored.values("flow")[-1500:], played.values("flow"))
    assert stored.time_s[-1] == played.time_s[-1]
    found = stored.meta["parts"][-1]
    assert {key: found[key] for key in part} == part
    assert (found["first"], found["count"]) == (len(stored) - 1500, 1500)
    own = played.meta["parts"][0]
    assert (own["first"], own["count"], own["kind"]) == (0, 1500, "sine")
    assert declared_read_at(played) == declared_read_at(stored) == 0.0


def test_run_folder_says_what_was_promised_and_how_it_ended(tmp_path):
    with rig_of(tmp_path) as rig:
        rig.hold(0.2)
        rig.note("thought", depth=3)
    run = read_recording(tmp_path / "run")
    assert run.meta["outcome"] == "completed"
    assert run.meta["procedure"] == "test"
    assert run.meta["valve"]["plant"] == "brevini-hpv41"
    assert run.meta["bench_file"] == (tmp_path / "run.toml").read_text(encoding="utf-8")
    assert run.meta["sampling"]["timing"] == "virtual"
    assert run.meta["sampling"]["delay_s"]["supply pressure"] == pytest.approx(28e-6)
    slope = float(run.channel("flow").calibration["slope"])
    assert run.meta["read"]["flow"] == {"step": pytest.approx(slope * 20.0 / 2**16)}
    (event,) = [event for event in run.meta["events"] if event["event"] == "thought"]
    assert event["details"] == {"depth": 3}
    assert run.channel("flow").source == "dynamic flow meter, ±100 l/min"


def test_time_goes_on_from_part_to_part(tmp_path):
    with rig_of(tmp_path) as rig:
        first, second = rig.hold(0.5), rig.hold(0.5)
        slow = rig.play(np.zeros(5), 100.0)
    assert second.time_s[0] == pytest.approx(first.time_s[-1] + 0.001)
    assert np.diff(slow.time_s) == pytest.approx(0.01)
    assert read_recording(tmp_path / "run").time_s[0] == 0.0


def test_time_of_the_run_begins_with_its_first_sample(tmp_path):
    """Whatever the clock of the device shows by then."""
    path = tmp_path / "run"
    with RunWriter.create(path, {}, [("a", "V"), ("b", "V")]) as writer:
        recorder = Recorder(writer, {})
        for start_s in (7.25, 7.5):
            recorder.keep(Block(start_s + np.array([0.0, 0.125]), {"a": np.zeros(2)}, {"b": np.zeros(2)}, late=1))
    run = read_recording(path)
    assert run.time_s.tolist() == [0.0, 0.125, 0.25, 0.375]
    assert [event["details"] for event in run.meta["events"]] == [{"count": 1}, {"count": 1}]


def test_ramp_takes_its_time_and_the_valve_settles(tmp_path):
    with rig_of(tmp_path) as rig:
        ramp = rig.ramp_to(60.0)
        assert ramp.duration_s == pytest.approx(60.0 / 200.0 + rig.settling_s, abs=0.002)
        assert abs(np.diff(ramp.values("command"))).max() <= 0.2 + 1e-9
        assert ramp.values("flow")[-200:].mean() == pytest.approx(70.0 * 0.5**1.2, abs=0.1)


def test_stream_brings_a_recording_for_each_array_in_one_part(tmp_path):
    with rig_of(tmp_path) as rig:
        pieces = list(rig.stream((np.full(50, level) for level in (1.0, 2.0, 3.0)), part={"kind": "steps"}))
    assert [piece.values("command")[0] for piece in pieces] == pytest.approx([1.0, 2.0, 3.0])
    (part,) = read_recording(tmp_path / "run").meta["parts"]
    assert (part["kind"], part["count"]) == ("steps", 150)


def test_long_pieces_of_a_stream_are_judged_as_often_as_all_others(tmp_path):
    low = {"over-pressure": {"for_s": 0.5, "minus": "command"}}
    seen = []
    with pytest.raises(TrippedError, match="over-pressure"), rig_of(tmp_path, **QUICK, interlocks=low) as rig:
        seen.extend(rig.stream(np.full(3000, -50.0 * i) for i in (0, 1, 2)))
    assert [len(piece) for piece in seen] == [3000]
    run = read_recording(tmp_path / "run")
    driven_until_s = run.time_s[np.flatnonzero(run.values("command"))[-1]]
    assert driven_until_s < 0.1 + 3.0 + 0.5 + 0.2


def test_roles_have_the_limits_in_force(tmp_path):
    with rig_of(tmp_path) as rig:
        assert (rig.command.name, rig.command.unit, rig.command.low, rig.command.high) == ("command", "%", -100, 100)
        assert (rig.response.name, rig.response.unit, rig.response.high) == ("flow", "l/min", 100.0)
        rig.tighten(-30.0, 30.0, slew_per_s=500.0)
        assert (rig.command.low, rig.command.high, rig.command.slew_per_s) == (-30.0, 30.0, 500.0)
        with pytest.raises(RangeError, match="31 % is outside -30 … 30"):
            rig.check(np.full(10, 31.0))


def test_valve_tightens_the_limits_of_the_bench(tmp_path):
    limits = {"low": -60.0, "high": 150.0, "slew_per_s": 400.0}
    with rig_of(tmp_path, valve={"limits": limits}) as rig:
        assert (rig.command.low, rig.command.high, rig.command.slew_per_s) == (-60.0, 100.0, 400.0)
        with pytest.raises(RangeError, match="is 40000 %/s; allowed 400 %/s"):
            rig.check(np.full(10, 40.0))


def door(closed: float) -> dict[str, Any]:
    """An enable line, and a door that reads so."""
    line = {"device": "daq", "unit": "1"}
    channels = {"enable": {**line, "terminal": "do0", "safe": 0, "on": 1}, "door": {**line, "terminal": "di0"}}
    instruments = {"enable": {"signal": ""}, "door": {"value": closed}}
    locks = {"door-open": {"channel": "door", "low": 0.5, "action": "trip"}}
    return {"channels": channels, "interlocks": locks, "simulation": {"instruments": instruments}}


def test_enable_line_is_on_while_the_bench_is_open(tmp_path):
    with rig_of(tmp_path, **door(1.0)) as rig:
        played = rig.play(np.full(100, 30.0))
    assert (played.values("enable") == 1.0).all() and (played.values("door") == 1.0).all()
    run = read_recording(tmp_path / "run")
    assert (run.values("enable")[:100] == 0.0).all()
    assert run.values("enable")[-1] == 0.0


def test_enable_line_stays_off_while_a_door_is_open(tmp_path):
    with pytest.raises(TrippedError, match="door-open"), rig_of(tmp_path, **door(0.0)):
        pytest.fail("the bench was opened")
    assert (read_recording(tmp_path / "run").values("enable") == 0.0).all()


def test_identified_transfer_function_stands_in_for_the_valve(tmp_path):
    """Its signals have the names and units of the channels that it was identified from."""
    model = typical_model("transfer-function")
    values = {"gain": Value(0.001, "[m^3/s]/[%]"), "lag_time": Value(0.1, "s")}
    path = tmp_path / "valve.json"
    save_model(replace(model, parameters=values, input="command [%]", output="flow [m^3/s]"), path)
    plain = {"instruments": {"spool position": {"value": 0.0}, "supply pressure": {"value": 100.0}}}
    flow = {"calibration": {"slope": 1e5}}
    with rig_of(tmp_path, valve={"plant": "valve.json"}, simulation=plain, channels={"flow": flow}) as rig:
        rig.ramp_to(10.0)
        assert rig.hold(1.0).values("flow", "m^3/s").mean() == pytest.approx(0.01, rel=0.01)  # 16 bits of a wide range


def test_rate_is_coerced_to_what_the_device_has(tmp_path):
    with rig_of(tmp_path) as rig:
        assert rig.actual_rate_hz(300.0) == pytest.approx(1000.0 / 3.0)
        assert rig.play(np.zeros(10), 300.0).meta["sampling"]["rate_hz"] == pytest.approx(1000.0 / 3.0)
        with pytest.raises(RangeError, match="the device offers"):
            rig.play(np.zeros(10), 5000.0)


def test_rate_that_the_device_makes_differently_is_noted_once(tmp_path):
    with rig_of(tmp_path) as rig:
        rig.hold(0.1, 300.0)
        rig.hold(0.1, 300.0)
        rig.hold(0.1)
    noted = [event["details"] for event in read_recording(tmp_path / "run").meta["events"]
             if event["event"] == "the device makes another sample rate"]  # fmt: skip
    assert noted == [{"asked_hz": 300.0, "made_hz": pytest.approx(1000.0 / 3.0)}]


def test_reading_at_the_end_of_its_range_is_noted(tmp_path):
    with rig_of(tmp_path, channels={"spool position": {"range": [-2.0, 2.0]}}) as rig:
        rig.ramp_to(50.0)
    events = read_recording(tmp_path / "run").meta["events"]
    assert events[0]["event"] == "reading at the end of its range"
    assert events[0]["details"]["channel"] == "spool position"


def test_run_that_lacks_a_channel_is_not_resumed(tmp_path):
    with rig_of(tmp_path) as rig:
        rig.hold(0.1)
    earlier = read_recording(tmp_path / "run")
    older = replace(earlier, channels={"flow": earlier.channels["flow"]})
    with (
        pytest.raises(FileError, match="no channel 'command'; an earlier version of this program recorded it"),
        silent_rig(tmp_path / "run.toml", tmp_path / "again", earlier=older),
    ):
        pytest.fail("it was opened")


def test_rig_is_what_procedures_were_promised(tmp_path):
    promised = {name for name in vars(Rig) if not name.startswith("_")}
    with rig_of(tmp_path) as rig:
        offered = rig
        assert promised <= {name for name in dir(offered) if not name.startswith("_")}
        assert rig.conditions["conditions"]["fluid"] == "mineral oil"
        assert rig.promises["delay_s"]["flow"] == 0.0
