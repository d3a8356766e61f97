"""Devices that answer lines of text on a serial line or socket: gauges, meters, controllers, by their description."""

from __future__ import annotations

from collections.abc import Iterator

from drivers._line import needed_for
from drivers._text_link import DEVICES, Settings, TextLink
from hil.daq.channel import Wiring

terminals, has_watchdog, not_read_back = DEVICES.terminals, DEVICES.has_watchdog, DEVICES.not_read_back
watchdog_levels = DEVICES.watchdog_levels


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from DEVICES.faults(settings)
    yield from DEVICES.watchdog_faults(settings)


def needs(settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return needed_for(settings)


def open_link(settings: Settings, wiring: Wiring) -> TextLink:
    """The device, recognised, set up, its watchdog armed."""
    return TextLink(settings, wiring)
