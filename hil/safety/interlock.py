"""Interlocks: what must hold while a bench is driven, and what happens when it does not."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hil.arrays import Array, Mask
from hil.daq.contract import Block
from hil.language.note import Note
from hil.safety.lasting import lasting_s
from hil.safety.standstill import Standstill

Action = Literal["indicate", "hold", "stop", "trip"]


@dataclass(frozen=True, slots=True)
class Band:
    """A channel within a range, ends included; `minus` names a channel that is subtracted first."""

    channel: str
    low: float = -np.inf
    high: float = np.inf
    minus: str = ""

    @property
    def asks(self) -> bool:
        """Whether any value is outside."""
        return self.low > -np.inf or self.high < np.inf

    def values(self, block: Block) -> Array:
        """What is compared with the range."""
        values = block.values(self.channel)
        if not self.minus:
            return values
        with np.errstate(invalid="ignore"):  # of two that were not measured nothing is known
            return values - block.values(self.minus)

    def keeps(self, block: Block) -> bool:
        """Whether the channel was measured all the time and is within the range: what `outside` finds nowhere."""
        values = self.values(block)
        low, high = values.min(), values.max()
        return bool(self.low <= low and high <= self.high and -np.inf < low and high < np.inf)

    def outside(self, block: Block) -> Mask:
        """Where the channel is not within the range, or was not measured."""
        values = self.values(block)
        inside = np.isfinite(values)
        if self.high < np.inf:
            inside &= values <= self.high
        if self.low > -np.inf:
            inside &= values >= self.low
        return np.logical_not(inside, out=inside)

    def may_hold(self, block: Block) -> Mask:
        """Where the channel is within the range, or was not measured, so that nobody knows."""
        return ~self.outside(block) | ~np.isfinite(self.values(block))

    @property
    def note(self) -> Note:
        """What must hold."""
        quantity = f"{self.channel} − {self.minus}" if self.minus else self.channel
        if self.low == -np.inf:
            return Note("{quantity} ≤ {high:g}", quantity=quantity, high=self.high)
        if self.high == np.inf:
            return Note("{quantity} ≥ {low:g}", quantity=quantity, low=self.low)
        return Note("{quantity} in {low:g} … {high:g}", quantity=quantity, low=self.low, high=self.high)

    def __str__(self) -> str:
        return str(self.note)


@dataclass(frozen=True, slots=True)
class Interlock:
    """A condition on the bench, and the action when it is broken for `for_s` without a break.

    A channel that is not measured (see `hil.daq.contract.Block`) breaks it for as long as that lasts, and so does one
    that stands still longer than its own noise allows (see `hil.safety.standstill`).

    Attributes:
        name: by which a trip is reset.
        action: `indicate` writes an event; `hold` waits before the next part until the condition is met
            again; `stop` ends the run, outputs going safe as on any exit; `trip` makes outputs safe at once and
            latches until it is reset by name.
        allowed: what must hold. (Over-pressure, over-temperature, live zero, end of stroke.)
        for_s: how long it may be broken.
        only_while: the condition is asked for only while this holds. (Flow without command: the flow is near
            zero while the command is.)
        stale_s: the reading must also change at least once in so long; a wire that is off, a device that
            hangs and repeats itself, read as a constant.
        is_emergency_stop: whether the channel is the feedback contact of the hardware's own stop: what is said of it
            tells a person who pressed from a link that died.
    """

    name: str
    action: Action
    allowed: Band
    for_s: float = 0.0
    only_while: Band | None = None
    stale_s: float | None = None
    is_emergency_stop: bool = False


@dataclass(frozen=True, slots=True)
class Violation:
    """An interlock that was broken: when, and a sentence for the operator."""

    interlock: Interlock
    time_s: float
    text: str


@dataclass(slots=True)
class Watch:
    """Follows one interlock from block to block; `broken` says how the last block ended."""

    interlock: Interlock
    broken: bool = False
    _outside_since_s: float | None = field(default=None, init=False)
    _same_since_s: float | None = field(default=None, init=False)
    _last: float = field(default=np.nan, init=False)

    def judge(self, block: Block, blind_s: float = 0.0, repeated: Mask | None = None) -> Violation | None:
        """The first violation that begins in this block.

        Args:
            block: what was read.
            blind_s: no other reading comes for so long after the last one; until then what was broken counts as
                broken still.
            repeated: where the channel repeats its reading more often than by chance; None where it never does.
        """
        judged = (
            (self._outside(block, blind_s), self._outside_text),
            (self._stale(block), self._stale_text),
            (repeated, self._repeated_text),
        )
        conditions = [(where, text_of) for where, text_of in judged if where is not None]
        if not conditions:
            self.broken = False
            return None
        bad = np.logical_or.reduce([where for where, _ in conditions])
        went_on = self.broken and bool(bad[0])
        self.broken = bool(bad[-1])
        if went_on or not bad.any():
            return None
        at = int(np.argmax(bad))
        time_s = float(block.time_s[at])
        text_of = next(text_of for where, text_of in conditions if where[at])
        if self.interlock.is_emergency_stop and text_of != self._repeated_text:
            return Violation(self.interlock, time_s, self._pressed_text(block, at))
        reason = text_of(block, at)
        return Violation(self.interlock, time_s, f"interlock '{self.interlock.name}': {reason} at {time_s:.3f} s")

    def _outside(self, block: Block, blind_s: float) -> Mask | None:
        """Where the range has been left for long enough; None when it is kept all the time."""
        lock = self.interlock
        if not lock.allowed.asks:  # only that the reading changes
            return None
        if lock.allowed.keeps(block):  # two comparisons, and nearly always so
            self._outside_since_s = None
            return None
        outside = lock.allowed.outside(block)
        if lock.is_emergency_stop:  # a contact may read the ends of its range: the upper one is closed
            outside = ~(lock.allowed.values(block) >= lock.allowed.low)
        if lock.only_while is not None and np.count_nonzero(outside):
            outside &= lock.only_while.may_hold(block)
        if not np.count_nonzero(outside):
            self._outside_since_s = None
            return None
        held_s, self._outside_since_s = lasting_s(outside, block.time_s, self._outside_since_s)
        held_s[-1] += blind_s
        return outside & (held_s >= lock.for_s)

    def _stale(self, block: Block) -> Mask | None:
        """Where the reading has not changed for too long; None when it changes all the time."""
        lock = self.interlock
        if lock.stale_s is None:
            return None
        values = block.values(lock.allowed.channel)
        same = np.empty(len(values), dtype=np.bool_)
        same[0] = values[0] == self._last
        np.equal(values[1:], values[:-1], out=same[1:])
        same |= ~np.isfinite(values)
        self._last = float(values[-1])
        if not np.count_nonzero(same):
            self._same_since_s = None
            return None
        held_s, self._same_since_s = lasting_s(same, block.time_s, self._same_since_s)
        return np.logical_and(same, held_s >= lock.stale_s)

    def _pressed_text(self, block: Block, at: int) -> str:
        name = self.interlock.allowed.channel
        value, time_s = float(block.values(name)[at]), float(block.time_s[at])
        if np.isnan(value):
            why = block.invalid_reasons.get(name, "") or "no measurement"
            unread = f"its contact could not be read at {time_s:.3f} s ({why})"
            return f"emergency stop '{name}': {unread}: the link died, nobody is known to have pressed"
        return f"emergency stop '{name}': pressed at {time_s:.3f} s (its contact is open, {value:.6g})"

    def _outside_text(self, block: Block, at: int) -> str:
        lock = self.interlock
        lasted = f" for {lock.for_s:g} s" if lock.for_s else ""
        condition = f" while {lock.only_while}" if lock.only_while else ""
        reasons = (block.invalid_reasons.get(name or "", "") for name in (lock.allowed.channel, lock.allowed.minus))
        reading = _reading(float(lock.allowed.values(block)[at]), next(filter(None, reasons), ""))
        return f"{reading}{lasted}{condition}; allowed: {lock.allowed}"

    def _repeated_text(self, block: Block, at: int) -> str:
        name = self.interlock.allowed.channel
        return (
            f"{name} stands at {float(block.values(name)[at]):.6g}, reading after reading, where its own noise "
            "moves it: sensor or device repeats itself, nothing is measured"
        )

    def _stale_text(self, block: Block, at: int) -> str:
        lock = self.interlock
        value = float(block.values(lock.allowed.channel)[at])
        stood = (
            f"has stood at {value:.6g}"
            if np.isfinite(value)
            else f"has had {_reading(value, block.invalid_reasons.get(lock.allowed.channel, ''))}"
        )
        return f"{lock.allowed.channel} {stood} for {lock.stale_s:g} s: dead sensor, broken wire or hanging device"


def _reading(value: float, why: str) -> str:
    if np.isnan(value):
        return f"no measurement ({why})" if why else "no measurement"
    if np.isinf(value):
        return f"no measurement (beyond the {'upper' if value > 0.0 else 'lower'} end of its range)"
    return f"{value:.6g}"


class Watches:
    """Follows every interlock of a bench, and every channel that one of them watches."""

    def __init__(self, interlocks: Iterable[Interlock]) -> None:
        self._watches = [Watch(interlock) for interlock in interlocks]
        self._standstills = {watch.interlock.allowed.channel: Standstill.begun() for watch in self._watches}

    def judge(self, block: Block, blind_s: float = 0.0) -> list[Violation]:
        """The violations that begin in this block, in the order of time (see `Watch.judge`)."""
        repeated = {}
        for name, standstill in self._standstills.items():
            self._standstills[name], where = standstill.after(block.values(name))
            repeated[name] = where if where.any() else None
        judged = (watch.judge(block, blind_s, repeated[watch.interlock.allowed.channel]) for watch in self._watches)
        return sorted(filter(None, judged), key=lambda violation: violation.time_s)

    def pass_over(self, block: Block) -> bool:
        """Judge several blocks in one, where none of them breaks an interlock; else nothing of it is remembered.

        However they are cut then, `judge` would say nothing of any.
        """
        before = [copy(watch) for watch in self._watches], self._standstills.copy()
        if not any(watch.broken for watch in self._watches) and not self.judge(block):
            return True
        self._watches, self._standstills = before
        return False

    @property
    def ended_by(self) -> frozenset[str]:
        """Channels whose missing measurement ends the run by an interlock, whatever else the bench does."""
        ending = (w.interlock for w in self._watches if w.interlock.action in ("stop", "trip"))
        bands = (lock.allowed for lock in ending if lock.only_while is None)
        return frozenset(name for band in bands for name in (band.channel, band.minus) if name)

    @property
    def holding(self) -> Interlock | None:
        """An interlock with the action `hold` that was broken at the end of the last block."""
        broken = (watch.interlock for watch in self._watches if watch.broken)
        return next((interlock for interlock in broken if interlock.action == "hold"), None)
