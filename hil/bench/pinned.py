"""A bench whose devices stay the ones that were opened first: a name may come to belong to another device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

from hil.bench.device import DeviceInUse
from hil.bench.file import ChannelEntry
from hil.bench.read import BenchFile
from hil.daq.address import Port
from hil.daq.contract import Daq
from hil.errors import DeviceLostError


@dataclass(frozen=True, slots=True)
class PinnedDevice(DeviceInUse):
    """A device that is opened again and again, and is refused when it is another one than the first time."""

    port: Port = field(default_factory=lambda: Port(""))
    answered: dict[str, str] = field(default_factory=dict)

    def open(self, channels: Mapping[str, ChannelEntry], *, looked_at: bool = False) -> Daq:
        """Open it.

        Raises:
            DeviceLostError: another device has its name now; before anything is sent to it where the port tells,
                else when the device has said what it is.
        """
        self.port.path()
        daq = DeviceInUse.open(self, channels, looked_at=looked_at)
        for name, identity in getattr(daq, "identities", {}).items():
            if identity and self.answered.setdefault(name, identity) != identity:
                daq.close()
                raise DeviceLostError(
                    f"another device answers: it says that it is {identity}; {self.answered[name]} was opened before"
                )
        return daq


def pinned(file: BenchFile) -> BenchFile:
    """The bench with every device pinned."""
    return replace(file, devices={name: _pinned(device) for name, device in file.devices.items()})


def _pinned(device: DeviceInUse) -> PinnedDevice:
    told = {part.name: getattr(device, part.name) for part in fields(device)}
    return PinnedDevice(**told, port=Port(str(getattr(device.settings, "address", ""))))
