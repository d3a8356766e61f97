"""What every driver keeps, as checks that run on its simulated twin or on real hardware.

Each check is a function that raises `Broken` with what was found and what was to be expected. With a twin behind
the driver, its answers can be spoiled and its outputs looked at from outside; on hardware those checks are left out.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Literal, Protocol

import numpy as np

from hil.daq.channel import OutputChannel, Wiring
from hil.daq.contract import Block, Daq, Waveform, joined
from hil.errors import HardwareError, HilError, RangeError
from hil.units import check_unit

_AGREES = 0.01  # of the range: what a protocol may round
_LONGEST_S = 5.0  # for anything that a driver does
_RATE_HZ = 50.0


class Broken(Exception):
    """A check that a driver does not pass."""


class LeftOut(Exception):
    """A check that says nothing about this driver: no output, no watchdog, no twin."""


class Behind(Protocol):
    """The field side of a twin."""

    def read(self) -> Mapping[str, float]:
        """What inputs carry, by terminal."""
        ...

    def standing(self, terminal: str) -> float:
        """Where an output stands."""
        ...


@dataclass(frozen=True, slots=True)
class Subject:
    """A driver under examination.

    Attributes:
        module: the driver.
        settings: its settings, with which the device is found.
        wiring: the channels in use.
        elsewhere: settings with which nothing is found; None on hardware.
        side, spoil: the twin's terminals, and what changes its quirks; None on hardware.
    """

    module: ModuleType
    settings: Any
    wiring: Wiring
    elsewhere: Any = None
    side: Behind | None = None
    spoil: Callable[..., None] | None = None

    @contextmanager
    def link(self) -> Iterator[Any]:
        """The bare link, opened and closed again."""
        if not hasattr(self.module, "open_link"):
            raise LeftOut("this driver times its samples by itself")
        link = self.module.open_link(self.settings, self.wiring)
        try:
            yield link
        finally:
            link.close()

    @contextmanager
    def daq(self) -> Iterator[Daq]:
        """The device as a DAQ, its outputs made safe afterwards."""
        daq = self.module.open_daq(self.settings, self.wiring)
        try:
            yield daq
        finally:
            with suppress(HardwareError):
                daq.close()

    def twin(self) -> tuple[Behind, Callable[..., None]]:
        """The twin's terminals and its quirks."""
        if self.side is None or self.spoil is None:
            raise LeftOut("real hardware cannot be spoiled")
        return self.side, self.spoil

    def output(self) -> OutputChannel:
        """The first output."""
        if not self.wiring.outputs:
            raise LeftOut("no output in use")
        return next(iter(self.wiring.outputs.values()))

    def levels(self, share: float) -> dict[str, float]:
        """By terminal, every output at a share of its range, counted from its safe value."""
        return {c.terminal: _towards(c, share) for c in self.wiring.outputs.values()}


@dataclass(frozen=True, slots=True)
class Result:
    """How a driver did in one check."""

    check: str
    meaning: str
    verdict: Literal["passed", "broken", "left out"]
    text: str = ""


Check = Callable[[Subject], None]
CHECKS: dict[str, Check] = {}


def _check(function: Check) -> Check:
    CHECKS[function.__name__] = function
    return function


def examine(subject: Subject) -> Iterator[Result]:
    """Every check, one after the other; a driver that breaks one is still asked the others."""
    for name, check in CHECKS.items():
        meaning = (check.__doc__ or "").strip().split("\n", 1)[0]
        verdict, text = verdict_of(check, subject)
        yield Result(name, meaning, verdict, text)


def verdict_of(check: Check, subject: Subject) -> tuple[Literal["passed", "broken", "left out"], str]:
    """How a driver does in one check. An error that is none of ours is a fault of the driver."""
    try:
        check(subject)
    except LeftOut as reason:
        return "left out", str(reason)
    except Broken as reason:
        return "broken", str(reason)
    except HilError as error:
        return "broken", f"raised {type(error).__name__}: {error}"
    except Exception as error:
        return "broken", f"raised {type(error).__name__}, which is no error of `hil.errors`: {error}"
    finally:
        if subject.spoil is not None:
            subject.spoil()
    return "passed", ""


@_check
def says_what_it_is(subject: Subject) -> None:
    """Its first line says what it drives; its terminals have units and ranges that make sense."""
    _expect(
        bool((subject.module.__doc__ or "").strip()), "the module has no docstring; `hil list` shows its first line"
    )
    terminals = subject.module.terminals(subject.settings)
    _expect(bool(terminals), "it offers no terminals")
    for name, terminal in terminals.items():
        check_unit(terminal.unit)
        in_order = math.isfinite(terminal.low) and math.isfinite(terminal.high) and terminal.low < terminal.high
        _expect(in_order, f"terminal '{name}' has the range {terminal.low:g} … {terminal.high:g}")
    used = [c.terminal for c in subject.wiring.outputs.values()] + [c.terminal for c in subject.wiring.inputs.values()]
    for terminal_name in used:
        _expect(terminal_name in terminals, f"no terminal '{terminal_name}'")


