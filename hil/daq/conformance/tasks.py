"""What a device keeps as a DAQ: readings, rate, delays, ranges, and the ways to its safe values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from hil.daq.channel import OutputChannel
from hil.daq.conformance.subject import SOON_S, Broken, LeftOut, Subject, agree, expect
from hil.daq.contract import Block, Daq, Waveform, joined
from hil.errors import RangeError
from hil.record.recording import Array
from hil.system import system

_RATE_HZ = 50.0
_TRIES = 10


def tells_where_outputs_stand(subject: Subject) -> None:
    """Where it says that outputs stand after a task, they stand."""
    _ = subject.outputs
    with subject.daq() as daq:
        list(daq.play(Waveform(rate_of(daq), far(subject, daq, 3))))
        for name, channel in daq.outputs.items():
            level, reported = subject.towards(channel, 0.5), daq.levels[name]
            expect(agree(channel, reported, level), f"'{name}' was driven to {level:g} and is told at {reported:g}")
            _stands(subject, daq, name, level)


def one_reading_for_each_sample(subject: Subject) -> None:
    """Each sample has one reading of every input, within its range, and a stamp of its own that rises."""
    with subject.daq() as daq:
        block = _swept(daq, subject)
        for name, channel in daq.inputs.items():
            values = block.inputs[name]
            expect(values.shape == block.time_s.shape, f"'{name}' has {len(values)} readings for {len(block)} samples")
            inside = bool(np.isfinite(values).all() and values.min() >= channel.low and values.max() <= channel.high)
            expect(inside, f"'{name}' reads beyond its range of {channel.low:g} … {channel.high:g} {channel.unit}")
        expect(bool((np.diff(block.time_s) > 0.0).all()), "time does not rise from sample to sample")


def keeps_the_rate(subject: Subject) -> None:
    """The actual rate is one that it has, and samples come at it."""
    with subject.daq() as daq:
        rate_hz = rate_of(daq)
        expect(daq.actual_rate_hz(rate_hz) == rate_hz, "the actual rate is no rate that it has")
        with _refused("a rate that it does not have"):
            daq.actual_rate_hz(1e3 * daq.promises.highest_rate_hz)
        for _ in range(_TRIES):  # a computer that was busy elsewhere is no fault of a driver
            block = _swept(daq, subject)
            took_s = float(block.time_s[-1] - block.time_s[0])
            asked_s = (len(block) - 1) / rate_hz
            if keeps := abs(took_s - asked_s) < 0.25 * asked_s + 0.1:
                break
        expect(keeps, f"{asked_s:.2f} s of samples took {took_s:.2f} s, in each of {_TRIES} tries")


def says_how_late_its_readings_are(subject: Subject) -> None:
    """A polled link has measured itself: latency, and a delay for each input."""
    with subject.daq() as daq:
        promises = daq.promises
        if promises.timing != "polled":
            raise LeftOut("this driver times its samples by itself")
        _swept(daq, subject)
        delays = daq.promises.sampling(daq.inputs, _RATE_HZ)["delay_s"]
        for name in daq.inputs:
            expect(delays[name] != 0.0, f"no delay is known for '{name}'")
        expect(not daq.inputs or (daq.promises.latency_s or 0.0) > 0.0, "no latency is known")


def refuses_a_range_before_the_first_sample(subject: Subject) -> None:
    """A sample beyond the range is refused before anything is driven."""
    _ = subject.outputs
    with subject.daq() as daq:
        name, channel = next(iter(daq.outputs.items()))
        before = daq.levels[name]
        beyond = np.append(np.full(3, channel.safe), channel.high + 0.01 * (channel.high - channel.low))
        with _refused(f"{beyond[-1]:g} {channel.unit}"):
            list(daq.play(Waveform(rate_of(daq), {name: beyond})))
        expect(daq.levels[name] == before, "an output moved")


def goes_safe_immediately_and_again(subject: Subject) -> None:
    """In the middle of a task every output goes to its safe value, and the call may be repeated."""
    _ = subject.outputs
    with subject.daq() as daq:
        rate_hz = rate_of(daq)
        blocks = daq.play(Waveform(rate_hz, far(subject, daq, max(4, round(2.0 * rate_hz)))), 1)
        next(blocks)
        for _ in range(2):
            daq.make_safe()
            _is_safe(subject, daq)
        system.sleep(3.0 / rate_hz)
        _is_safe(subject, daq)


def closes_safe_and_twice(subject: Subject) -> None:
    """Closing leaves every output safe, as a link that is opened anew finds, and may be repeated."""
    _ = subject.outputs
    with subject.daq() as daq:
        list(daq.play(Waveform(rate_of(daq), far(subject, daq, 2))))
        daq.close()
        daq.close()
        _is_safe(subject, daq)
    found = subject.asked_anew() if subject.side is None else {}
    for channel in subject.outputs if found else ():
        at = found[channel.terminal]
        expect(agree(channel, at, channel.safe), f"'{channel.name}' was left at {at:.4g} {channel.unit}, not safe")


def rate_of(daq: Daq) -> float:
    """A rate that every driver can be asked for."""
    return daq.actual_rate_hz(min(_RATE_HZ, daq.promises.highest_rate_hz))


def far(subject: Subject, daq: Daq, samples: int) -> dict[str, Any]:
    """So many samples half way to the limits, after a ramp where an output may not jump."""
    ramps = [
        abs(subject.towards(c, 0.5) - c.safe) / subject.slew_per_s[name] * rate_of(daq)
        for name, c in daq.outputs.items()
        if name in subject.slew_per_s
    ]
    ramp = np.linspace(0.0, 1.0, 2 + math.ceil(max(ramps, default=0.0)))[1:-1]
    shares = np.append(ramp, np.ones(samples))
    return {name: _path(c, subject.towards(c, 0.5), shares) for name, c in daq.outputs.items()}


def _swept(daq: Daq, subject: Subject) -> Block:
    if not subject.wiring.outputs:
        raise LeftOut("a device without outputs is played together with one that has some")
    samples = 15
    shares = np.linspace(0.0, 1.0, samples)
    values = {name: _path(c, subject.towards(c, 0.1), shares) for name, c in daq.outputs.items()}
    return joined(list(daq.play(Waveform(rate_of(daq), values), 4)))


def _path(channel: OutputChannel, target: float, shares: Array) -> Array:
    """From the safe value to a target; a line is there at once."""
    return channel.safe + (np.ones_like(shares) if channel.kind == "digital" else shares) * (target - channel.safe)


def _is_safe(subject: Subject, daq: Daq) -> None:
    for name, channel in daq.outputs.items():
        expect(daq.levels[name] == channel.safe, f"'{name}' is told at {daq.levels[name]:g}, not at its safe value")
        _stands(subject, daq, name, channel.safe)


def _stands(subject: Subject, daq: Daq, name: str, level: float) -> None:
    """An output is where it should be, as its twin shows or its device says, where it can be asked."""
    channel, until_s = daq.outputs[name], system.now_s() + SOON_S
    while (at := _seen(subject, daq, name)) is not None and not agree(channel, at, level):
        expect(system.now_s() < until_s, f"'{name}' stands at {at:.4g} {channel.unit}, not at {level:.4g}")
        system.sleep(0.005)


def _seen(subject: Subject, daq: Daq, name: str) -> float | None:
    if subject.side is not None:
        return subject.side.standing(daq.outputs[name].terminal)
    return daq.read_back()[name].at


@contextmanager
def _refused(what: str) -> Iterator[None]:
    try:
        yield
    except RangeError:
        return
    raise Broken(f"{what} is not refused with a RangeError")
