"""Devices that answer lines of text on a serial line or socket: gauges, meters, controllers, by their description."""

from __future__ import annotations

from collections.abc import Iterator

from drivers._edge import reply_faults
from drivers._text_link import Settings, TextLink, level_of, text_description
from hil.daq.channel import Terminal, Wiring
from hil.description.named import description_faults, ports_of


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    wrong = list(description_faults(settings, "text"))
    yield from wrong
    yield from reply_faults(settings)
    if not wrong and settings.watchdog_s is not None and not has_watchdog(settings):
        yield ("watchdog_s",), "its description has no [watchdog]: say there how it is armed, or take this away"
    if settings.watchdog_level is not None and (wrong or settings.watchdog_s is None or _is_armed(settings)):
        yield ("watchdog_level",), "only for a watchdog that was set at the device itself; take this away"


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Those of the description; none while it has faults."""
    return ports_of(settings, "text")


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("serial",)


def has_watchdog(settings: Settings) -> bool:
    """Whether the device has one."""
    return text_description(settings).watchdog is not None


def not_read_back(settings: Settings) -> set[str]:
    """Outputs that cannot be asked where they stand."""
    return text_description(settings).not_read_back


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Where its watchdog puts outputs, if that is always the same."""
    level = level_of(settings)
    return {} if level is None else dict.fromkeys(text_description(settings).outputs, level)


def open_link(settings: Settings, wiring: Wiring) -> TextLink:
    """The device, recognised, set up, its watchdog armed."""
    return TextLink(settings, wiring)


def _is_armed(settings: Settings) -> bool:
    watchdog = text_description(settings).watchdog
    return watchdog is not None and bool(watchdog.arm)