@_check
def says_soon_that_nobody_is_there(subject: Subject) -> None:
    """Without a device it raises a `HardwareError`, and soon."""
    if subject.elsewhere is None:
        raise LeftOut("real hardware is there")
    begun_s = time.monotonic()
    try:
        link = subject.module.open_daq(subject.elsewhere, subject.wiring)
    except HardwareError:
        taken_s = time.monotonic() - begun_s
        _expect(taken_s < _LONGEST_S, f"it took {taken_s:.1f} s to say so")
    else:
        with suppress(HardwareError):
            link.close()
        raise Broken("it opened a device where none is")


@_check
def leaves_outputs_where_they_are(subject: Subject) -> None:
    """Opening it moves no output but to its safe value, and tells where they stand."""
    with subject.daq() as daq:
        for name, channel in daq.outputs.items():
            level = daq.levels[name]
            _expect(channel.low <= level <= channel.high, f"'{name}' is told at {level:g} {channel.unit}")
            if subject.side is not None:
                stands = subject.side.standing(channel.terminal)
                _expect(_agree(channel, level, stands), f"'{name}' stands at {stands:g}, it is told at {level:g}")


@_check
def drives_what_it_is_told(subject: Subject) -> None:
    """A value that is driven stands at the device."""
    side, _ = subject.twin()
    subject.output()
    with subject.link() as link:
        for share in (0.6, 0.25, 0.0):
            told = subject.levels(share)
            link.drive(told)
            for channel in subject.wiring.outputs.values():
                _wait_until(
                    lambda channel=channel, told=told: _agree(  # type: ignore[misc]
                        channel, told[channel.terminal], side.standing(channel.terminal)
                    ),
                    f"'{channel.name}' was driven to {told[channel.terminal]:g} {channel.unit} and stands at "
                    f"{side.standing(channel.terminal):g}",
                )


@_check
def reads_what_is_there(subject: Subject) -> None:
    """A reading is what the input carries, now."""
    side, _ = subject.twin()
    if not subject.wiring.inputs:
        raise LeftOut("no input in use")
    with subject.link() as link:
        for share in (0.5, 0.0):
            told = subject.levels(share)
            if told:
                link.drive(told)
            _reads_the_truth(subject, link, side, told)


@_check
def tells_where_outputs_stand(subject: Subject) -> None:
    """What it drove it finds again, as far as the device can be asked."""
    subject.output()
    with subject.daq() as daq:
        name, channel = next(iter(daq.outputs.items()))
        level = _towards(channel, 0.5)
        list(daq.play(Waveform(_rate(daq), {name: np.full(3, level)})))
        _expect(daq.levels[name] == level, f"'{name}' was driven to {level:g} and is told at {daq.levels[name]:g}")


@_check
def one_reading_for_each_sample(subject: Subject) -> None:
    """Each sample has one reading of every input, within its range, and a stamp of its own that rises."""
    with subject.daq() as daq:
        block = _swept(daq, subject)
        for name, channel in daq.inputs.items():
            values = block.inputs[name]
            _expect(values.shape == block.time_s.shape, f"'{name}' has {len(values)} readings for {len(block)} samples")
            inside = bool(np.isfinite(values).all() and values.min() >= channel.low and values.max() <= channel.high)
            _expect(inside, f"'{name}' reads beyond its range of {channel.low:g} … {channel.high:g} {channel.unit}")
        _expect(bool((np.diff(block.time_s) > 0.0).all()), "time does not rise from sample to sample")


@_check
def keeps_the_rate(subject: Subject) -> None:
    """The actual rate is one that it has, and samples come at it."""
    with subject.daq() as daq:
        rate_hz = _rate(daq)
        _expect(daq.actual_rate_hz(rate_hz) == rate_hz, "the actual rate is no rate that it has")
        with _refused("a rate that it does not have"):
            daq.actual_rate_hz(1e3 * daq.promises.highest_rate_hz)
        block = _swept(daq, subject)
        took_s = float(block.time_s[-1] - block.time_s[0])
        asked_s = (len(block) - 1) / rate_hz
        _expect(abs(took_s - asked_s) < 0.25 * asked_s + 0.1, f"{asked_s:.2f} s of samples took {took_s:.2f} s")


