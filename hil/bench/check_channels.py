"""Whether the channels of a bench file fit their devices, and their limits what the devices give."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hil.bench.check_interlocks import known_channel
from hil.bench.device import DeviceInUse
from hil.bench.draft import Draft
from hil.bench.fault import Fault
from hil.bench.file import CONDITIONS, EMERGENCY_STOP, SET_BY_HAND, ChannelEntry
from hil.daq.channel import Terminal
from hil.errors import HilError
from hil.units import check_unit


def channel_faults(
    name: str, channel: ChannelEntry, draft: Draft, devices: Mapping[str, DeviceInUse]
) -> Iterator[Fault]:
    """Everything that is wrong with one channel."""
    yield from _unit(name, channel)
    yield from _dates(name, channel)
    yield from _limits(name, channel)
    yield from _witness(name, channel, draft)
    if channel.by_hand is not None and (channel.is_output or channel.role not in SET_BY_HAND):
        text = f"only an input has this, one with a role that is adjusted: {', '.join(SET_BY_HAND)}"
        yield Fault(("channels", name, "by_hand"), text)
    yield from _connection(name, channel, draft, devices)


def terminals_used_once(draft: Draft) -> Iterator[Fault]:
    """A terminal carries one channel."""
    users: dict[tuple[str, str], str] = {}
    for name, channel in draft.channels.items():
        first = users.setdefault((channel.device, channel.terminal), name)
        if first != name:
            yield Fault(("channels", name, "terminal"), f"'{channel.terminal}' carries '{first}' already")


def _unit(name: str, channel: ChannelEntry) -> Iterator[Fault]:
    if name == "time":
        yield Fault(("channels", name), "no channel is called time; that is the time of the samples")
    try:
        check_unit(channel.unit)
    except HilError as error:
        yield Fault(("channels", name, "unit"), str(error))


def emergency_stop_faults(
    name: str, channel: ChannelEntry, draft: Draft, devices: Mapping[str, DeviceInUse]
) -> Iterator[Fault]:
    """Whether the contact of an emergency stop can be told open from closed."""
    place = ("channels", name)
    if channel.role != EMERGENCY_STOP:
        if channel.pressed_below is not None:
            yield Fault((*place, "pressed_below"), f'only a channel with role = "{EMERGENCY_STOP}" has this')
        return
    if channel.is_output:
        yield Fault((*place, "role"), "an emergency stop is an input, without a safe value: its feedback contact")
    if name in draft.interlocks:
        yield Fault(("interlocks", name), f"'{name}' is an emergency stop, which trips by itself; name this otherwise")
    device = devices.get(channel.device)
    if device is None or channel.terminal not in device.terminals:
        return
    terminal = device.terminals[channel.terminal]
    low, high = channel.range_at(terminal)
    if channel.pressed_below is None and terminal.kind != "digital":
        yield Fault(
            place, f"{channel.terminal} is no digital line: say pressed_below = …, in {channel.unit}, halfway between "
            "the contact open and closed",
        )  # fmt: skip
    elif not low < channel.open_below < high:
        yield Fault(
            (*place, "pressed_below"), f"{channel.open_below:g} {channel.unit} is not within what '{name}' reads, "
            f"{low:g} … {high:g} {channel.unit}: the stop would never be seen, or always",
        )  # fmt: skip


def _dates(name: str, channel: ChannelEntry) -> Iterator[Fault]:
    made = channel.calibration
    if made is not None and made.date is not None and made.due is not None and made.due < made.date:
        yield Fault(("channels", name, "calibration", "due"), f"{made.due} lies before date = {made.date}")


def _limits(name: str, channel: ChannelEntry) -> Iterator[Fault]:
    place = ("channels", name)
    if not channel.is_output:
        for key in ("on", "limits", "ramp_to_safe_per_s", "pwm", "witness"):
            if getattr(channel, key) is not None:
                yield Fault(
                    (*place, key), "only an output has this; give the channel its safe value, or take this away"
                )
        return
    limits, safe, ramp = channel.limits, channel.safe or 0.0, channel.ramp_to_safe_per_s
    if limits is None:
        return
    for key, value in (("safe", safe), ("on", channel.on)):
        if value is not None and not limits.low <= value <= limits.high:
            text = f"{value:g} {channel.unit} is outside the limits {limits.low:g} … {limits.high:g}"
            yield Fault((*place, key), text)
    if ramp is not None and limits.slew_per_s is not None and ramp > limits.slew_per_s:
        yield Fault(
            (*place, "ramp_to_safe_per_s"), f"{ramp:g} is faster than limits.slew_per_s = {limits.slew_per_s:g}"
        )


def _witness(name: str, channel: ChannelEntry, draft: Draft) -> Iterator[Fault]:
    """Whether the witness of an output is an input."""
    place = ("channels", name)
    if channel.is_output and channel.role not in CONDITIONS and channel.settles_s is not None:
        yield Fault(
            (*place, "settles_s"),
            "only an input that is the witness of an output has this, or an output that procedures adjust",
        )
    if not channel.is_output or channel.witness is None:
        return
    yield from known_channel((*place, "witness"), channel.witness, draft)
    by = draft.channels.get(channel.witness)
    if by is not None and by.is_output:
        yield Fault((*place, "witness"), f"'{channel.witness}' is an output; name an input that answers to '{name}'")


def _connection(name: str, channel: ChannelEntry, draft: Draft, devices: Mapping[str, DeviceInUse]) -> Iterator[Fault]:
    place = ("channels", name)
    if channel.device not in draft.devices and ("devices", channel.device) not in draft.faulty:
        known = ", ".join(draft.devices) or "none"
        yield Fault((*place, "device"), f"no device '{channel.device}'; there are: {known}")
        return
    device = devices.get(channel.device)
    if device is None:
        return  # its own faults are told
    if channel.terminal not in device.terminals:
        known = ", ".join(device.terminals)
        yield Fault((*place, "terminal"), f"device '{channel.device}' has no '{channel.terminal}'; it has: {known}")
        return
    terminal = device.terminals[channel.terminal]
    yield from _direction(name, channel, terminal)
    yield from _scale(name, channel, terminal)
    yield from _reach(name, channel, terminal)


def _direction(name: str, channel: ChannelEntry, terminal: Terminal) -> Iterator[Fault]:
    place = ("channels", name)
    if terminal.direction == "out" and not channel.is_output:
        yield Fault((*place, "terminal"), f"{channel.terminal} is an output: say where it is safe: safe = …")
    if terminal.direction == "in" and channel.is_output:
        yield Fault((*place, "terminal"), f"{channel.terminal} is an input; an input has no safe value")
    if channel.pwm is not None and terminal.kind != "pwm_current":
        yield Fault(
            (*place, "pwm"), f"{channel.terminal} is a {terminal.kind} output; only PWM current outputs have it"
        )
    if channel.pwm is None and terminal.kind == "pwm_current":
        yield Fault(place, f"{channel.terminal} is a PWM current output: say pwm = {{ carrier_hz = … }}")


def _scale(name: str, channel: ChannelEntry, terminal: Terminal) -> Iterator[Fault]:
    if channel.calibration is None and channel.unit != terminal.unit:
        yield Fault(
            ("channels", name, "unit"),
            f"{channel.terminal} gives {terminal.unit}; for {channel.unit} say calibration = {{ slope = … }}, in "
            f"{channel.unit} per {terminal.unit}",
        )


def _reach(name: str, channel: ChannelEntry, terminal: Terminal) -> Iterator[Fault]:
    """Whether what is asked of a channel lies within what its terminal can give or take."""
    place = ("channels", name)
    low, high = channel.raw_range(terminal)
    if not terminal.low <= low < high <= terminal.high:
        yield Fault(
            (*place, "range"), f"{low:g} … {high:g} {terminal.unit} is not within {terminal.low:g} … {terminal.high:g}"
        )
        return
    asked = {(key,): value for key, value in (("safe", channel.safe), ("on", channel.on)) if value is not None}
    if channel.limits is not None:
        asked |= {("limits", "low"): channel.limits.low, ("limits", "high"): channel.limits.high}  # type: ignore[dict-item]
    for key, value in asked.items():
        raw = channel.line.raw_at(value)
        if not low - 1e-9 <= raw <= high + 1e-9:
            yield Fault(
                (*place, *key),
                f"{value:g} {channel.unit} needs {raw:g} {terminal.unit}; {channel.terminal} gives {low:g} … {high:g} "
                f"{terminal.unit}: lower it, or correct the calibration",
            )
