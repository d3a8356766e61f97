"""Devices on plain CAN and J1939 by a DBC file: signals by name, counters, checksums, time-outs."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import ConfigDict

from drivers._can import bus_fault
from drivers._can_frames import BusSettings
from drivers._can_link import CanLink
from drivers._edge import reply_faults
from hil.daq.channel import Terminal, Wiring
from hil.description.can import CanDescription
from hil.description.named import Described, description_faults, description_of, expired_levels, ports_of


class Settings(BusSettings, Described):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from description_faults(settings, "can")
    if text := bus_fault(settings.address):
        yield ("address",), text
    yield from reply_faults(settings)


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Those of the description; none while it has faults."""
    return ports_of(settings, "can")


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "cantools")


def has_watchdog(settings: Settings) -> bool:
    """Whether the device makes its outputs safe when no command comes."""
    return _description(settings).watchdog is not None


def read_back_requests(_wiring: Wiring) -> int:
    """None: messages of the device say where its outputs stand."""
    return 0


def not_read_back(settings: Settings) -> set[str]:
    """Outputs of which no message says where they stand."""
    return {
        name
        for name, terminal in _description(settings).terminals.items()
        if terminal.direction == "out" and not terminal.read_back
    }


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Where outputs go when no command comes."""
    return expired_levels(_description(settings))


def open_link(settings: Settings, wiring: Wiring) -> CanLink:
    """The bus, open; on J1939 our address claimed where there is something to command."""
    return CanLink(settings, wiring, _description(settings))


def _description(settings: Settings) -> CanDescription:
    return description_of(settings, "can")
