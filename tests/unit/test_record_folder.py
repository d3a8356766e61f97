"""The run folder: what comes back, what a reader is told when something is missing, and what is refused."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.errors import FileError, StorageError
from hil.record import folder
from hil.record.durable import Syncer, write_at
from hil.record.folder import RunWriter, read
from hil.record.invalid_samples import measured_rows
from hil.record.read import read_recording
from hil.record.run_folder import samples
from hil.record.run_folder.header import Column, read_header
from hil.record.run_folder.tail import Tail

CHANNELS = [("command", "%"), ("flow", "l/min")]


def block(first: int, count: int = 100) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    time_s = np.arange(first, first + count) / 1000.0
    return time_s, {"command": np.sin(time_s), "flow": np.cos(time_s)}


def make_run(path: Path, blocks: int = 5, **header: object) -> Path:
    with RunWriter.create(path, header, CHANNELS) as run:
        for i in range(blocks):
            run.append(*block(100 * i))
    return path


def test_a_run_comes_back_with_everything(tmp_path):
    flow = Column(name="flow", unit="l/min", source="meter 3", calibration={"slope": 10.0})
    with RunWriter.create(tmp_path / "deep" / "run", {"sampling": {"read_at": 0.5}, "when": np.float64(3)},
                          [("command", "%"), flow]) as run:  # fmt: skip
        run.append(*block(0))
        with run.part({"kind": "sine", "frequency_hz": np.float64(0.3)}):
            run.append(*block(100))
            run.append(*block(200, 50))
        run.event("level reached", level=3)
        with run.part({"kind": "refused"}):
            pass
    found = read(tmp_path / "deep" / "run")
    assert np.array_equal(found.time_s, np.arange(250) / 1000.0)
    assert np.array_equal(found.channels["flow"].values, np.cos(found.time_s))
    assert found.channels["flow"].source == "meter 3"
    assert found.channels["flow"].calibration == {"slope": 10.0}
    assert found.meta["sampling"] == {"read_at": 0.5}
    assert found.meta["when"] == 3.0
    assert found.meta["outcome"] == "completed"
    assert found.meta["parts"] == [
        {"kind": "sine", "frequency_hz": 0.3, "first": 100, "count": 150, "start_s": 0.1, "stop_s": 0.249}
    ]
    (event,) = found.meta["events"]
    assert (event["event"], event["row"], event["time_s"], event["details"]) == (
        "level reached",
        250,
        0.249,
        {"level": 3},
    )
    assert "incomplete" not in found.meta


def test_the_ten_lines_of_the_reference_read_it(tmp_path, monkeypatch):
    text = (Path(__file__).parents[2] / "docs" / "reference" / "run-folder.md").read_text(encoding="utf-8")
    code = text.split("```python\n")[1].split("```")[0]
    monkeypatch.chdir(make_run(tmp_path / "run"))
    with (Path("samples.log")).open("ab") as file:
        file.write(b"            5")  # a line that is being written
    seen: dict[str, Any] = {}
    exec(code, seen)
    assert list(seen["data"]) == ["time", "command", "flow"]
    assert np.array_equal(seen["data"]["flow"], np.cos(np.arange(500) / 1000.0))


def test_an_existing_folder_is_never_touched(tmp_path):
    path = make_run(tmp_path / "run")
    before = {file.name: file.read_bytes() for file in path.iterdir()}
    with pytest.raises(FileError, match="exists already"):
        RunWriter.create(path, {}, CHANNELS)
    assert {file.name: file.read_bytes() for file in path.iterdir()} == before


def test_a_folder_that_cannot_be_made_is_a_storage_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match=r"file/run: the run folder cannot be made"):
        RunWriter.create(tmp_path / "file" / "run", {}, CHANNELS)


def test_a_run_is_read_while_it_is_written(tmp_path):
    run = RunWriter.create(tmp_path / "run", {}, CHANNELS)
    with run.part({"kind": "step"}):
        run.append(*block(0))
        found = read(run.path)
        assert len(found) == 100
        assert "not closed" in found.meta["incomplete"]
        assert found.meta["parts"][0]["unfinished"] is True
        run.append(*block(100))
    run.close()
    assert len(read(run.path)) == 200


def test_a_reader_follows_a_run_to_its_end(tmp_path):
    run = RunWriter.create(tmp_path / "run", {"procedure": "x"}, CHANNELS)
    tail = Tail(run.path)
    assert len(tail.samples()) == 0
    run.append(*block(0))
    run.event("one")
    assert np.array_equal(tail.samples(most=60).time_s, np.arange(60) / 1000)
    run.append(*block(100))
    assert np.array_equal(tail.samples().time_s, np.arange(60, 200) / 1000)
    assert [event["event"] for event in tail.events()] == ["one"]
    assert tail.events() == []
    assert not tail.finished
    run.append(*block(200))
    run.close()
    last = tail.samples()
    assert last.channels["flow"].unit == "l/min"
    assert np.array_equal(last.channels["flow"].values, block(200)[1]["flow"])
    assert tail.finished


def test_an_error_inside_a_part_marks_it_and_names_the_outcome(tmp_path):
    def interrupted():
        with RunWriter.create(tmp_path / "run", {}, CHANNELS) as run, run.part({"kind": "sine"}):
            run.append(*block(0))
            raise RuntimeError("pump off")

    with pytest.raises(RuntimeError):
        interrupted()
    found = read(tmp_path / "run")
    assert found.meta["outcome"] == "RuntimeError: pump off"
    assert found.meta["parts"][0]["unfinished"] is True


def test_details_may_not_hide_the_place_of_a_part(tmp_path):
    with (
        RunWriter.create(tmp_path / "run", {}, CHANNELS) as run,
        pytest.raises(ValueError, match="must not be named count"),
        run.part({"count": 3}),
    ):
        pass


@pytest.mark.parametrize("channels", [[("time", "s")], [("flow", "V"), ("flow", "V")], [], [("a [b]", "V")]])
def test_channels_that_cannot_be_told_apart_are_refused(tmp_path, channels):
    with pytest.raises(ValueError, match=r"must differ|at least 2|pattern"):
        RunWriter.create(tmp_path / "run", {}, channels)
    assert not (tmp_path / "run").exists()


def test_a_block_must_fit_the_declaration(tmp_path):
    with RunWriter.create(tmp_path / "run", {}, CHANNELS) as run:
        time_s, values = block(0)
        with pytest.raises(ValueError, match="declared channels: command, flow; found: command"):
            run.append(time_s, {"command": values["command"]})
        with pytest.raises(ValueError, match="channel 'flow' has shape"):
            run.append(time_s, {**values, "flow": values["flow"][1:]})
        assert run.rows == 0


def test_time_must_go_on(tmp_path):
    with RunWriter.create(tmp_path / "run", {}, CHANNELS) as run:
        run.append(*block(0))
        with pytest.raises(
            StorageError, match=r"sample 100: time 0.05 s does not come after .* 100 samples .* are kept"
        ):
            run.append(*block(50))
        run.append(*block(100))
    assert len(read(tmp_path / "run")) == 200


def test_a_large_block_is_the_same_as_many_small_ones(tmp_path):
    with RunWriter.create(tmp_path / "one", {}, CHANNELS) as run:
        run.append(*block(0, 150_000))
    with RunWriter.create(tmp_path / "many", {}, CHANNELS) as run:
        for first in range(0, 150_000, 1000):
            run.append(*block(first, 1000))
    assert (tmp_path / "one" / "samples.f8").read_bytes() == (tmp_path / "many" / "samples.f8").read_bytes()


def test_an_endurance_run_needs_no_memory(tmp_path):
    with RunWriter.create(tmp_path / "run", {}, CHANNELS) as run:
        run.append(*block(0, 1000))
        tracemalloc.start()
        for first in range(1000, 400_000, 1000):
            run.append(*block(first, 1000))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert (tmp_path / "run" / "samples.f8").stat().st_size > 9_000_000
    assert peak < 500_000


def test_a_large_run_stays_on_the_disk(tmp_path, monkeypatch):
    path = make_run(tmp_path / "run")
    with RunWriter.create(tmp_path / "large", {}, CHANNELS) as run:
        run.append(*block(0, 400_000))
    monkeypatch.setattr(samples, "COPIED_BYTES", 0)
    read(path)  # imports and caches
    tracemalloc.start()
    found = read(tmp_path / "large")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found) == 400_000
    assert peak < 5_000_000  # of 9.6 MB on disk; pieces of 1 MB are checked at a time
    assert np.array_equal(found.channels["flow"].values[-3:], np.cos(found.time_s[-3:]))


def content(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], object]:
    """A file of JSON with one change."""

    def changed(path: Path) -> None:
        told = json.loads(path.read_text())
        change(told)
        path.write_text(json.dumps(told))

    return changed


def overwrite_a_sample(path: Path) -> None:
    with path.open("r+b") as file:
        file.seek(250 * 24 + 9)
        file.write(b"\x01")


@pytest.mark.parametrize(
    ("name", "tamper", "says"),
    [
        ("run.json", content(lambda c: c.update(version=2)), "version 2; this program reads version 1"),
        ("run.json", content(lambda c: c.update(format="x")), "field 'format' must be 'hil-run'"),
        ("run.json", content(lambda c: c.update(colour="red")), "field 'colour': Extra inputs"),
        ("run.json", content(lambda c: c["samples"]["columns"][1].pop("unit")), "columns.1.unit': Field required"),
        ("run.json", content(lambda c: c["meta"].update(valve={"name": "other"})), "changed after the run was closed"),
        ("run.json", lambda path: path.write_text("{"), "JSON was expected"),
        ("end.json", content(lambda c: c.update(rows=400)), r"samples.f8: changed after .* \w+, expected \w+ over 400"),
        ("end.json", content(lambda c: c.update(rows=-1)), "field 'rows'"),
        ("samples.f8", overwrite_a_sample, "changed after the run was closed, from row 200 on"),
        ("events.jsonl", lambda path: path.write_text('{"event": "forged", "row": 0, "details": {}}\n'),
         "changed after the run was closed: SHA-256"),
        *((name, Path.unlink, "cannot be read: No such file") for name in ("run.json", "samples.f8", "events.jsonl")),
    ],
)  # fmt: skip
def test_a_file_that_was_tampered_with_is_named(tmp_path, name, tamper, says):
    path = make_run(tmp_path / "run")
    tamper(path / name)
    with pytest.raises(FileError, match=says if "samples.f8" in says else f"{name}: .*{says}"):
        read(path)


def test_rows_before_a_cut_are_good(tmp_path):
    path = make_run(tmp_path / "run")
    with (path / "samples.f8").open("r+b") as file:
        file.truncate(350 * 24 + 5)
    found = read(path)
    assert len(found) == 300  # the blocks that are whole
    assert found.meta["incomplete"] == "of 500 rows only the first 300 are in samples.f8"


def test_samples_that_an_unreadable_journal_hides_are_said_to_be_lost(tmp_path):
    path = make_run(tmp_path / "run")
    (path / "end.json").unlink()
    journal = (path / "samples.log").read_bytes()
    (path / "samples.log").write_bytes(journal[: 3 * 25] + bytes(len(journal) - 3 * 25))
    found = read(path)
    assert len(found) == 300
    assert found.meta["incomplete"].endswith("samples.log cannot be read from line 4 on: samples after 300 are lost")


def test_the_journal_of_a_closed_run_is_not_needed(tmp_path):
    path = make_run(tmp_path / "run")
    (path / "samples.log").unlink()
    assert len(read(path)) == 500


def test_an_empty_run_says_so(tmp_path):
    path = make_run(tmp_path / "run", blocks=0)
    with pytest.raises(FileError, match="0 samples; at least 2 are needed"):
        read(path)


def test_what_was_not_measured_is_kept_as_such_and_is_no_number_for_who_asks_for_measurements(tmp_path):
    with RunWriter.create(tmp_path / "run", {}, CHANNELS) as run, run.part({"kind": "level"}):
        time_s, values = block(0)
        values["flow"][7], values["flow"][9] = np.nan, np.inf
        run.append(time_s, values)
    whole, measured = read(tmp_path / "run"), read_recording(tmp_path / "run")
    assert np.flatnonzero(~np.isfinite(whole.values("flow"))).tolist() == [7, 9]
    assert np.flatnonzero(np.isnan(measured.values("flow"))).tolist() == [7, 9]
    cut = measured_rows(measured, ["flow"])
    assert cut.time_s.tolist() == np.delete(whole.time_s, [7, 9]).tolist()
    assert cut.meta["parts"][0]["count"] == whole.meta["parts"][0]["count"] - 2 == len(cut)
    assert "'flow' was not measured in 2 of" in measured.meta["unmeasured"][0]


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("call", [0, 1])
def test_an_interrupt_in_the_middle_of_a_block_leaves_no_trace(tmp_path, monkeypatch, call, share):
    calls = iter(range(2))

    def interrupted(file, position, data):
        if next(calls) == call:
            write_at(file, position, data[: int(share * len(data))])
            raise KeyboardInterrupt
        write_at(file, position, data)

    run = RunWriter.create(tmp_path / "run", {}, CHANNELS)
    run.append(*block(0))
    with monkeypatch.context() as patch:
        patch.setattr(samples, "write_at", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run.append(*block(100, 70))
    known = run.rows
    assert known in (100, 170)  # without its rows, or with all of them
    assert len(read(run.path)) <= known
    run.append(*block(200, 10))
    run.close("stopped")
    found = read(run.path)
    assert np.array_equal(found.channels["flow"].values, np.cos(found.time_s))
    assert len(found) == known + 10
    assert (run.path / "samples.f8").stat().st_size == len(found) * 24


def test_an_error_of_the_disk_is_not_lost(tmp_path):
    with (tmp_path / "file").open("wb") as file:
        descriptor = file.fileno()
    syncer = Syncer([descriptor], interval_s=0.001)  # the file is closed: every sync fails
    syncer.written()
    with pytest.raises(OSError, match="Bad file descriptor"):
        syncer.stop()
    with pytest.raises(OSError, match="Bad file descriptor"):
        syncer.check()


def test_closing_twice_changes_nothing(tmp_path):
    run = RunWriter.create(tmp_path / "run", {}, CHANNELS)
    run.append(*block(0))
    run.close("first", pump="off")
    run.close("second")
    assert read(run.path).meta["outcome"] == "first"
    assert read(run.path).meta["pump"] == "off"


def test_a_run_copied_as_a_recording_stays_the_same(tmp_path):
    with RunWriter.create(tmp_path / "run", {"procedure": "x"}, CHANNELS) as run:
        with run.part({"kind": "sine"}):
            run.append(*block(0))
        run.event("between")
        with run.part({"kind": "step"}):
            run.append(*block(100))
        run.close("operator stopped it")
    found = read(run.path)
    folder.write(found, tmp_path / "copy")
    copied = read(tmp_path / "copy")
    assert copied.meta == found.meta
    assert np.array_equal(copied.time_s, found.time_s)
    assert np.array_equal(copied.channels["flow"].values, found.channels["flow"].values)


def test_a_slice_speaks_of_its_own_samples_only(tmp_path):
    with RunWriter.create(tmp_path / "run", {"procedure": "x"}, CHANNELS) as run:
        for i, kind in enumerate(("rest", "sine", "step")):
            with run.part({"kind": kind}):
                run.append(*block(100 * i))
        run.event("end")
    found = read(run.path)
    sine, step = found.meta["parts"][1], found.meta["parts"][2]
    only = found.rows(sine["first"], sine["count"])
    assert np.array_equal(only.time_s, np.arange(100, 200) / 1000)
    assert only.meta["parts"] == [{"kind": "sine", "first": 0, "count": 100, "start_s": 0.1, "stop_s": 0.199}]
    both = found.part(0.15, 1.0)
    assert [(p["kind"], p["first"], p["count"], "unfinished" in p) for p in both.meta["parts"]] == [
        ("sine", 0, 50, True), ("step", 50, 100, False)]  # fmt: skip
    assert found.rows(step["first"], step["count"]).meta["events"][0]["row"] == 100
    assert found.meta["parts"][1]["first"] == 100  # the original is as it was


def test_read_header_of_a_file_says_that_a_run_folder_is_needed(tmp_path):
    (tmp_path / "x.csv").write_text("time [s],flow [l/min]\n0,1\n1,2\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"x\.csv: a file, where a run folder is needed"):
        read_header(tmp_path / "x.csv")
