"""Outputs without limits, inputs that nobody watches."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator

from hil.bench.file import ChannelEntry
from hil.bench.protection import interlock_of
from hil.bench.read import BenchFile
from hil.daq.channel import Terminal

_LEAST, _MOST = 0.03, 0.3  # of a voltage range: 0.5 of 10 V … 1 of 5 V, 2.5 of 10 V; beyond it is an offset


def without_limits(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Outputs that may go anywhere; a digital line has but two places."""
    for name, channel in file.bench.channels.items():
        if channel.is_output and channel.limits is None and file.terminal_of(channel).kind != "digital":
            yield (
                f"channel '{name}': an output without limits may use the whole range of its terminal: say limits = "
                f"{{ low = …, high = … }}"
            )


def without_interlocks(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """A bench on which nothing stops a run."""
    if not file.bench.interlocks:
        yield "no interlocks: nothing watches the bench but the limits of its outputs: say [interlocks.NAME]"
    elif all(entry.action == "indicate" for entry in file.bench.interlocks.values()):
        yield (
            "every interlock only indicates: nothing stops a run but the limits of its outputs: give one action = "
            '"stop" or "trip"'
        )


def live_zeros(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Transmitters whose broken wire is taken for a reading (4 … 20 mA, 1 … 5 V): no interlock acts on it."""
    for name, channel in file.bench.channels.items():
        terminal = file.terminal_of(channel)
        if not channel.is_output and has_live_zero(channel, terminal) and not _is_noticed(file, name):
            dead = channel.line.value_at(0.0)
            yield (
                f"channel '{name}': its zero is at {zero_of(channel):.3g} {terminal.unit}, so that a broken wire reads "
                f"{dead:g} {channel.unit} and no interlock acts on that: give it one with raw_low = "
                f'{0.9 * zero_of(channel):.2g} and action = "stop"'
            )


def has_live_zero(channel: ChannelEntry, terminal: Terminal) -> bool:
    """Whether the quantity is zero where the terminal is not: a reading near the terminal's zero is a broken wire."""
    low, high = channel.raw_range(terminal)
    share = zero_of(channel) / high if high > 0.0 else 0.0
    if terminal.kind == "current":
        return low <= 0.0 and _LEAST <= share <= 1.0
    return terminal.kind == "voltage" and low <= 0.0 and _LEAST <= share <= _MOST


def zero_of(channel: ChannelEntry) -> float:
    """Where the quantity is zero, in the terminal's unit."""
    return channel.line.raw_at(0.0)


def _is_noticed(file: BenchFile, name: str) -> bool:
    """Whether an interlock acts when the channel reads what a broken wire does."""
    dead = file.bench.channels[name].line.value_at(0.0)
    for key, entry in file.bench.interlocks.items():
        if entry.channel != name or entry.minus or entry.only_while or entry.action == "indicate":
            continue
        allowed = interlock_of(key, entry, file.bench).allowed
        if not allowed.low <= dead <= allowed.high:
            return True
    return False
