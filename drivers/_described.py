"""What a driver whose devices have descriptions says of them before they are opened."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from drivers._edge import reply_faults
from hil.daq.channel import Terminal
from hil.description.named import description_faults, description_of
from hil.errors import HilError


@dataclass(frozen=True, slots=True)
class ByDescription:
    """The devices of a protocol; `settings` are those of their driver (see `hil.description.named.Described`)."""

    protocol: str

    def described(self, settings: Any) -> Any:
        """Its description. Raises `HilError`."""
        return description_of(settings, self.protocol)

    def faults(self, settings: Any) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """What is wrong with the description, and with the times of its link."""
        yield from description_faults(settings, self.protocol)
        yield from reply_faults(settings)

    def watchdog_faults(self, settings: Any) -> Iterator[tuple[tuple[str], str]]:
        """What is wrong with what a bench file says of the watchdog, where the description itself is sound."""
        if not self.is_sound(settings):
            return
        watchdog = self.described(settings).watchdog
        if settings.watchdog_s is not None and watchdog is None:
            yield ("watchdog_s",), "its description has no [watchdog]: say it there, or take this away"
        has_level = getattr(settings, "watchdog_level", None) is not None
        if has_level and (settings.watchdog_s is None or (watchdog is not None and watchdog.arm)):
            yield ("watchdog_level",), "only for a watchdog that was set at the device itself; take this away"

    def is_sound(self, settings: Any) -> bool:
        """Whether there is nothing wrong with the description."""
        return not any(description_faults(settings, self.protocol))

    def terminals(self, settings: Any) -> dict[str, Terminal]:
        """Those of the description; none while it has faults."""
        try:
            found: dict[str, Terminal] = self.described(settings).ports
        except HilError:
            return {}
        return found

    def has_watchdog(self, settings: Any) -> bool:
        """Whether the device has one."""
        return self.described(settings).watchdog is not None

    def level(self, settings: Any) -> float | None:
        """Where its watchdog puts outputs: as it was set, or as described; None where that is not always the same."""
        if (level := getattr(settings, "watchdog_level", None)) is None and self.has_watchdog(settings):
            level = self.described(settings).watchdog.expires_to
        return None if level is None else float(level)

    def watchdog_levels(self, settings: Any) -> dict[str, float]:
        """The same by terminal, of those of which it is known."""
        level = self.level(settings)
        return {} if level is None else dict.fromkeys(self.described(settings).outputs, level)

    def not_read_back(self, settings: Any) -> set[str]:
        """Outputs of which the device cannot be asked where they stand."""
        described = self.described(settings).by_name
        return {name for name, one in described.items() if one.direction == "out" and not one.is_read_back}