@_check
def says_how_late_its_readings_are(subject: Subject) -> None:
    """A polled link has measured itself: latency, and a delay for each input."""
    with subject.daq() as daq:
        promises = daq.promises
        if promises.timing != "polled":
            raise LeftOut("this driver times its samples by itself")
        _swept(daq, subject)
        delays = daq.promises.sampling(daq.inputs, _RATE_HZ)["delay_s"]
        for name in daq.inputs:
            _expect(delays[name] != 0.0, f"no delay is known for '{name}'")
        _expect(not daq.inputs or (daq.promises.latency_s or 0.0) > 0.0, "no latency is known")


@_check
def refuses_a_range_before_the_first_sample(subject: Subject) -> None:
    """A sample beyond the range is refused before anything is driven."""
    subject.output()
    with subject.daq() as daq:
        name, channel = next(iter(daq.outputs.items()))
        before = daq.levels[name]
        beyond = np.append(np.full(3, channel.safe), channel.high + 0.01 * (channel.high - channel.low))
        with _refused(f"{beyond[-1]:g} {channel.unit}"):
            list(daq.play(Waveform(_rate(daq), {name: beyond})))
        _expect(daq.levels[name] == before, "an output moved")


@_check
def goes_safe_at_once_and_again(subject: Subject) -> None:
    """In the middle of a task every output goes to its safe value, and the call may be repeated."""
    subject.output()
    with subject.daq() as daq:
        rate_hz = _rate(daq)
        blocks = daq.play(Waveform(rate_hz, _far(daq, max(4, round(2.0 * rate_hz)))), 1)
        next(blocks)
        for _ in range(2):
            daq.make_safe()
            _is_safe(subject, daq)
        time.sleep(3.0 / rate_hz)
        _is_safe(subject, daq)


@_check
def closes_safe_and_twice(subject: Subject) -> None:
    """Closing leaves every output safe, and may be repeated."""
    subject.output()
    with subject.daq() as daq:
        list(daq.play(Waveform(_rate(daq), _far(daq, 2))))
        daq.close()
        daq.close()
        _is_safe(subject, daq)


@_check
def says_that_no_answer_came(subject: Subject) -> None:
    """An answer that does not come is a `HardwareError`, soon, and the next one is right."""
    _spoiled(subject, silent=True)


@_check
def never_takes_a_late_answer_for_the_next(subject: Subject) -> None:
    """An answer that comes too late is an error, and is not given to the next question."""
    _spoiled(subject, late_s=1.5 * _timeout_s(subject))


@_check
def does_not_believe_half_an_answer(subject: Subject) -> None:
    """An answer that breaks off is an error, and the next one is right."""
    _spoiled(subject, cut=True)


@_check
def survives_garbled_answers(subject: Subject) -> None:
    """Flipped bits raise nothing but errors of `hil.errors`, and afterwards it reads what is there."""
    side, spoil = subject.twin()
    if not subject.wiring.inputs:
        raise LeftOut("no input in use")
    with subject.link() as link:
        for _ in range(3):
            spoil(garbled=True, answers=1)
            with suppress(HardwareError):
                link.read()
        spoil()
        _recovered(subject, link, side, {})


@_check
def notices_that_the_device_restarted(subject: Subject) -> None:
    """A device that restarts, its outputs elsewhere than they were driven, is an error within two seconds."""
    side, spoil = subject.twin()
    channel = subject.output()
    with subject.daq() as daq:
        rate_hz = _rate(daq)
        far = _far(daq, round(2.0 * rate_hz))
        blocks = daq.play(Waveform(rate_hz, far), 1)
        next(blocks)
        spoil(reboot=True, answers=1)
        try:
            for _ in blocks:
                pass
        except HardwareError:
            return
        driven = far[next(iter(far))][-1]
        if not _agree(channel, driven, side.standing(channel.terminal)):
            raise Broken(f"'{channel.name}' stands at {side.standing(channel.terminal):g}, and nothing was said")


@_check
def has_the_watchdog_that_it_promises(subject: Subject) -> None:
    """Left alone for longer than its watchdog, the device makes its outputs safe, and the driver says so."""
    side, _ = subject.twin()
    channel = subject.output()
    with subject.link() as link:
        if link.watchdog_s is None:
            raise LeftOut("it promises none")
        if link.watchdog_s > _LONGEST_S:
            raise LeftOut(f"{link.watchdog_s:g} s are too long to wait for")
        link.drive(subject.levels(0.5))
        time.sleep(1.5 * link.watchdog_s + 0.05)
        stands = side.standing(channel.terminal)
        _expect(_agree(channel, 0.0, stands), f"'{channel.name}' still stands at {stands:g} {channel.unit}")
        try:
            link.read()
        except HardwareError:
            return
        raise Broken("the device made its outputs safe, and the next reading says nothing about it")


