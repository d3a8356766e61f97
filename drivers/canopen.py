"""Nodes on CANopen by their EDS or DCF: objects by PDO, mapped as the file says or as it is told, heartbeats, EMCY."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import ConfigDict

from drivers._can import bus_fault
from drivers._canopen_link import CanopenLink, NodeSettings
from hil.daq.channel import Terminal, Wiring
from hil.description.canopen import CanopenDescription
from hil.description.named import Described, description_faults, description_of, expired_levels, ports_of


class Settings(NodeSettings, Described):
    """What `[devices.NAME]` may say: how the node is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    wrong = list(description_faults(settings, "canopen"))
    yield from wrong
    if text := bus_fault(settings.address):
        yield ("address",), text
    if settings.watchdog_s is not None and settings.longest_reply_s >= settings.watchdog_s:
        yield ("longest_reply_s",), f"must be shorter than watchdog_s = {settings.watchdog_s:g}, or the node faults"
    if not wrong and settings.watchdog_s is not None and not has_watchdog(settings):
        yield ("watchdog_s",), "its description has no [watchdog]: say there where outputs go, or take this away"


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Those of the description; none while it has faults."""
    return ports_of(settings, "canopen")


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "canopen")


def has_watchdog(settings: Settings) -> bool:
    """Whether the node watches our heartbeat."""
    return _description(settings).watchdog is not None


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Where outputs go when it misses it."""
    return expired_levels(_description(settings))


def open_link(settings: Settings, wiring: Wiring) -> CanopenLink:
    """The node, recognised, its PDOs mapped, operational."""
    return CanopenLink(settings, wiring, _description(settings))


def _description(settings: Settings) -> CanopenDescription:
    return description_of(settings, "canopen")
