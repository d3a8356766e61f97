"""A driver under examination: how it is opened, how far its outputs may go, and how one sees where they stand."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, Protocol

from hil.daq.channel import InputChannel, OutputChannel, Wiring
from hil.daq.contract import Daq
from hil.daq.pin import Pin
from hil.errors import HardwareError
from hil.system import system

AGREES = 0.005  # of an output's range: what a protocol may round
SOON_S = 1.0  # within which an output stands where it was driven, on a computer that is busy too
_STEP_S = 0.02  # of an output that may not jump


class Broken(Exception):
    """A check that a driver does not pass."""


class LeftOut(Exception):
    """A check that says nothing about this driver: no output, no watchdog, no twin, nothing that could tell."""


class Behind(Protocol):
    """The field side of a twin."""

    def read(self) -> Mapping[str, float]:
        """What inputs carry, by terminal."""
        ...

    def standing(self, terminal: str) -> float:
        """Where an output stands."""
        ...


@dataclass(frozen=True, slots=True)
class Witness:
    """An input that measures an output: wired to it, or an instrument for the same quantity.

    Attributes:
        channel: the input.
        module, settings, wiring: the device that it is on; `module` is None for the device under examination.
        expected: from the output's raw value to what the input reads, raw.
        allowed: how far a reading may lie from that.
    """

    channel: InputChannel
    expected: Callable[[float], float]
    allowed: float
    module: ModuleType | None = None
    settings: Any = None
    wiring: Wiring | None = None

    @contextmanager
    def readings(self, own: Any) -> Iterator[Callable[[], float]]:
        """What reads it, over the link `own` or one to its own device."""
        if self.module is None:
            yield lambda: float(own.read()[self.channel.terminal])
            return
        link = self.module.open_link(self.settings, self.wiring)
        try:
            yield lambda: float(link.read()[self.channel.terminal])
        finally:
            link.close()


@dataclass(frozen=True, slots=True)
class Subject:
    """A driver under examination.

    Attributes:
        module: the driver.
        settings: its settings, with which the device is found.
        wiring: the channels in use.
        another_address: settings with which nothing is found; None on hardware.
        side, spoil: the twin's terminals, and what changes its quirks; None on hardware.
        room: by output, how far it may go (raw); its range where nothing is said.
        slew_per_s: by output, how fast it may go there (raw); where nothing is said it may jump.
        reach: the share of that room that is used.
        witnesses: by output, the input that measures it.
        responses: inputs that answer to the outputs in a way that is not known beforehand.
        settling_s: so long after a step they have answered.
        alive: told with every command whether it drives an output away from its safe value: a sign of life.
    """

    module: ModuleType
    settings: Any
    wiring: Wiring
    another_address: Any = None
    side: Behind | None = None
    spoil: Callable[..., None] | None = None
    room: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    slew_per_s: Mapping[str, float] = field(default_factory=dict)
    reach: float = 1.0
    witnesses: Mapping[str, Witness] = field(default_factory=dict)
    responses: tuple[str, ...] = ()
    settling_s: float = 1.0
    alive: Callable[[bool], None] = lambda _driven: None
    _pin: Pin = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_pin", Pin(self.module, self.settings))

    @contextmanager
    def link(self) -> Iterator[Any]:
        """The bare link; what it drove is driven safe before it is closed again."""
        with self.asking() as link:
            try:
                yield link
            finally:
                if self.wiring.outputs:
                    with suppress(HardwareError):
                        self.drive(link, self.safe())

    @contextmanager
    def asking(self) -> Iterator[Any]:
        """A link that is opened, and closed again as it is."""
        if not hasattr(self.module, "open_link"):
            raise LeftOut("this driver times its samples by itself")
        link = self._pin.link(self.wiring)
        try:
            yield link
        finally:
            link.close()

    @contextmanager
    def daq(self) -> Iterator[Daq]:
        """The device as a DAQ, its outputs made safe afterwards."""
        daq = self._pin.daq(self.wiring)
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

    @property
    def outputs(self) -> tuple[OutputChannel, ...]:
        """Every output; there is one at least."""
        if not self.wiring.outputs:
            raise LeftOut("no output in use")
        return tuple(self.wiring.outputs.values())

    def safe(self) -> dict[str, float]:
        """By terminal, every output at its safe value."""
        return {c.terminal: c.safe for c in self.wiring.outputs.values()}

    def levels(self, share: float) -> dict[str, float]:
        """By terminal, every output at a share of its room, counted from its safe value, no two at the same share."""
        return {
            c.terminal: self.towards(c, share * (1.0 - 0.3 * i / len(self.wiring.outputs)))
            for i, c in enumerate(self.wiring.outputs.values())
        }

    def nth(self, number: int) -> dict[str, float]:
        """By terminal, where outputs go with one of many commands: each elsewhere than before.

        Lines are switched with every command, and of any two lines one is on and the other off now and then.
        """
        lines = [c for c in self.wiring.outputs.values() if c.kind == "digital"]
        turn, other_way = divmod(number, 2)
        bit = turn % max(1, len(lines).bit_length())
        on = {c.terminal: (i + 1 >> bit & 1) != other_way for i, c in enumerate(lines)}
        switched = {c.terminal: self.towards(c, 1.0 if on[c.terminal] else 0.0) for c in lines}
        return {**self.levels(0.2 + 0.3 * (number % 3)), **switched}

    def towards(self, channel: OutputChannel, share: float) -> float:
        """So far from safe towards the farther end of its room; below zero to the other side. A line is off or on."""
        if channel.kind == "digital":
            return 1.0 - channel.safe if share > 0.0 else channel.safe
        low, high = self.room.get(channel.name, (channel.low, channel.high))
        share *= self.reach
        up = high - channel.safe >= channel.safe - low
        span = high - channel.safe if up == (share >= 0.0) else channel.safe - low
        return channel.safe + (abs(share) * span if up == (share >= 0.0) else -abs(share) * span)

    def drive(self, link: Any, commanded: Mapping[str, float]) -> None:
        """Drive a link there, no faster than the outputs may go."""
        self.alive(dict(commanded) != self.safe())
        outputs = self.wiring.outputs
        slow = {c.terminal: self.slew_per_s[name] for name, c in outputs.items() if name in self.slew_per_s}
        if slow:
            stands = {**self.safe(), **link.standing()}
            steps = max(math.ceil(abs(commanded[t] - stands[t]) / (slow[t] * _STEP_S)) for t in slow)
            for step in range(1, steps):
                link.drive({t: commanded[t] + (stands[t] - commanded[t]) * (1.0 - step / steps) for t in commanded})
                system.sleep(_STEP_S)
        link.drive(commanded)

    def seen(self, link: Any) -> Mapping[str, float]:
        """Where outputs stand, by terminal: at the twin's terminals, else as the device itself says when asked."""
        if self.side is not None:
            return {c.terminal: self.side.standing(c.terminal) for c in self.outputs}
        return self.asked(link)

    def asked(self, link: Any) -> Mapping[str, float]:
        """Where outputs stand, by terminal, as the device itself says.

        Raises:
            LeftOut: it cannot be asked.
        """
        found: Mapping[str, float] = link.standing()
        if not all(math.isfinite(found.get(c.terminal, math.nan)) for c in self.outputs):
            raise LeftOut("cannot tell: this device does not say where its outputs stand")
        return found

    def asked_anew(self) -> Mapping[str, float]:
        """Where outputs stand, by terminal, as the device says when it has just been opened.

        Raises:
            LeftOut: it cannot be asked.
        """
        if hasattr(self.module, "open_link"):
            with self.asking() as link:
                return dict(self.asked(link))
        with self.daq() as daq:
            answers = daq.read_back()
        found = {c.terminal: at for name, c in self.wiring.outputs.items() if (at := answers[name].at) is not None}
        if len(found) < len(self.outputs):
            raise LeftOut("cannot tell: this device cannot be asked where its outputs stand")
        return found

    def stand_there(self, link: Any, commanded: Mapping[str, float], longest_s: float = SOON_S) -> None:
        """Wait until every output is seen where it was driven, but not for its watchdog to do it.

        Raises:
            Broken: one is not, in time.
        """
        until_s = system.now_s() + min(longest_s, quiet_s(link))
        while True:
            seen = self.seen(link)
            away = [c for c in self.outputs if not agree(c, commanded[c.terminal], seen[c.terminal])]
            if not away:
                return
            if system.now_s() > until_s:
                raise Broken("; ".join(_where_it_stands(c, commanded[c.terminal], seen[c.terminal]) for c in away))
            system.sleep(0.005)


def quiet_s(link: Any) -> float:
    """For so long a device may be left alone."""
    watchdog_s = getattr(link, "watchdog_s", None)
    return math.inf if watchdog_s is None else 0.5 * float(watchdog_s)


def _where_it_stands(channel: OutputChannel, commanded: float, seen: float) -> str:
    safe = ", its safe value," if commanded == channel.safe else ""
    return f"'{channel.name}' was driven to {commanded:.4g} {channel.unit}{safe} and stands at {seen:.4g}"


def agree(channel: OutputChannel, one: float, other: float) -> bool:
    """Whether two levels of an output are the same, but for what a protocol rounds."""
    return abs(one - other) <= AGREES * (channel.high - channel.low)


def expect(true: bool, otherwise: str) -> None:
    """Raise `Broken` with this text unless it is true."""
    if not true:
        raise Broken(otherwise)
