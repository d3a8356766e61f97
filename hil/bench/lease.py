"""The lease on a bench: one program at a time drives its valve."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from filelock import Timeout

from hil.bench.device import DeviceInUse
from hil.bench.read import BenchFile
from hil.daq.address import places_of
from hil.errors import FileError, InUseError, StorageError
from hil.record.state import keep, state_path
from hil.system import system
from hil.untrusted import read_json


@contextmanager
def leased(file: BenchFile) -> Iterator[None]:
    """Holds the bench and the addresses of its devices while inside; ends with the process, however it ends.

    A simulated bench begins anew with each run and needs none.

    Raises:
        InUseError: another program holds it; says which, and since when.
        StorageError: the lease cannot be written.
    """
    with ExitStack() as held:
        for what, name in [] if file.is_simulated else _leases(file):
            held.enter_context(_lease_held(what, name))
        yield


def _leases(file: BenchFile) -> list[tuple[str, str]]:
    """The bench and each device, by what it is: a copy of the file, or another name of a port, is the same valve.

    Each with what is told of it when another program has it. In order, so that two programs never wait for each other.
    """
    addresses = {_address(device) for device in file.devices.values()} - {""}
    devices = {place: address for address in sorted(addresses) for place in places_of(address)}
    bench = f"bench {file.bench.name}"
    return [(bench, bench), *((f"device at {place}", f"device at {devices[place]}") for place in sorted(devices))]


def _address(device: DeviceInUse) -> str:
    """By which address a device is reached, or by which name its maker's own driver knows it."""
    settings = device.settings
    return str(getattr(settings, "address", "") or getattr(settings, "device", ""))


@contextmanager
def _lease_held(what: str, name: str) -> Iterator[None]:
    path = state_path("leases", what, ".lock")
    holder = path.with_suffix(".json")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = system.lock_file(str(path))
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
    since = system.utc().isoformat(timespec="seconds")
    content = {"pid": system.pid(), "since": since, "program": program}
    keep(holder, json.dumps(content), "the lease cannot be written")


def _in_use(name: str, holder: Path) -> InUseError:
    try:
        content = read_json(holder)
        pid, since, program = int(content["pid"]), str(content["since"]), str(content["program"])
    except (OSError, FileError, ValueError, KeyError, TypeError):  # it has just been taken
        return InUseError(f"{name}: in use by another program; one at a time may drive it", None)
    return InUseError(
        f"{name}: in use by process {pid} ({program:.80}) since {since}; one program at a time may drive it", pid
    )
