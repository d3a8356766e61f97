"""A reading is a measurement or none: what happens from the converter to the page when it is none."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from hil.bench.read import read_bench
from hil.daq.channel import InputChannel
from hil.daq.contract import Block
from hil.daq.scaled import measured
from hil.errors import FileError, LinkError
from hil.record.invalid_samples import measured_rows, supposed, with_blanks
from hil.record.measurement import Findings, Measurement
from hil.record.read import read_recording
from hil.record.recording import Channel, Recording
from hil.safety.guard import Guard
from hil.safety.interlock import Band, Interlock, Watch
from hil.safety.protection import Protection
from hil.session.procedure import load_procedure
from hil.session.run import evaluate_run, run_procedure
from hil.session.sample_sensitivity import measured_findings
from tests.bench_files import bench_file
from tests.concealed import bound, nominal, records
from tests.wire import Wire

pytestmark = pytest.mark.usefixtures("unprinted")
NONE = (np.nan, np.inf, -np.inf)
VALUE, BOUND = Measurement("top", "V", "largest"), Measurement("beyond", "V", "a bound")


def channel(low: float, high: float, over: float = 0.0) -> InputChannel:
    return InputChannel("a", "a", "voltage", "V", low, high, over)


def block(pressure: list[float], command: list[float] | None = None, start: int = 0) -> Block:
    time_s = 0.1 * np.arange(start, start + len(pressure))
    return Block(time_s, {"pressure": np.array(pressure)}, {"command": np.array(command or [0.0] * len(pressure))})


@pytest.mark.parametrize(
    ("reading", "of", "becomes"),
    [
        (9.99, channel(-10.0, 10.0), 9.99),
        (10.0, channel(-10.0, 10.0), np.inf),
        (-10.0003, channel(-10.0, 10.0), -np.inf),
        (10.2, channel(-10.0, 10.0, over=0.024), 10.2),
        (10.48, channel(-10.0, 10.0, over=0.024), np.inf),
        (0.0, channel(0.0, 10.0), 0.0),
        (-0.004, channel(0.0, 10.0), -0.004),
        (-np.inf, channel(0.0, 10.0), -np.inf),
        (10.0, channel(0.0, 10.0), np.inf),
    ],
)
def test_a_reading_at_the_end_of_its_range_is_none(reading, of, becomes):
    assert measured(np.array([1.0, reading]), of).tolist() == [1.0, becomes]


def test_a_line_that_is_on_or_off_is_always_read():
    line = replace(channel(0.0, 1.0), kind="digital")
    assert measured(np.array([0.0, 1.0]), line).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("none", NONE)
@pytest.mark.parametrize("band", [Band("pressure", high=1.0), Band("pressure", low=-1.0), Band("pressure", -1.0, 1.0)])
def test_no_measurement_breaks_an_interlock_for_as_long_as_it_lasts(none, band):
    watch = Watch(Interlock("p", "trip", band, for_s=0.25))
    assert watch.judge(block([0.0, none, none, 0.0])) is None
    found = watch.judge(block([none] * 4, start=4))
    assert found.time_s == pytest.approx(0.7)
    assert "no measurement" in found.text


@pytest.mark.parametrize("none", NONE)
def test_a_condition_that_nobody_knows_blinds_no_interlock(none):
    lock = Interlock("leak", "trip", Band("command", -1.0, 1.0), only_while=Band("pressure", -5.0, 5.0))
    assert Watch(lock).judge(block([9.0], [3.0])) is None
    assert Watch(lock).judge(block([none], [3.0])) is not None


def test_two_that_are_not_measured_have_no_difference():
    lock = Interlock("error", "stop", Band("pressure", -1.0, 1.0, minus="command"))
    assert Watch(lock).judge(block([np.inf], [np.inf])) is not None


def test_a_channel_that_never_reads_anything_is_stale_too():
    watch = Watch(Interlock("dead", "stop", Band("pressure"), stale_s=0.3))
    assert watch.judge(block([np.nan, 1.0, 2.0, 3.0])) is None
    found = watch.judge(block([np.nan] * 5, start=4))
    assert found.time_s == pytest.approx(0.7)


class Dead(Wire):
    """A wire of which one input has no measurement."""

    def __init__(self, reading: float, says_why: bool = False) -> None:
        super().__init__()
        self.reading, self.says_why = reading, says_why

    def _run(self, waveform: object) -> Block:
        made = super()._run(waveform)  # type: ignore[arg-type]
        inputs = {**made.inputs, "b read": np.full(len(made), self.reading)}
        return replace(made, inputs=inputs, invalid_reasons={"b read": "open wire"} if self.says_why else {})


def guarded(reading: float, *locks: Interlock) -> Guard:
    return Guard(Dead(reading), Protection(interlocks=locks, rate_hz=100.0))


def test_without_an_interlock_a_dead_channel_ends_the_task():
    with pytest.raises(LinkError, match="'b read' has no measurement at"):
        guarded(np.nan).ready()


def test_why_there_is_none_is_said_in_the_devices_words():
    with pytest.raises(LinkError, match=r"'b read' has no measurement at .* s: open wire"):
        Guard(Dead(np.nan, says_why=True), Protection(rate_hz=100.0)).ready()
    watch = Watch(Interlock("p", "trip", Band("pressure", high=1.0)))
    found = watch.judge(replace(block([0.0, np.nan]), invalid_reasons={"pressure": "sensor broken"}))
    assert "no measurement (sensor broken); allowed" in found.text


def test_an_interlock_decides_how_long_its_channel_may_be_dead():
    guard = guarded(np.nan, Interlock("b", "stop", Band("b read", high=1.0), for_s=1e3))
    guard.ready()
    blind = guarded(np.nan, Interlock("b", "indicate", Band("b read", high=1.0)))
    with pytest.raises(LinkError, match="'b read' has no measurement at"):
        blind.ready()


def test_beyond_the_range_of_a_channel_that_nobody_watches_the_task_goes_on():
    guarded(np.inf).ready()


def recording(values: list[float], events: tuple[object, ...] = ()) -> Recording:
    time_s = np.arange(float(len(values)))
    return Recording("r", time_s, {"a": Channel("a", "V", np.array(values))}, {"events": list(events)})


def test_suppositions_are_numbers_and_leave_alone_what_was_measured():
    event = {"event": "no measurement", "row": 1, "details": {"channel": "a", "low": -10.0, "high": 10.0}}
    made = recording([1.0, np.nan, 3.0, np.inf, -np.inf], (event,))
    assert supposed(made, "near").values("a").tolist() == [1.0, 2.0, 3.0, 10.0, -10.0]
    assert supposed(made, "far").values("a").tolist() == [1.0, 10.0, 3.0, 30.0, -30.0]


def test_rows_without_a_measurement_are_cut_and_a_dead_channel_left_out():
    made = recording([1.0, np.nan, 3.0, np.inf, 5.0])
    dead = replace(made, channels={**made.channels, "b": Channel("b", "V", np.full(5, np.nan))})
    told = with_blanks(dead)
    cut = measured_rows(told, ["a", "b"])
    assert (cut.values("a").tolist(), cut.time_s.tolist(), set(cut.channels)) == (
        [1.0, 3.0, 5.0],
        [0.0, 2.0, 4.0],
        {"a"},
    )
    assert len(cut.meta["unmeasured"]) == 2
    assert len(measured_rows(told, [])) == 5
    with pytest.raises(FileError, match="no two rows in which all that is used was measured"):
        measured_rows(recording([1.0, np.nan, np.inf]), ["a"])
    with pytest.raises(FileError, match="'a' was not measured in 2 of 2"):
        with_blanks(recording([np.nan, np.inf]))


def test_only_channels_that_are_used_decide_which_samples_tell():
    """A second meter at the end of its range costs nothing; samples of the response that are none are not told."""
    (made, *_) = records(seed=5)
    flow, spool = made.values("flow").copy(), made.values("flow").copy()
    flow[1000:1100], spool[200:900] = np.inf, np.nan
    lacking = replace(made, channels={
        **made.channels,
        "flow": Channel("flow", "l/min", flow),
        "spool position": Channel("spool position", "%", spool),
        "other meter": Channel("other meter", "l/min", np.where(spool > 0.0, np.inf, spool)),
    })  # fmt: skip
    (e,) = bound(nominal(), [with_blanks(lacking)])
    assert len(e.output) == len(made)
    assert np.flatnonzero(e.invalid["output"]).tolist() == list(range(1000, 1100))
    assert np.flatnonzero(e.invalid["spool position"]).tolist() == list(range(200, 900))
    assert np.isfinite(e.output).all() and np.isfinite(e.observed["spool position"]).all()


def test_only_what_rests_on_no_measurement_is_not_given():
    def evaluate(made):
        a = made.values("a")
        first, largest = Measurement("first", "V", ""), Measurement("largest", "V", "", high=5.0)
        bound = Measurement("bound", "V", "", low=5.0)
        measured = (first.of(float(a[0]), 0.1), largest.of(float(a.max()), 0.1), bound.of(a.max(), 0.0, relation=">"))
        curves = {"both": [{"y": a[:2]}, {"y": a[2:]}], "whole": {"y": a}}
        return Findings(measured, curves, ("seen",))

    found = measured_findings(evaluate, recording([1.0, 2.0, 3.0, np.inf, 4.0]))
    first, largest, bound = found.measured
    assert (first.value, largest.value, largest.verdict) == (1.0, None, "cannot tell")
    assert (bound.value, bound.relation) == (4.0, ">")
    assert len(found.curves["both"]) == 1 and "whole" not in found.curves
    assert found.notes[-1] == "seen"
    assert "'a' was not measured in 1 of 5 samples (at the end of its range or beyond)" in found.notes[0]
    assert "largest" in found.notes[1] and "first" not in found.notes[1]
    whole = recording([1.0, 2.0])
    assert measured_findings(evaluate, whole).notes == ("seen",)


def test_a_step_beyond_the_range_of_the_flow_meter_has_no_figure(tmp_path):
    """The meter ends at 42 l/min, the valve gives 50: no change of 42 may be told."""
    stands_still = {"dead-flow-meter": {"stale_s": 60.0}}  # as the meter does at its end
    path = bench_file(tmp_path / "narrow.toml", "brevini-hpv41", channels={"flow": {"range": [-4.0, 4.0]}},
                      interlocks=stands_still)  # fmt: skip
    procedure = load_procedure("step_response")
    outcome = run_procedure(procedure, read_bench(path), {"levels": "0,80,0,50"}, tmp_path / "run")
    values = {m.name: m.value for m in outcome.findings.measured}
    assert values["change, 0 → 80 %"] is None and values["change, 80 → 0 %"] is None
    assert values["change, 0 → 50 %"] == pytest.approx(21.6, abs=0.5)
    told = json.loads((tmp_path / "run" / "results.json").read_text(encoding="utf-8"))
    assert "'flow' was not measured in" in told["notes"][0] and "change, 0 → 80 %" in told["notes"][1]
    assert "was not measured in" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    events = [event["event"] for event in read_recording(tmp_path / "run").meta["events"]]
    assert {"reading at the end of its range", "measured again"} <= set(events)
    assert np.nanmax(read_recording(tmp_path / "run").values("flow")) < 42.0
    assert evaluate_run(procedure, tmp_path / "run").findings.measured == outcome.findings.measured
