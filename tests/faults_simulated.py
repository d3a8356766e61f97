"""Faults on the simulated DAQ, in virtual time: what fails, at which moment, and what the device sees of it."""

from __future__ import annotations

import errno
import shutil
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from hil.bench.ending import accounted
from hil.bench.open import open_rig
from hil.bench.read import BenchFile, read_bench
from hil.daq.contract import Block, Daq, ReadBack, Waveform
from hil.errors import (
    DeviceLostError,
    FileError,
    HilError,
    LinkError,
    OutputUnderflowError,
    OverrunError,
    exit_status_of,
    with_notes,
)
from hil.record.folder import read
from hil.record.recording import Recording
from hil.record.run_folder.samples import RowsWriter
from hil.rig import Rig
from hil.safety.interrupt import terminable
from hil.safety.outputs import Outputs
from tests.bench_files import bench_file
from tests.faults import Case, Seen

LINK = "simulated DAQ"
BLOCK_S, LEVEL, SWING, RAMP_PER_S = 0.05, 60.0, 10.0, 200.0
# The course of the run, in seconds of the device since it was opened, and a moment within each stretch of it.
MOMENTS = {"before anything moves": 0.05, "on the way up": 0.25, "while it stands": 3.0, "in a stream": 5.0,
           "on the way down": 6.53}  # fmt: skip
_BLOCK_SAMPLES = round(1000.0 * BLOCK_S)
_JUMP_S = BLOCK_S + 0.005
_RAMP_S = BLOCK_S + (LEVEL + SWING) / RAMP_PER_S + 0.005


class Stop(Exception):
    """An error of the procedure itself."""


@dataclass
class Faulty:
    """A simulated DAQ that does `fault` with the first block that ends after a moment, and remembers its output."""

    daq: Daq
    at_s: float
    fault: Callable[[Faulty, Block], Block]
    happened_s: float | None = None
    samples: int = 0
    gone: bool = False
    run: Path | None = None
    course: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.daq, name)

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        return self._with_fault(self.daq.play(waveform, block_samples))

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        return self._with_fault(self.daq.stream(waveforms))

    @property
    def roll_back(self) -> Callable[[int], None] | None:
        back = self.daq.roll_back

        def taken_back(block_samples: int) -> None:
            self.samples -= len(self.course.pop()[0])
            back(block_samples)

        return back and taken_back

    def make_safe(self) -> None:
        if self.gone:
            raise gone(self)
        self.daq.make_safe()
        self._saw(np.array([self.now_s]), np.array([self.daq.levels["command"]]))

    def read_back(self) -> dict[str, ReadBack]:
        return dict.fromkeys(self.outputs, ReadBack(why="gone")) if self.gone else self.daq.read_back()

    def close(self) -> None:
        if not self.gone:
            self.make_safe()

    @property
    def now_s(self) -> float:
        return float(self.daq.now_s)

    @property
    def safe_after_s(self) -> float | None:
        """From the fault until the output was at zero for good."""
        time_s, level = (np.concatenate(parts) for parts in zip(*self.course, strict=True))
        if level[-1] != 0.0 or self.happened_s is None:
            return None
        driven = np.flatnonzero(level)
        safe_s = time_s[driven[-1] + 1] if driven.size else 0.0
        return max(0.0, float(safe_s) - self.happened_s)

    def _with_fault(self, blocks: Iterator[Block]) -> Iterator[Block]:
        if self.gone:
            raise gone(self)
        for block in blocks:
            self._saw(block.time_s, block.outputs["command"])
            self.samples += len(block)
            begins = self.happened_s is None and block.time_s[-1] >= self.at_s
            if begins and len(block) > _BLOCK_SAMPLES and (roll_back := self.roll_back):
                roll_back(_BLOCK_SAMPLES)  # it happens in one of the blocks in it
                continue
            if block.time_s[-1] >= self.at_s:
                if self.happened_s is None:
                    self.happened_s = max(self.at_s, float(block.time_s[0]))
                block = self.fault(self, block)
            yield block

    def _saw(self, time_s: np.ndarray, level: np.ndarray) -> None:
        self.course.append((time_s, level))


