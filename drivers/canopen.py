"""Nodes on CANopen by their EDS or DCF: objects by PDO, mapped as the file says or as it is told, heartbeats, EMCY."""

from __future__ import annotations

from collections.abc import Iterator

from drivers._can import bus_fault
from drivers._canopen_link import CanopenLink, NodeSettings
from drivers._described import ByDescription
from hil.daq.channel import Wiring
from hil.description.named import Described, description_faults

_devices = ByDescription("canopen")
terminals, has_watchdog = _devices.terminals, _devices.has_watchdog
watchdog_levels = _devices.watchdog_levels


class Settings(NodeSettings, Described):
    """What `[devices.NAME]` may say: how the node is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
    """


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from description_faults(settings, "canopen")
    if text := bus_fault(settings.address):
        yield ("address",), text
    if settings.watchdog_s is not None and settings.longest_reply_s >= settings.watchdog_s:
        yield ("longest_reply_s",), f"must be shorter than watchdog_s = {settings.watchdog_s:g}, or the node faults"
    yield from _devices.watchdog_faults(settings)


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "canopen")


def open_link(settings: Settings, wiring: Wiring) -> CanopenLink:
    """The node, recognised, its PDOs mapped, operational."""
    return CanopenLink(settings, wiring, _devices.described(settings))
