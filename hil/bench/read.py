"""Read a bench file, or say everything that is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from hil.bench.base import text_of, whole_bench
from hil.bench.check import faults_of
from hil.bench.device import DeviceInUse, device_in_use, open_devices, own_settings
from hil.bench.draft import draft_of
from hil.bench.fault import bench_error
from hil.bench.file import Bench, ChannelEntry
from hil.bench.files import kept
from hil.daq.channel import Terminal
from hil.daq.contract import Daq
from hil.errors import FileError
from hil.version import is_newer, made_by

MADE_WITH = "made_with"


@dataclass(frozen=True, slots=True)
class BenchFile:
    """A bench file without faults.

    Attributes:
        path: where it was read.
        text: as it stood there, with what it is based on, and the files of its devices as comments behind it; it goes
            into the header of every run.
        bench: what it says.
        devices: what drives the bench, by name, settings checked, not yet opened.
    """

    path: Path
    text: str
    bench: Bench
    devices: Mapping[str, DeviceInUse]

    def open(self) -> Daq:
        """The devices as one DAQ, in raw units, the outputs where they were found. Raises `HardwareError`."""
        return open_devices(self.devices, self.bench.channels)

    def terminal_of(self, channel: ChannelEntry) -> Terminal:
        """Where a channel is connected."""
        return self.devices[channel.device].terminals[channel.terminal]

    def of_unit(self, serial: str) -> BenchFile:
        """The same bench with another unit on it."""
        valve = self.bench.valve.model_copy(update={"serial": serial})
        return replace(self, bench=self.bench.model_copy(update={"valve": valve}))

    @property
    def is_simulated(self) -> bool:
        """Whether every device is; the bench then begins anew with each run."""
        return all(self.bench.devices[name].simulated for name in self.devices)


def read_bench(path: Path) -> BenchFile:
    """Read a bench file.

    Raises:
        FileError: it cannot be read, or is not TOML (the message names the line).
        BenchError: it has faults, each with its line and what to do about it.
    """
    text = text_of(path)
    content, whole = whole_bench(path, text)
    maker = str(content.get(MADE_WITH, ""))
    if is_newer(maker):
        raise FileError(f"{path}: {made_by(maker)}; use that one, or take out what it does not know and '{MADE_WITH}'")
    draft, faults = draft_of(content)
    devices: dict[str, DeviceInUse] = {}
    for name in draft.devices:
        device, found = device_in_use(name, draft, path.parent)
        faults += found
        if device is not None:
            devices[name] = device
    faults += faults_of(draft, devices, path.parent)
    if faults:
        raise bench_error(path, text, faults)
    bench = Bench.model_validate(content)
    beside = kept({name: own_settings(device, path.parent) for name, device in bench.devices.items()})
    return BenchFile(path, whole + beside, bench, devices)
