"""Open a bench: device, calibrations, guard, run folder, rig. Safe before, after, and on any error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hil.bench.device import model_path
from hil.bench.ending import Ending, LastWord, accounted, closed_for_sure, recorded
from hil.bench.file import Bench
from hil.bench.heartbeat import WatchdogHandle, watched
from hil.bench.lease import leased
from hil.bench.progress_report import ProgressReporter, Shown
from hil.bench.protection import protection_of
from hil.bench.protection_coverage.calibration import deviations_on
from hil.bench.protection_coverage.packages import check_packages
from hil.bench.read import BenchFile
from hil.bench.recorder import Recorder
from hil.bench.rig import BenchRig, conditions_of
from hil.bench.stop.control import published
from hil.catalog import base_plant
from hil.clock import Clock, clock
from hil.daq.contract import Block, Daq
from hil.daq.scaled import Scaled
from hil.errors import FileError
from hil.language.note import codes_of
from hil.record.folder import RunWriter
from hil.record.recording import Recording
from hil.record.run_folder.header import Column
from hil.record.run_folder.progress import Progress
from hil.safety.guard import Guard
from hil.safety.interrupt import notified_of_signals
from hil.safety.latch import Latch, latch_path
from hil.safety.operator import Operator
from hil.safety.outputs import Outputs
from hil.safety.ramp import way_to


@contextmanager
def open_rig(
    file: BenchFile,
    out: Path,
    about: Mapping[str, Any],
    progress: Progress,
    resets: Iterable[str] = (),
    earlier: Recording | None = None,
    output_states: Outputs | None = None,
    commanding: str = "",
    operator: Operator | None = None,
    within: AbstractContextManager[Callable[[], None]] | None = None,
    word: LastWord | None = None,
) -> Iterator[BenchRig]:
    """The rig of a bench, recording into a new run folder; outputs are made safe before and after, and read back.

    Outputs that stand somewhere while the bench is open (`on`) go there first. An error that ends the run says in its
    notes what is known of the outputs, and has the exit status that follows from it (see `hil.safety.outputs`).

    Whatever ends the run closes the bench and its record at once: every later call to the rig raises the same again,
    and so does this when it is left, however what is inside returned (see `hil.bench.ending`).

    Args:
        file: the bench.
        out: the run folder to make.
        about: what the run is: procedure and settings, as JSON values, for the header.
        progress: called with how far the procedure is.
        resets: names of interlocks whose trips are forgotten first.
        earlier: a run that this one resumes: it begins with the samples of that, and its procedure is told which
            parts are finished.
        output_states: what is known of the outputs, for somebody who asks for it afterwards.
        commanding: the output that the rig drives, where it is not the command of the bench.
        operator: whoever may stop or hold this run from outside. A bench with a watchdog is listened for in any case.
        within: entered before anything else, and left when the run has ended; what it yields is called once the bench
            is had, before anything is driven.
        word: said when an error has ended the run.

    Raises:
        FileError: the folder exists, or the earlier run lacks a channel.
        SettingError: a package is missing that a driver needs, or a calibration is overdue that may not be.
        InUseError: another program drives this bench.
        HardwareError: the device cannot be opened, or does not answer.
        NotSafeError: everything went well, but for an output that could not be made safe at the end.
        TrippedError: an interlock is tripped and not reset.
        UnknownNameError: a reset of an interlock that has not tripped.
    """
    ending = Ending(word)
    output_states = output_states or Outputs()
    operator = operator or (None if file.is_simulated else Operator())
    try:
        begins = ending.enter(within or nullcontext(lambda: None))
        check_packages(file)
        deviations = deviations_on(file, datetime.now(UTC).date())
        ending.enter(leased(file))
        watch = ending.enter(watched(file, out, output_states, operator))
        ending.enter(accounted(output_states))
        daq = ending.enter(_opened(file, output_states))
        watch.say_identities()
        bench = file.bench
        latch = _latch(file, resets)
        columns = [_column(name, file) for name in (*daq.outputs, *daq.inputs)]
        columns += [Column(name=name, unit="s", source="time of the readings") for name in daq.promises.delay_names]
        rate_hz = daq.actual_rate_hz(bench.sample_rate_hz)
        header = {**about, **_header(file, daq, rate_hz), "deviations": deviations, "codes": codes_of(deviations)}
        writer = ending.enter(
            recorded(
                RunWriter.create(out, header, columns), output_states, lambda: operator.stopped_by if operator else ""
            )
        )
        finished = _taken_over(writer, earlier)
        recorder = Recorder(writer, daq.inputs)
        reporter = ProgressReporter(
            progress, _shown_channels(bench, daq, commanding), virtual=daq.promises.timing == "virtual",
            begins_s=0.0 if earlier is None else float(earlier.time_s[-1]),
        )  # fmt: skip

        def keep(block: Block) -> None:
            recorder.keep(block)
            reporter.heard(recorder.time_of(block), block.columns)

        guard = Guard(
            daq, protection_of(bench, rate_hz), latch, _clock(daq), keep, recorder.note, watch.beat,
            output_states, operator,
        )  # fmt: skip
        if watch.note:
            recorder.note("no stop from a console", why=watch.note)
        ending.enter(published(watch.control, out, lambda: not output_states.are_commanded, recorder.note))
        ending.enter(_left_to_the_watchdog(watch, output_states))
        ending.enter(closed_for_sure(guard.close))
        ending.guard = guard
        ending.enter(notified_of_signals(ending.signalled))
        begins()
        with ending.task():
            _switch_on(bench, guard, rate_hz)
        yield BenchRig(bench, guard, recorder, columns, reporter, finished, commanding, ending,
                       asks=operator.goes_on_by if operator else "")  # fmt: skip
    except BaseException as error:
        ending.end(error)
    else:
        ending.end(None)
    ending.returned()


def _header(file: BenchFile, daq: Daq, rate_hz: float) -> dict[str, Any]:
    """What the header of a run says of its bench."""
    bench = file.bench
    return {
        **conditions_of(bench), "bench_file": file.text,
        "plant": base_plant(model_path(bench.valve.plant, file.path.parent)),
        "sampling": daq.promises.sampling(daq.inputs, rate_hz),
        "driven": {name: output.driven for name, output in daq.outputs.items()},
        "read": {name: {"step": read.step} for name, read in daq.inputs.items() if read.step},
    }  # fmt: skip


@contextmanager
def _left_to_the_watchdog(watch: WatchdogHandle, output_states: Outputs) -> Iterator[None]:
    """Outputs that could not be made safe are left to the watchdog at once, before the record is closed."""
    try:
        yield
    finally:
        if not output_states.are_commanded:
            watch.hand_over()


@contextmanager
def _opened(file: BenchFile, output_states: Outputs) -> Iterator[Daq]:
    """The devices, open and safe; let go of afterwards, whatever the guard in front of them came to."""
    daq = Scaled(file.open(), {name: entry.line for name, entry in file.bench.channels.items()})
    output_states.opened(daq.outputs)
    with closed_for_sure(lambda: _let_go(daq, output_states)):
        output_states.make_safe(daq, clock=_clock(daq))
        output_states.check()
        yield daq


def _let_go(daq: Daq, output_states: Outputs) -> None:
    if not output_states.asked:
        output_states.make_safe(daq, clock=_clock(daq))
    daq.close()


def _taken_over(writer: RunWriter, earlier: Recording | None) -> Sequence[Mapping[str, Any]]:
    """Begin a run with what an earlier one has recorded; returns the parts that it has finished."""
    if earlier is None:
        return ()
    if lacking := [column.name for column in writer.header.samples.columns[1:] if column.name not in earlier.channels]:
        raise FileError(
            f"{earlier.name}: no channel '{lacking[0]}'; an earlier version of this program recorded it, it cannot be "
            "resumed; run it again"
        )
    writer.take_over(earlier)
    writer.event("resumed", run=earlier.name)
    return [part for part in earlier.meta["parts"] if not part.get("unfinished")]


def _switch_on(bench: Bench, guard: Guard, rate_hz: float) -> None:
    """Bring outputs to where they stand while the bench is open, once every interlock has been judged."""
    targets = {name: entry.on for name, entry in bench.channels.items() if entry.on is not None}
    slews = {name: min(limits.slew_per_s, bench.channels[name].ramp_to_safe_per_s or math.inf)
             for name, limits in guard.limits.items()}  # fmt: skip
    way = way_to(targets, guard.levels, slews, rate_hz, tuple(reversed(bench.protection.shutdown_order)))
    if way is not None:
        for _ in guard.play(way):
            pass


def _shown_channels(bench: Bench, daq: Daq, commanding: str) -> list[Shown]:
    """Channels that the operator sees: the command, the response, the other inputs."""
    roles = bench.roles
    names = dict.fromkeys((commanding or roles["command"], roles["response"], *daq.inputs))
    spans = {name: channel.high - channel.low for name, channel in daq.inputs.items()}
    spans |= {name: channel.high - channel.low for name, channel in daq.outputs.items()}
    return [Shown(name, bench.channels[name].unit, spans[name]) for name in names]


def _clock(daq: Daq) -> Clock:
    return clock("virtual" if daq.promises.timing == "virtual" else "real")


def _latch(file: BenchFile, resets: Iterable[str]) -> Latch:
    """The trips of this bench. Those of a simulated one end with it: the next run finds a new bench."""
    latch = Latch(None if file.is_simulated else latch_path(file.bench.name))
    for name in resets:
        latch.reset(name)
    latch.check()
    return latch


def _column(name: str, file: BenchFile) -> Column:
    entry = file.bench.channels[name]
    raw_unit = file.terminal_of(entry).unit
    calibration = {} if entry.calibration is None else {**asdict(entry.line), "raw_unit": raw_unit}
    source = entry.source or f"{entry.device} {entry.terminal}"
    return Column(name=name, unit=entry.unit, source=source, calibration=calibration)
