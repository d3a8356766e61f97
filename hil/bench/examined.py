"""A device of a bench as the conformance checks want it: how far it may be driven, and what sees where it stands."""

from __future__ import annotations

from collections.abc import Mapping

from hil.bench.file import ChannelEntry
from hil.bench.read import BenchFile
from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.conformance import Subject, Witness
from hil.errors import SettingError, UnknownNameError

_WITHIN = 0.01  # of either range: what a witness may be off, calibration and noise together


def examined_device(file: BenchFile, name: str, reach: float, measured_by: Mapping[str, str]) -> Subject:
    """A device with the limits, safe values and instruments of its bench.

    Raises:
        SettingError: an input cannot measure an output, for want of a common unit.
        UnknownNameError: a channel that the bench does not have.
    """
    device, channels = file.devices[name], file.bench.channels
    wiring = device.wiring(channels)
    room = {output: _room(file, output, channel) for output, channel in wiring.outputs.items()}
    slew = {output: slew for output in wiring.outputs if (slew := _slew(file, output)) is not None}
    responses = tuple(input_ for input_ in wiring.inputs if channels[input_].role == "response")
    witnesses = {
        output: _witness(file, name, output, channel, measured_by[output])
        for output, channel in wiring.outputs.items()
        if output in measured_by
    }
    if unknown := set(measured_by) - set(witnesses):
        raise UnknownNameError(f"output of device '{name}'", min(unknown), wiring.outputs)
    return Subject(
        device.module, device.settings, wiring, room=room, slew_per_s=slew, reach=reach, witnesses=witnesses,
        responses=responses, settling_s=file.bench.valve.settling_s,
    )  # fmt: skip


def _room(file: BenchFile, output: str, channel: OutputChannel) -> tuple[float, float]:
    """How far it may go, raw: within its range, its limits, and for the command those of the valve."""
    low, high = channel.low, channel.high
    entry = file.bench.channels[output]
    for limits in (entry.limits, file.bench.valve.limits if entry.role == "command" else None):
        if limits is not None:
            ends = sorted(entry.line.raw_at(end) for end in (limits.low, limits.high))
            low, high = max(low, ends[0]), min(high, ends[1])
    return low, high


def _slew(file: BenchFile, output: str) -> float | None:
    entry = file.bench.channels[output]
    both = (entry.limits, file.bench.valve.limits if entry.role == "command" else None)
    slews = [limits.slew_per_s for limits in both if limits is not None and limits.slew_per_s is not None]
    return min(slews) / abs(entry.line.slope) if slews else None


def _witness(file: BenchFile, examined: str, output: str, channel: OutputChannel, input_: str) -> Witness:
    if input_ not in file.bench.channels or file.bench.channels[input_].is_output:
        inputs = [name for name, entry in file.bench.channels.items() if not entry.is_output]
        raise UnknownNameError("input", input_, inputs)
    theirs, ours = file.bench.channels[input_], file.bench.channels[output]
    device = file.devices[theirs.device]
    wiring = device.wiring(file.bench.channels)
    seen = wiring.inputs[input_]
    slope, offset = _line(output, ours, channel, input_, theirs, seen)
    allowed = _WITHIN * max(seen.high - seen.low, abs(slope) * (channel.high - channel.low))
    own = theirs.device == examined
    return Witness(
        seen, lambda raw: slope * raw + offset, allowed,
        None if own else device.module, None if own else device.settings, None if own else wiring,
    )  # fmt: skip


def _line(
    output: str, ours: ChannelEntry, channel: OutputChannel, input_: str, theirs: ChannelEntry, seen: InputChannel
) -> tuple[float, float]:
    """What the input reads for what the output drives, both raw: the same quantity, or one terminal on the other."""
    if ours.unit == theirs.unit:
        to, of = ours.line, theirs.line
        return to.slope / of.slope, (to.offset - of.offset) / of.slope
    if channel.unit == seen.unit:
        return 1.0, 0.0
    raise SettingError(
        f"'{input_}' [{theirs.unit}, at its terminal {seen.unit}] cannot measure '{output}' [{ours.unit}, at its "
        f"terminal {channel.unit}]: one of the two units must be the same"
    )
