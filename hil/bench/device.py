"""The devices of a bench: their modules, their settings, and what can be connected to them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import BaseModel

from hil.bench.draft import Draft, sound_part
from hil.bench.fault import Fault
from hil.bench.file import EMERGENCY_STOP, Bench, ChannelEntry, Device
from hil.bench.files import at_home
from hil.bench.lines import Place
from hil.catalog import Kind, find
from hil.daq.address import is_relayed
from hil.daq.channel import InputChannel, OutputChannel, Terminal, Wiring
from hil.daq.contract import Daq
from hil.daq.link import DIRECT_S, RELAYED_S, Late, Link
from hil.daq.pin import Pin
from hil.errors import HardwareError, HilError, LinkError

_WHATEVER = (Exception, SystemExit)  # that a driver may throw; Ctrl-C is not its own


@dataclass(frozen=True, slots=True)
class DeviceInUse:
    """A device of a bench, not yet opened. However often it is opened, it is the same one (see `hil.daq.pin.Pin`)."""

    name: str
    module: ModuleType
    settings: BaseModel
    terminals: Mapping[str, Terminal]
    late_s: float = DIRECT_S
    pin: Pin = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pin", Pin(self.module, self.settings))

    def open(self, channels: Mapping[str, ChannelEntry], *, looked_at: bool = False, only_safe: bool = False) -> Daq:
        """Open it with these channels, the outputs where they were found.

        Args:
            channels: of the bench.
            looked_at: nothing is run: an input without a measurement is shown as such, not refused.
            only_safe: nothing is wanted but that its outputs become safe, as fast as can be: not measured first, and
                told also where nobody answers.

        Raises:
            DeviceLostError: it is not there, or another device has its name or address now.
            LinkError: it does not answer.
        """
        wiring = replace(self.wiring(channels), looked_at=looked_at, only_safe=only_safe)
        with named(self.name):
            if not mixes(self.module):
                return self.pin.daq(wiring)
            return polled_of({self.name: self.pin.link(wiring)}, {self.name: wiring}, {self.name: self})

    def wiring(self, channels: Mapping[str, ChannelEntry]) -> Wiring:
        """The channels that are connected to this device, in raw units."""
        mine = {name: channel for name, channel in channels.items() if channel.device == self.name}
        return Wiring(
            {name: self._output(name, channel) for name, channel in mine.items() if channel.is_output},
            {name: self._input(name, channel) for name, channel in mine.items() if not channel.is_output},
        )

    def _output(self, name: str, channel: ChannelEntry) -> OutputChannel:
        terminal = self.terminals[channel.terminal]
        low, high = channel.raw_range(terminal)
        safe = channel.line.raw_at(channel.safe or 0.0)
        pwm = channel.pwm.drive() if channel.pwm else None
        return OutputChannel(name, channel.terminal, terminal.kind, terminal.unit, low, high, safe, pwm)

    def _input(self, name: str, channel: ChannelEntry) -> InputChannel:
        terminal = self.terminals[channel.terminal]
        low, high = channel.raw_range(terminal)
        return InputChannel(
            name, channel.terminal, terminal.kind, terminal.unit, low, high, terminal.over, terminal.step
        )


def device_in_use(name: str, draft: Draft | Bench, folder: Path) -> tuple[DeviceInUse | None, list[Fault]]:
    """A device with its settings checked by its own module, or the faults that keep it from being used.

    Model files named in the bench file are looked for beside it, in `folder`.
    """
    device = draft.devices[name]
    key = "driver" if device.driver else "simulated"
    kind: Kind = "drivers" if device.driver else "devices"
    place: Place = ("devices", name)
    try:
        module = find(kind, device.driver or device.simulated).load()
    except HilError as error:
        return None, [Fault((*place, key), str(error))]
    given = own_settings(device, folder) | (
        {"simulation": simulation_of([name], draft, folder)} if device.simulated else {}
    )
    try:
        found, faults = _made_of(name, module, given, place, device.late_s)
    except HilError:
        raise
    except _WHATEVER as error:
        return None, [Fault((*place, key), f"{module.__name__} is at fault: {type(error).__name__}: {error}")]
    return found, [_at_home(fault, place) for fault in faults]


def _made_of(
    name: str, module: ModuleType, given: Mapping[str, Any], place: Place, late_s: float | None
) -> tuple[DeviceInUse | None, list[Fault]]:
    settings, faults = sound_part(module.Settings, given, place)
    if settings is None:
        return None, faults
    faults += [Fault((*place, *below), text) for below, text in module.faults(settings)]
    return DeviceInUse(name, module, settings, module.terminals(settings), late_s or _late_s(settings)), faults


def _late_s(settings: BaseModel) -> float:
    return RELAYED_S if is_relayed(settings) else DIRECT_S


@contextmanager
def named(device: str) -> Iterator[None]:
    """What goes wrong inside is an error of this device; whatever is none of this program becomes a `LinkError`."""
    try:
        yield
    except HardwareError as error:
        if str(error).startswith(f"{device}: "):
            raise
        raise type(error)(f"{device}: {error}") from error
    except HilError:
        raise
    except _WHATEVER as error:
        raise LinkError(f"{device}: cannot be opened: {type(error).__name__}: {error}") from error


def mixes(module: ModuleType) -> bool:
    """Whether a device can share a bench with others: one that the host polls over a link can."""
    return hasattr(module, "open_link")


def open_devices(devices: Mapping[str, DeviceInUse], channels: Mapping[str, ChannelEntry]) -> Daq:
    """The devices of a bench as one DAQ: one alone as its module makes it, several polled in one loop.

    Raises:
        HardwareError: one cannot be opened; the others are let go of.
    """
    if len(devices) == 1:
        (device,) = devices.values()
        return device.open(channels)
    wirings = {name: device.wiring(channels) for name, device in devices.items()}
    links: dict[str, Link] = {}
    try:
        for name, device in devices.items():
            with named(name):
                links[name] = device.pin.link(wirings[name])
    except BaseException:
        for link in links.values():
            with suppress(Exception):  # one that cannot be closed keeps no other from it
                link.close()
        raise
    return polled_of(links, wirings, devices)


def polled_of(links: Mapping[str, Link], wirings: Mapping[str, Wiring], devices: Mapping[str, DeviceInUse]) -> Daq:
    """Links under the names that they have on this bench, so that whatever they raise says that name once."""
    from hil.daq.polled import PolledDaq

    doubts = {name: devices[name].pin.doubt for name in links}
    measured = not any(wiring.only_safe for wiring in wirings.values())
    late = {name: Late(devices[name].late_s) for name in links}
    return PolledDaq(links, wirings, measured=measured, doubts=doubts, late=late)


def simulation_of(names: Collection[str], draft: Draft | Bench, folder: Path) -> dict[str, Any]:
    """What simulated devices of these names are told about the world behind them.

    The plant is the valve's own if nothing else is said, and the instrument on each channel is just what the
    channel's calibration says, unless `[simulation.instruments.NAME]` says otherwise.
    """
    simulation = dict(draft.simulation)
    plant = simulation.get("plant") or (draft.valve.plant if draft.valve else "")
    own = simulation.get("instruments", {})
    instruments = {name: _instrument(name, channel, own.get(name, {}))
                   for name, channel in draft.channels.items() if channel.device in names}  # fmt: skip
    return simulation | {"plant": model_path(plant, folder), "instruments": instruments}


def own_settings(device: Device, folder: Path) -> dict[str, Any]:
    """What a bench file says to a driver or simulated device; files beside it that describe the device as paths."""
    found: dict[str, Any] = at_home(device.settings, folder)
    return found


def model_path(plant: str, folder: Path) -> str:
    """A model file beside the bench file as a path; the name of an installed plant or model as it is."""
    return str(folder / plant) if isinstance(plant, str) and plant.endswith(".json") else plant


def _instrument(name: str, channel: ChannelEntry, own: Mapping[str, Any]) -> dict[str, Any]:
    line = channel.line
    closed = {"value": 1.5 * channel.open_below} if channel.role == EMERGENCY_STOP else {"signal": name}
    signal = {} if "value" in own or "signal" in own else closed
    return {"direction": "out" if channel.is_output else "in", **signal,
            "unit": line.unit, "slope": line.slope, "offset": line.offset, **own}  # fmt: skip


def _at_home(fault: Fault, device: Place) -> Fault:
    """What a device found in its simulation stands in `[simulation]`."""
    below = fault.place[len(device) :]
    return Fault(below, fault.text) if below[:1] == ("simulation",) else fault
