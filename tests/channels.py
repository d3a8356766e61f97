"""Channels of a device, by the terminals to which they are connected: all of them with one unit and one range."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from hil.daq.channel import InputChannel, Kind, OutputChannel

Terminals = Mapping[str, str] | Iterable[str]
"""By the names of their channels; a terminal alone gives its channel its name."""
_KINDS: Mapping[str, Kind] = {"V": "voltage", "A": "current", "1": "digital"}


def outputs(
    terminals: Terminals, unit: str = "V", low: float = -10.0, high: float = 10.0, safe: float = 0.0
) -> dict[str, OutputChannel]:
    """What is driven."""
    return {name: OutputChannel(name, terminal, _KINDS.get(unit, "value"), unit, low, high, safe)
            for name, terminal in _named(terminals)}  # fmt: skip


def inputs(terminals: Terminals, unit: str = "V", low: float = -10.0, high: float = 10.0) -> dict[str, InputChannel]:
    """What is read."""
    return {name: InputChannel(name, terminal, _KINDS.get(unit, "value"), unit, low, high)
            for name, terminal in _named(terminals)}  # fmt: skip


def _named(terminals: Terminals) -> Iterable[tuple[str, str]]:
    return terminals.items() if isinstance(terminals, Mapping) else [(one, one) for one in terminals]
