"""The audit trail: who moved an output, reset a trip or overrode a limit, and when. Lines are only ever added."""

from __future__ import annotations

import getpass
import hashlib
import json
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from filelock import FileLock

from hil.bench.read import BenchFile
from hil.errors import FileError, StorageError, marked, reading, storing
from hil.record.run_folder.header import END_FILE, HEADER_FILE, read_end
from hil.record.run_folder.seal import SEAL_FILE, marks_of, read_seal
from hil.record.state import state_path
from hil.safety.interrupt import Halted, Terminated
from hil.system import system
from hil.untrusted import ANY_SIZE, open_small, parse_json

ACCOUNT = "HIL_ACCOUNT"
"""The environment variable that says to a run who started it at a console."""
_TAIL_BYTES, _LONGEST_LINE = 1 << 16, 1 << 24
_BEGINNING = "0" * 64
_CLOSES, _EVALUATES = "closes", "evaluates"


class Audit:
    """An append-only file of JSON lines, each on the disk before the act that it tells of is answered.

    Every line holds the SHA-256 of the one before it, so that a line that was changed or taken out is found; whoever
    can write the file can also write all of it anew.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or state_path("console", "audit", ".jsonl")
        self._lock = system.lock()

    def write(self, account: str, act: str, details: Mapping[str, Any], operator: str = "") -> None:
        """Add a line.

        Args:
            account: who was logged in: at the console, or on this computer (see `acting_account`); empty: nobody known.
            act: what happened.
            details: of it.
            operator: as typed for the run; it may be anybody's name.

        Raises:
            StorageError: it is not on the disk; what it tells of must not be done unnoticed.
        """
        with storing(self.path, "the audit trail cannot be written"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self._lock, FileLock(self.path.with_suffix(".lock"), timeout=5.0):
                self._add(account, act, details, operator)

    def _add(self, account: str, act: str, details: Mapping[str, Any], operator: str) -> None:
        handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)  # noqa: TID251
        try:
            last, whole = _last_line(handle)
            line = {
                "utc": datetime.now(UTC).isoformat(timespec="milliseconds"), "account": account, "operator": operator,
                "act": act, "details": details, "previous": hashlib.sha256(last).hexdigest() if last else _BEGINNING,
            }  # fmt: skip
            text = json.dumps(line, ensure_ascii=False, default=str).encode() + b"\n"
            _write_all(handle, text if whole else b"\n" + text)  # one that was torn by a power cut stays as it is
            os.fsync(handle)
        finally:
            os.close(handle)


@dataclass(frozen=True, slots=True)
class Link:
    """A line of the trail: its number in the file, the SHA-256 that the next one holds, and what it says."""

    number: int
    sha256: str
    line: Mapping[str, Any]


def chain(path: Path) -> Iterator[Link]:
    """The lines of an audit trail with their hashes, oldest first. One that a power cut tore is passed over.

    Lines that were cut off at the end are missed only by whoever kept a later head (see `head`).

    Raises:
        FileError: a line was changed, or one before it taken out; names its number (exit status 1).
    """
    last, torn, text = b"", 0, b""
    for number, text in enumerate(_lines(path), 1):
        if not text:
            continue
        if (line := _parsed(text)) is None and torn:
            raise _broken(f"{path}: line {torn} is none of an audit trail")
        if line is not None:
            if line["previous"] != (hashlib.sha256(last).hexdigest() if last else _BEGINNING):
                raise _broken(f"{path}: line {number} does not follow the one before it: one was changed or taken out")
            yield Link(number, hashlib.sha256(text).hexdigest(), line)
        last, torn = text, 0 if line is not None else number
    if torn and not text:  # it has its end: no power cut tore it
        raise _broken(f"{path}: line {torn} is none of an audit trail")


def head(path: Path) -> Link | None:
    """The last line of a trail whose chain holds; None of one that is not begun.

    Raises:
        FileError: as `chain`.
    """
    every = deque(chain(path) if path.exists() else (), maxlen=1)
    return every[0] if every else None


def _lines(path: Path) -> Iterator[bytes]:
    """Lines without their ends; the last one is empty where that of the last line is there."""
    whole = True
    with reading(path, "the audit trail cannot be read"), open_small(path, ANY_SIZE) as file:
        while text := file.readline(_LONGEST_LINE):
            if len(text) == _LONGEST_LINE:
                raise _broken(f"{path}: a line of more than {_LONGEST_LINE} bytes is none of an audit trail")
            whole = text.endswith(b"\n")
            yield text.removesuffix(b"\n")
    if whole:
        yield b""


def _parsed(text: bytes) -> dict[str, Any] | None:
    try:
        line = parse_json(text, "a line")
    except FileError:
        return None
    return line if isinstance(line, dict) and isinstance(line.get("previous"), str) else None


def _broken(sentence: str) -> FileError:
    error = FileError(sentence)
    marked(error, 1, "")  # changed, as `hil verify` says it
    return error


def _last_line(handle: int) -> tuple[bytes, bool]:
    """The last line without its end, and whether it has one."""
    size = os.fstat(handle).st_size
    if not size:
        return b"", True
    read = min(size, _TAIL_BYTES)
    tail = os.pread(handle, read, size - read)
    while b"\n" not in tail.rstrip(b"\n") and read < min(size, _LONGEST_LINE):
        read = min(size, 2 * read)
        tail = os.pread(handle, read, size - read)
    return tail.rstrip(b"\n").rpartition(b"\n")[2], tail.endswith(b"\n")


def _write_all(handle: int, text: bytes) -> None:
    while text:
        text = text[os.write(handle, text) :]


@contextmanager
def on_the_trail(
    file: BenchFile, out: Path, about: Mapping[str, Any], resets: Iterable[str] = ()
) -> Iterator[Callable[[], None]]:
    """A run stands in the audit trail from where it drives, with the trips that it has reset, and when it was stopped.

    On a bench that is simulated throughout nothing moves, and a trail that cannot be written keeps nobody from it.

    Args:
        file: the bench.
        out: the run folder.
        about: what the run is, with its operator.
        resets: names of interlocks whose trips are forgotten.

    Yields:
        What is to be called once the bench is had and before anything is driven. Raises `StorageError`: a line is not
        on the disk, and nothing may move.
    """
    audit, operator, drives = Audit(), str(about.get("operator") or ""), False
    run = {"run": str(out.absolute()), "bench": file.bench.name, "pid": system.pid()}
    details = {name: about[name] for name in ("procedure", "commanding", "resumes", "limits given") if about.get(name)}

    def begins() -> None:
        nonlocal drives
        with suppress(*([StorageError] if file.is_simulated else [])):
            for name in resets:
                audit.write(acting_account(), "reset", {**run, "interlock": name}, operator)
            audit.write(acting_account(), "drives", {**run, **details}, operator)
        drives = True

    try:
        yield begins
    except KeyboardInterrupt as stopped:
        if drives:
            how = {"how": str(stopped) or "Ctrl-C", "outputs": _of_outputs(stopped)}
            with suppress(
                StorageError, FileError
            ):  # the outputs are settled; what is known of them stands in the run folder
                account, is_own = _who_stopped(stopped, out)
                audit.write(account, "stop", {**run, **how}, operator if is_own else "")
        raise
    finally:
        if drives and (out / END_FILE).is_file():
            with suppress(StorageError, FileError):
                audit.write(acting_account(), _CLOSES, {"run": run["run"], "sha256": marks_of(out)}, operator)


def evaluated_on_the_trail(folder: Path) -> None:
    """The seal of a run that was evaluated, as it stands now; a trail that cannot be written keeps nobody from it."""
    seal = read_seal(folder)
    limits = {} if seal is None else {name: asdict(limit) for name, limit in seal.limits.items()}
    with suppress(StorageError):
        details = {"run": str(folder.absolute()), "sha256": marks_of(folder), "limits": limits}
        Audit().write(acting_account(), _EVALUATES, details)


def issued_on_the_trail(file: Path, sha256: str, serial: str) -> None:
    """A passport was issued: a head that is kept after this line shows that it was there by then."""
    with suppress(StorageError):
        Audit().write(acting_account(), "issues", {"file": str(file.absolute()), "sha256": sha256, "serial": serial})


def is_on_the_trail(folder: Path) -> bool:
    """Whether the trail of this computer holds a run as it lies there; False: it does not know it.

    Raises:
        FileError: the trail holds it otherwise, or is broken.
    """
    path = Audit().path
    here, place = marks_of(folder), str(folder.absolute())
    closes, evaluates = [], []
    for link in chain(path) if path.exists() else ():
        run, sealed = _sealed(link)
        same = sealed.get(HEADER_FILE) == here.get(HEADER_FILE)
        if link.line.get("act") == _CLOSES and (same or run == place):
            closes.append((link, sealed))
        elif link.line.get("act") == _EVALUATES and same:
            evaluates.append((link, sealed))
    if not closes:
        return False
    link, recorded = max(closes, key=lambda one: (_agree(one[1], here, HEADER_FILE, END_FILE), one[0].number))
    judged_in, judged = evaluates[-1] if evaluates else (link, {})
    for name, known, at in ((HEADER_FILE, recorded, link), (END_FILE, recorded, link), (SEAL_FILE, judged, judged_in)):
        if not _agree(known, here, name):
            raise FileError(
                f"{folder / name}: not the one that stands in the audit trail ({path}, line {at.number} of "
                f"{at.line.get('utc')})"
            )
    return True


def _sealed(link: Link) -> tuple[str, Mapping[str, str]]:
    """(run folder, hashes of the files that stand for it) of a line; nothing where it is none of a seal."""
    about = link.line.get("details")
    sealed = about.get("sha256") if isinstance(about, dict) else None
    return (str(about.get("run")), sealed) if isinstance(about, dict) and isinstance(sealed, dict) else ("", {})


def _agree(known: Mapping[str, str], here: Mapping[str, str], *names: str) -> bool:
    return all(known.get(name) == here.get(name) for name in names)


def acting_account() -> str:
    """Who acts in this process: the account at the console that started it, else who is logged in on this computer."""
    if given := os.environ.get(ACCOUNT):
        return given
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # a container's user without a name
        return f"user {os.getuid()}" if hasattr(os, "getuid") else ""


def _who_stopped(stopped: KeyboardInterrupt, out: Path) -> tuple[str, bool]:
    """(account, whether it is that of the run): Ctrl-C is of who sits at the terminal, a press of whom the record says.

    Who sent a signal, or pressed without an account, nobody knows.
    """
    if not isinstance(stopped, Terminated) and not os.environ.get(ACCOUNT):
        return acting_account(), True
    end = read_end(out) if isinstance(stopped, Halted) else None
    return ("" if end is None else str(end.meta.get("stopped_by") or "")), False


def _of_outputs(error: BaseException) -> str:
    return "; ".join(getattr(error, "__notes__", ()))