def gone(_daq: Faulty) -> DeviceLostError:
    return DeviceLostError("the device is gone")


def _lose(daq: Faulty, _block: Block) -> Block:
    daq.gone = True
    raise gone(daq)


def _once(error: Callable[[], BaseException]) -> Callable[[Faulty, Block], Block]:
    """An error that the device raises once, instead of handing over a block."""
    raised: list[Faulty] = []

    def fault(daq: Faulty, block: Block) -> Block:
        if daq in raised:
            return block
        raised.append(daq)
        raise error()

    return fault


def _signal(number: signal.Signals) -> Callable[[Faulty, Block], Block]:
    sent: list[Faulty] = []

    def fault(daq: Faulty, block: Block) -> Block:
        if daq not in sent:
            sent.append(daq)
            signal.raise_signal(number)
        return block

    return fault


def _reads(channel: str, value: float) -> Callable[[Faulty, Block], Block]:
    """An input that from the moment on reads this (raw)."""

    def fault(daq: Faulty, block: Block) -> Block:
        values = np.where(block.time_s >= daq.at_s, value, block.inputs[channel])
        return replace(block, inputs={**block.inputs, channel: values})

    return fault


def _full_disk(daq: Faulty, block: Block) -> Block:
    def refuse(_self: RowsWriter, _table: np.ndarray) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    patch.object(RowsWriter, "append", refuse).start()  # stopped when the case is over
    return block


def _delete_folder(daq: Faulty, block: Block) -> Block:
    if daq.run is not None:
        shutil.rmtree(daq.run, ignore_errors=True)
        daq.run = None
    return block


_EVERYWHERE = tuple(MOMENTS)
_DRIVEN = _EVERYWHERE[1:]
_FAULTS: dict[str, tuple[Callable[[Faulty, Block], Block], tuple[str, ...], float | None, str]] = {
    "device gone": (_lose, _EVERYWHERE, None, "NOT SAFE: nobody knows where 'command' stands"),
    "input overrun": (_once(lambda: OverrunError("sample 17 was overwritten before it was read")), _DRIVEN[1:], _RAMP_S,
                      "sample 17 was overwritten before it was read"),
    "output buffer empty": (_once(lambda: OutputUnderflowError("no sample to drive")), ("in a stream",), _RAMP_S,
                            "no sample to drive"),
    "no answer, once": (_once(lambda: LinkError("no valid answer within 0.2 s")), _DRIVEN, _RAMP_S, "no valid answer"),
    "pressure too high": (_reads("supply pressure", 9.0), _EVERYWHERE, 0.02 + _JUMP_S, "'over-pressure': 225 for"),
    "pressure lost": (_reads("supply pressure", 0.0), _DRIVEN[1:3], 0.2 + _RAMP_S, "interlock 'pressure-lost': 0 for"),
    "flow meter dead": (_reads("flow", 1.0), _DRIVEN[1:3], 0.5 + _RAMP_S, "has stood at 10 for 0.5 s: dead sensor"),
    "reading is no number": (_reads("supply pressure", np.nan), _DRIVEN[1:3], 0.02 + _JUMP_S,
                             "'over-pressure': no measurement"),
    "other reading is no number": (_reads("spool position", np.nan), _DRIVEN[1:3], _RAMP_S,
                                   "'spool position' has no measurement"),
    "output does not follow": (_reads("command read-back", 0.0), ("on the way up", "while it stands"), 0.05 + _JUMP_S,
                               "interlock 'command-not-obeyed'"),
    "Ctrl-C": (_signal(signal.SIGINT), _EVERYWHERE, _RAMP_S, "KeyboardInterrupt"),
    "SIGTERM": (_signal(signal.SIGTERM), _DRIVEN, _RAMP_S, "Terminated"),
    "SIGHUP": (_signal(signal.SIGHUP), _DRIVEN[:1], _RAMP_S, "Terminated: SIGHUP"),
    "SIGQUIT": (_signal(signal.SIGQUIT), _DRIVEN[:1], _RAMP_S, "Terminated: SIGQUIT"),
    "run folder deleted": (_delete_folder, _DRIVEN, _RAMP_S, "the run folder was deleted"),
    "disk full": (_full_disk, _EVERYWHERE, _RAMP_S, "No space left on device"),
}  # fmt: skip
_OF_THE_PROCEDURE = {
    "error in the procedure": "Stop: division by zero",
    "sample beyond the limits": "150 % is outside -100 … 100 %",
}

