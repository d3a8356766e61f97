"""The lease on a bench: one program at a time drives its valve."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock, Timeout

from hil.bench.read import BenchFile
from hil.errors import InUseError, StorageError
from hil.safety.latch import state_path


@contextmanager
def leased(file: BenchFile) -> Iterator[None]:
    """Holds the bench and the addresses of its devices while inside; ends with the process, however it ends.

    A simulated bench begins anew with each run and needs none.

    Raises:
        InUseError: another program holds it; says which, and since when.
        StorageError: the lease cannot be written.
    """
    with ExitStack() as held:
        for name in [] if file.is_simulated else _names(file):
            held.enter_context(_held(name))
        yield


def _names(file: BenchFile) -> list[str]:
    """The bench, and each address that it uses: a copy of its file under another name drives the same valve."""
    addresses = {str(getattr(device.settings, "address", "")) for device in file.devices.values()} - {""}
    return [f"bench {file.bench.name}", *sorted(f"device at {address}" for address in addresses)]


@contextmanager
def _held(name: str) -> Iterator[None]:
    path = state_path("leases", name, ".lock")
    holder = path.with_suffix(".json")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path, timeout=0)
        lock.acquire()
    except Timeout:
        raise _in_use(name, holder) from None
    except OSError as error:
        raise StorageError(f"{path}: the lease on the {name} cannot be taken: {error.strerror}") from error
    try:
        _write(holder)
        yield
    finally:
        lock.release()


def _write(holder: Path) -> None:
    program = " ".join([Path(sys.argv[0]).name, *sys.argv[1:]])
    since = datetime.now(UTC).isoformat(timespec="seconds")
    part = holder.with_suffix(f".{os.getpid()}")
    try:
        part.write_text(json.dumps({"pid": os.getpid(), "since": since, "program": program}), encoding="utf-8")
        part.replace(holder)
    except OSError as error:
        raise StorageError(f"{holder}: the lease cannot be written: {error.strerror}") from error


def _in_use(name: str, holder: Path) -> InUseError:
    try:
        told = json.loads(holder.read_text(encoding="utf-8"))
        pid, since, program = int(told["pid"]), str(told["since"]), str(told["program"])
    except (OSError, ValueError, KeyError, TypeError):  # it has just been taken
        return InUseError(f"{name}: in use by another program; one at a time may drive it", None)
    return InUseError(
        f"{name}: in use by process {pid} ({program:.80}) since {since}; one program at a time may drive it", pid
    )
