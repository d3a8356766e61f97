"""The error tree. Every message says what, where, which value, and what is allowed.

HilError
├── InputError            bad input or usage                         exit status 2
│   ├── FileError         a file that cannot be read as what it should be
│   ├── UnitError         "flow [kg]" where a volume flow is asked for
│   ├── SettingError      a procedure setting out of its allowed range
│   ├── RangeError        a waveform beyond the envelope, found before the first sample
│   ├── RehearsalError    what the rehearsal on the simulated valve refused
│   ├── InUseError        a bench that another program drives
│   ├── ArchiveError      the index of the archive cannot be read or written; the runs are safe in their folders
│   └── UnknownNameError  no driver, plant, effect … of that name
└── HardwareError         the bench failed                            exit status 3
    ├── LinkError         no or garbled answer from a device
    ├── DeviceLostError   the device is gone
    │   └── UnansweredError  it was commanded safe, and did not answer
    ├── OutputUnderflowError the output ran out of samples
    ├── OverrunError      input samples were overwritten before they were read
    ├── StorageError      the recording could not be written (disk full)
    ├── StoppedError      an interlock ended the run
    ├── NotSafeError      nobody knows that all outputs are safe
    └── TrippedError      an interlock tripped; latched until reset by name
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal


class HilError(Exception):
    """Anything this program can explain to its user in one line."""

    exit_status = 2


class InputError(HilError):
    """Bad input or usage; nothing was driven and nothing was lost."""


class FileError(InputError):
    """A file that cannot be read as what it should be: truncated run folder, NaN in a column."""


class UnitError(InputError):
    """A unit that is unknown or does not convert to the one asked for."""


class SettingError(InputError):
    """A setting out of its allowed range: negative frequency, rate below 20 times the top frequency."""


class RangeError(InputError):
    """A waveform outside the envelope, refused before its first sample."""


class RehearsalError(InputError):
    """The simulated valve tripped, or its envelope was left; the bench itself was not touched."""


class InUseError(InputError):
    """Another program drives the bench; `pid` is its process, if it said so."""

    def __init__(self, text: str, pid: int | None) -> None:
        super().__init__(text)
        self.pid = pid


class ArchiveError(InputError):
    """The index of the archive is locked, full, away or of a newer version; the run folders are as they were."""


class UnknownNameError(InputError):
    """A name that no installed package provides."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        known = sorted(known)
        close = get_close_matches(name, known, n=1)
        hint = f", did you mean '{close[0]}'?" if close else ""
        super().__init__(f"no {kind} named '{name}'{hint or ';'} known: {', '.join(known) or 'none'}")
        self.name = name


class HardwareError(HilError):
    """The bench failed. Making outputs safe was tried before this is raised; its notes say what came of it."""

    exit_status = 3


class LinkError(HardwareError):
    """No answer, a late answer or a garbled answer from a device."""


class DeviceLostError(HardwareError):
    """The device is gone: unplugged, powered off, or its link is down. Its outputs cannot be made safe from here."""


class UnansweredError(DeviceLostError):
    """A device was told to make its outputs safe, and did not answer."""


class OutputUnderflowError(HardwareError):
    """The output buffer ran empty while the hardware still asked for samples."""


class OverrunError(HardwareError):
    """Input samples were overwritten before they were read."""


class StorageError(HardwareError):
    """The recording could not be written; what was flushed before is kept."""


@contextmanager
def storing(path: Path, refused: str = "cannot be written", kept: str = "") -> Iterator[None]:
    """Turn what the operating system refuses of a file into a `StorageError` that says so.

    Args:
        path: of the file.
        refused: what could not be done with it.
        kept: the end of the message: what is not lost.
    """
    try:
        yield
    except OSError as error:
        raise StorageError(f"{path}: {refused}: {error.strerror or error}{kept}") from error


@contextmanager
def reading(path: Path | str, refused: str = "cannot be read", remedy: str = "") -> Iterator[None]:
    """The same of a file that is read, as a `FileError`; `remedy`: the end of the message."""
    try:
        yield
    except OSError as error:
        raise FileError(f"{path}: {refused}: {error.strerror or error}{remedy}") from None


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Put the name of a file before every `FileError` that is raised within: who raises it need not know the name."""
    try:
        yield
    except FileError as error:
        raise FileError(f"{name}: {error}") from None


class StoppedError(HardwareError):
    """An interlock ended the run; the next one may start."""


class NotSafeError(HardwareError):
    """An output is driven, or nobody knows where it stands."""


class TrippedError(HardwareError):
    """An interlock tripped. Latched: it needs a reset by name."""


def marked(error: BaseException, status: int, text: str) -> None:
    """Give an error the exit status of the run that it ends, and a sentence about the outputs, once."""
    error.__dict__["exit_status"] = status
    if text and text not in getattr(error, "__notes__", ()):
        error.add_note(text)


def reason(error: BaseException) -> str:
    """What an error says, or what it is when it says nothing, as when memory runs out."""
    return " ".join(str(error).split()) or type(error).__name__


def with_notes(error: BaseException) -> str:
    """An error and what has been noted about it since, in one line."""
    return "; ".join(filter(None, (" ".join(str(error).split()), *getattr(error, "__notes__", ()))))


def first_fault(error: Any) -> str:
    """What is wrong with the first field that a `ValidationError` of pydantic names, and what was found there."""
    first = error.errors()[0]
    return f"field '{'.'.join(map(str, first['loc']))}': {first['msg']}, found {first['input']!r:.60}"


def exit_status_of(error: BaseException) -> int:
    """The exit status with which an error ends the program."""
    return int(getattr(error, "exit_status", HilError.exit_status))


_door: ContextVar[Literal["", "prompt", "python"]] = ContextVar("door", default="")
_ARGUMENTS = {
    "interval": "interval_s", "unit": "units", "rename": "renamed", "input": "inputs", "input-name": "inputs",
    "output-name": "output", "rise": "rise_s",
    "settling": "settling_s", "budget": "budget_s", "bench-budget": "bench_budget_s", "window": "window_s",
    "load-pressure": "load_pressure_bar", "limit": "limits", "note": "notes", "reset": "resets",
}  # fmt: skip
"""Options whose argument is called otherwise; every other one is called as it is."""
_OF_READ = ("time", "interval", "unit", "rename", "columns", "gaps")


@contextmanager
def options_of(door: Literal["prompt", "python"]) -> Iterator[None]:
    """While it lasts options are called as at this door; the outermost one counts."""
    token = _door.set(_door.get() or door)
    try:
        yield
    finally:
        _door.reset(token)


def option(name: str, value: str = "") -> str:
    """An option as its user calls it: `--unit 'flow=l/min'`, in Python `hil.read(…, units={'flow': 'l/min'})`."""
    of, is_pair, to = value.rpartition("=")
    if _door.get() != "python":
        quoted = f"'{value}'" if is_pair else shlex.quote(value)
        return f"--{name} {quoted}" if value else f"--{name}"
    called = _ARGUMENTS.get(name, name.replace("-", "_"))
    given = {"gaps": "True"}.get(name, f"{{'{of}': '{to}'}}" if is_pair else value)
    text = f"{called}={given}" if given else called
    return f"hil.read(…, {text})" if name in _OF_READ else text


def listed(names: Iterable[object], most: int = 12) -> str:
    """Names for a message: `a, b`; of more than `most` the first ones and how many there are, `none` of none."""
    texts = list(map(str, names))
    if len(texts) > most:
        return f"{', '.join(texts[:most])}, … ({len(texts)} in all)"
    return ", ".join(texts) or "none"