CASES = [
    *(Case(LINK, fault, moment, within_s, says)
      for fault, (_, moments, within_s, says) in _FAULTS.items() for moment in moments),
    *(Case(LINK, fault, moment, _RAMP_S, says)
      for fault, says in _OF_THE_PROCEDURE.items() for moment in ("while it stands", "in a stream")),
]  # fmt: skip


def bench(folder: Path) -> BenchFile:
    """The simulated HPV41 with a short reaction time."""
    return read_bench(bench_file(folder / "bench.toml", "brevini-hpv41", protection={"block_s": BLOCK_S}))


def measure(case: Case, folder: Path) -> Seen:
    """Make it happen."""
    fault = _FAULTS[case.fault][0] if case.fault in _FAULTS else lambda _daq, block: block
    at_s = MOMENTS[case.moment] if case.fault in _FAULTS else np.inf
    file, opened = bench(folder), []

    def open_daq(settings: Any, wiring: Any) -> Faulty:
        opened.append(Faulty(real.module.open_daq(settings, wiring), at_s, fault))
        return opened[0]

    (real,) = file.devices.values()
    faulty = replace(real, module=SimpleNamespace(open_daq=open_daq))
    message, status = "", 0
    try:
        with (
            accounted(Outputs()),
            terminable(),
            open_rig(replace(file, devices={real.name: faulty}), folder / "run", {}, _silent) as rig,
        ):
            opened[0].run = folder / "run"
            _drive(rig, case, opened[0])
    except (HilError, KeyboardInterrupt, Stop) as error:
        status = exit_status_of(error)
        message = ": ".join(filter(None, (type(error).__name__, with_notes(error))))
    finally:
        patch.stopall()
    (daq,) = opened
    samples = 0
    with suppress(FileError):
        recording = read(folder / "run")
        samples, message = len(recording), message or _last_event(recording)
    return Seen(daq.safe_after_s, daq.samples - samples, message, samples, status)


def _last_event(recording: Recording) -> str:
    """What stands in the run when nothing was raised."""
    return "".join(f"event: {event['event']}: {event['details']}" for event in recording.meta["events"][-1:])


def _silent(_done: float, _text: str) -> None:
    pass


def _drive(rig: Rig, case: Case, daq: Faulty) -> None:
    """Up the ramp to 60 %, stand there for 2 s, swing about it for 2 s without a gap; then the bench is left."""
    fails = case.fault in _OF_THE_PROCEDURE
    rig.ramp_to(LEVEL)
    rig.play(np.full(2000, LEVEL))
    if fails and case.moment == "while it stands":
        daq.happened_s = daq.now_s
        _fail(rig, case)
    for _ in rig.stream(_swing(case if fails else None, daq)):
        pass


def _fail(rig: Rig, case: Case) -> None:
    if case.fault == "error in the procedure":
        raise Stop("division by zero")
    rig.play(np.full(10, 150.0))


def _swing(case: Case | None, daq: Faulty) -> Iterator[np.ndarray]:
    for i in range(8):
        if case is not None and i == 4:
            daq.happened_s = daq.now_s
            if case.fault == "error in the procedure":
                raise Stop("division by zero")
            yield np.full(250, 150.0)
        yield LEVEL + SWING * np.sin(2.0 * np.pi * 4.0 * np.arange(250) / 1000.0)
