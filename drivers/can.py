"""Devices on plain CAN and J1939 by a DBC file: signals by name, counters, checksums, time-outs."""

from __future__ import annotations

from collections.abc import Iterator

from drivers._can import bus_fault
from drivers._can_frames import BusSettings
from drivers._can_link import CanLink
from drivers._described import ByDescription
from hil.daq.channel import Wiring
from hil.description.named import Described

_devices = ByDescription("can")
terminals, has_watchdog, not_read_back = _devices.terminals, _devices.has_watchdog, _devices.not_read_back
watchdog_levels = _devices.watchdog_levels


class Settings(BusSettings, Described):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
    """


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    if text := bus_fault(settings.address):
        yield ("address",), text
    yield from _devices.faults(settings)


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "cantools")


def read_back_requests(_wiring: Wiring) -> int:
    """None: messages of the device say where its outputs stand."""
    return 0


def open_link(settings: Settings, wiring: Wiring) -> CanLink:
    """The bus, open; on J1939 our address claimed where there is something to command."""
    return CanLink(settings, wiring, _devices.described(settings))
