"""Whether the interlocks of a bench file can do what they say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hil.bench.device import DeviceInUse
from hil.bench.draft import Draft
from hil.bench.fault import Fault
from hil.bench.file import InterlockEntry
from hil.bench.lines import Place


def interlock_faults(
    name: str, interlock: InterlockEntry, draft: Draft, devices: Mapping[str, DeviceInUse]
) -> Iterator[Fault]:
    """Everything that is wrong with one interlock."""
    place = ("interlocks", name)
    yield from known_channel((*place, "channel"), interlock.channel, draft)
    if interlock.minus:
        yield from known_channel((*place, "minus"), interlock.minus, draft)
    if interlock.only_while is not None:
        yield from known_channel((*place, "only_while", "channel"), interlock.only_while.channel, draft)
    if interlock.low is not None and interlock.high is not None and interlock.low >= interlock.high:
        yield Fault((*place, "low"), f"{interlock.low:g} must be below high = {interlock.high:g}")
    yield from _reach(place, interlock, draft, devices)


def known_channel(place: Place, name: str, draft: Draft) -> Iterator[Fault]:
    """A channel that is named exists."""
    if name not in draft.channels and ("channels", name) not in draft.faulty:
        yield Fault(place, f"no channel '{name}'; there are: {', '.join(draft.channels)}")


def _reach(
    place: Place, interlock: InterlockEntry, draft: Draft, devices: Mapping[str, DeviceInUse]
) -> Iterator[Fault]:
    """Whether its limits lie within what the channel can read; beyond, it could never act, or always."""
    channel = draft.channels.get(interlock.channel)
    device = devices.get(channel.device) if channel else None
    if channel is None or device is None or channel.terminal not in device.terminals:
        return
    terminal = device.terminals[channel.terminal]
    raw = channel.raw_range(terminal)
    asked = [("raw_low", raw, terminal.unit), ("raw_high", raw, terminal.unit)]
    if not interlock.minus:
        read = channel.range_at(terminal)
        asked += [("low", read, channel.unit), ("high", read, channel.unit)]
    for key, (low, high), unit in asked:
        value = getattr(interlock, key)
        if value is not None and not low < value < high:
            yield Fault(
                (*place, key),
                f"{value:g} {unit} is not within what '{interlock.channel}' reads, {low:g} … {high:g} {unit}: the "
                f"interlock would never act, or always",
            )