def _spoiled(subject: Subject, **quirk: Any) -> None:
    """One answer is spoiled: an error, soon; then the truth again."""
    side, spoil = subject.twin()
    if not subject.wiring.inputs:
        raise LeftOut("no input in use")
    with subject.link() as link:
        if told := subject.levels(0.5):
            link.drive(told)
            _reads_the_truth(subject, link, side, told)
        spoil(**quirk)
        begun_s = time.monotonic()
        patience_s = 0.0 if _age_s(link) == 0.0 else 3.0 * _timeout_s(subject)
        try:
            link.read()
            while time.monotonic() - begun_s < patience_s:  # what the device told before may still be good
                link.read()
                time.sleep(0.01)
        except HardwareError:
            taken_s = time.monotonic() - begun_s
            _expect(taken_s < _LONGEST_S, f"it took {taken_s:.1f} s to say so")
        else:
            raise Broken("the answer was spoiled, and a reading came nevertheless")
        spoil()
        if told := subject.levels(0.1):
            link.drive(told)
        _recovered(subject, link, side, told)


def _recovered(subject: Subject, link: Any, side: Behind, told: Mapping[str, float]) -> None:
    try:
        _reads_the_truth(subject, link, side, told)
    except HardwareError as error:
        raise Broken(f"one spoiled answer, and the next reading fails too: {error}") from None


def _reads_the_truth(subject: Subject, link: Any, side: Behind, told: Mapping[str, float]) -> None:
    """What is read lies within what is there at the moment, or was there when a message of that age was sent."""
    time.sleep(0.01)
    for _ in range(1 if _age_s(link) else 2):  # the second time finds an answer that is one behind
        there = [side.read()]
        until_s = time.monotonic() + 8.0 * _age_s(link)
        while time.monotonic() < until_s:
            if told:
                link.drive(told)
            time.sleep(0.02)
            there.append(side.read())
        read = link.read()
        there.append(side.read())
        for channel in subject.wiring.inputs.values():
            place, allowed = channel.terminal, _AGREES * (channel.high - channel.low)
            low, high = (f(values[place] for values in there) for f in (min, max))
            _expect(
                max(channel.low, low) - allowed <= read[place] <= min(channel.high, high) + allowed,
                f"'{channel.name}' reads {read[place]:g}, and {there[-1][place]:g} {channel.unit} is there",
            )


def _age_s(link: Any) -> float:
    return float(getattr(link, "reading_age_s", 0.0))


def _swept(daq: Daq, subject: Subject) -> Block:
    rate_hz = _rate(daq)
    if not subject.wiring.outputs:
        raise LeftOut("a device without outputs is played together with one that has some")
    samples = 15
    values = {n: np.linspace(c.safe, _towards(c, 0.3), samples) for n, c in daq.outputs.items()}
    return joined(list(daq.play(Waveform(rate_hz, values), 4)))


def _far(daq: Daq, samples: int) -> dict[str, Any]:
    return {name: np.full(samples, _towards(channel, 0.5)) for name, channel in daq.outputs.items()}


def _towards(channel: OutputChannel, share: float) -> float:
    """So far from safe towards the farther end of the range; below zero to the other side."""
    up = channel.high - channel.safe >= channel.safe - channel.low
    span = channel.high - channel.safe if up == (share >= 0.0) else channel.safe - channel.low
    return channel.safe + (abs(share) * span if up == (share >= 0.0) else -abs(share) * span)


def _is_safe(subject: Subject, daq: Daq) -> None:
    for name, channel in daq.outputs.items():
        _expect(daq.levels[name] == channel.safe, f"'{name}' is told at {daq.levels[name]:g}, not at its safe value")
        if subject.side is not None:
            side = subject.side
            _wait_until(
                lambda c=channel, side=side: _agree(c, c.safe, side.standing(c.terminal)),  # type: ignore[misc]
                f"'{name}' stands at {side.standing(channel.terminal):g}, not at its safe value {channel.safe:g}",
            )


def _wait_until(true: Callable[[], bool], otherwise: str, longest_s: float = 0.3) -> None:
    """What is not acknowledged takes a moment to arrive."""
    until_s = time.monotonic() + longest_s
    while not true():
        if time.monotonic() > until_s:
            raise Broken(otherwise)
        time.sleep(0.005)


def _agree(channel: OutputChannel, one: float, other: float) -> bool:
    return abs(one - other) <= _AGREES * (channel.high - channel.low)


def _rate(daq: Daq) -> float:
    return daq.actual_rate_hz(min(_RATE_HZ, daq.promises.highest_rate_hz))


def _timeout_s(subject: Subject) -> float:
    return float(getattr(subject.settings, "timeout_s", 0.2))


@contextmanager
def _refused(what: str) -> Iterator[None]:
    try:
        yield
    except RangeError:
        return
    raise Broken(f"{what} is not refused with a RangeError")


def _expect(true: bool, otherwise: str) -> None:
    if not true:
        raise Broken(otherwise)
