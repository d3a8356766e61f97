"""A DAQ made of devices that the host asks sample by sample over a link: Modbus, serial, CAN.

A driver for such a device needs no loop of its own: it provides a `hil.daq.link.Link`, and this module makes a `Daq` of
one or of several. The host times the samples, so every sample has the stamp that it really had, and the link's delay
is measured.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, suppress
from statistics import median
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from hil.clock import Clock, Flag, RealClock, refuse_after_sleep
from hil.daq.channel import InputChannel, OutputChannel, Wiring
from hil.daq.check import check_waveform, checked_task, coerced_rate, next_or_failure
from hil.daq.contract import Block, Promises, ReadBack, Waveform
from hil.daq.link import WHATEVER, Late, Link, Member
from hil.daq.polling import BEHIND_S, Taken, Task
from hil.errors import DeviceLostError, HardwareError, LinkError, UnansweredError
from hil.system import system

_T = TypeVar("_T")

_PROBES = 8  # readings by which a link is measured when it is opened
_FEWEST_PROBES, _PROBING_S = 3, 0.3  # but no longer than that once there are so many
_JUDGING_S = 0.05  # so long the next sample waits for what is thought of a block that came late
_OF_LATE = 3  # samples that say how long one takes now
_FASTEST = 0.25  # quantile of them that is the link's own time: a busy host makes readings slower, never faster
_BEHIND = 1.5  # a sample that takes longer, in intervals, makes the next one late
_SHORTEST_S = 1e-5  # no sample takes less
_IDLE_S = 60.0  # a watchdog is kept quiet between tasks for so long; then the program counts as hung
_SHARE = 0.8  # of the time that a link has, it is used: the rest is for what the computer does besides


class PolledDaq:
    """Devices behind links, polled in one loop: one time base, a stamp for each sample (see `hil.daq.contract.Daq`).

    In each sample the outputs are driven first, link by link, then the inputs are read. A sample that begins more
    than half an interval late counts as `late`. Those after it come up to twice as fast as planned until they are on
    time again, so that a sine stays the sine that was asked for; after a stall of more than a second the rest is
    played later instead.

    A block ends by the clock: when it has lasted as long as its samples were planned to take, what has been read is
    handed over; on a link that has fallen behind its rate, as soon as another sample would take longer than that. A
    link on which samples take longer than half a block for more than a second (and longer than they may by their rate)
    has become too slow and ends the task, and so does a sleep of the computer: where outputs stand afterwards, nobody
    knows.

    Args:
        links: by name of the device; the DAQ closes them.
        wirings: what is connected to each.
        clock: by which samples are due and stamped; the host's monotonic one when not given.
        measured: whether it is measured first how long a sample takes. Who only makes outputs safe has no time for it,
            and tells also a device that does not answer.
        doubts: by device, why nothing that it says is believed, given what it says that it is.
        late: by device, how long a command that was not answered may still arrive; as on a direct link if not given.

    Raises:
        HardwareError: a device does not answer, or too slowly for its own watchdog. All links are closed then.
    """

    def __init__(
        self,
        links: Mapping[str, Link],
        wirings: Mapping[str, Wiring],
        clock: Clock | None = None,
        *,
        measured: bool = True,
        doubts: Mapping[str, Callable[[str], str]] = MappingProxyType({}),
        late: Mapping[str, Late] = MappingProxyType({}),
    ) -> None:
        self._clock = RealClock() if clock is None else clock
        self._members = [Member(name, link, wirings[name], self._clock) for name, link in links.items()]
        for member in self._members:
            member.doubt = doubts.get(member.name, member.doubt)
            member.late = late.get(member.name, member.late)
        self.outputs: Mapping[str, OutputChannel] = _merged(member.wiring.outputs for member in self._members)
        self.inputs: Mapping[str, InputChannel] = _merged(member.wiring.inputs for member in self._members)
        self._lock = system.lock()
        self._task: Task | None = None
        self._failed: HardwareError | None = None
        self._not_safe: HardwareError | None = None  # why outputs could not be made safe when that was tried last
        self._made_safe, self._only_safe = False, not measured
        self._stand = True  # whether outputs are known to be at `levels`: a sample that failed leaves them anywhere
        self._ended = Flag()
        self._blind_s = 0.0
        self._zero_s = self._used_s = self._clock.now_s
        try:
            self.levels: Mapping[str, float] = _merged(self._standing(member, measured) for member in self._members)
            self._cycle_s = self._measured() if measured else _SHORTEST_S
            self._samples_s = deque([self._cycle_s], maxlen=_OF_LATE)
            self._refuse_too_slow_for_watchdogs()
        except BaseException:
            self._let_go()
            raise
        self._keep_alive()

    @property
    def identities(self) -> Mapping[str, str]:
        """What each device says that it is; empty where it says nothing."""
        return {member.name: member.identity for member in self._members}

    @property
    def promises(self) -> Promises:
        """What these links keep, with the delays that they have shown of late."""
        watchdogs = [m.link.watchdog_s for m in self._members if m.wiring.outputs]
        guarded = [watchdog for watchdog in watchdogs if watchdog is not None]
        return Promises(
            timing="polled", simultaneous=len(self._members) <= 1, skew_s=0.0, read_at=0.0, holds_on_stop=True,
            lowest_rate_hz=max([1e-3, *(1.0 / (_SHARE * watchdog_s) for watchdog_s in guarded)]),
            highest_rate_hz=_SHARE / self._cycle_s,
            watchdog_s=max(guarded) if guarded and len(guarded) == len(watchdogs) else None,
            latency_s=sum(_median(member.read_for_s) for member in self._members),
            sample_s=_median(self._samples_s), blind_s=self._blind_s,
            delays_s=_merged(dict.fromkeys(m.wiring.inputs, _median(m.read_after_s)) for m in self._members),
            delay_channels={name: m.delay_name for m in self._members for name in m.wiring.inputs},
        )  # fmt: skip

    def actual_rate_hz(self, asked_hz: float) -> float:
        """Any rate up to what the links could keep when they were opened."""
        return coerced_rate(self.promises, asked_hz)

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        """Finite acquisition; the whole waveform is the polling thread's before the first sample."""
        check_waveform(waveform, self.outputs, self.promises)
        return self._played(iter(list(waveform.slices(block_samples or len(waveform)))), ahead=len(waveform))

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        """Continuous acquisition; without a next waveform outputs stand, and after a second the task is lost."""
        return self._played(checked_task(waveforms, self.outputs, self.promises), ahead=1)

    def make_safe(self) -> None:
        """Stop what plays, and put every output at its safe value, whatever the other links do: each is told once.

        Where that failed nothing is played until it has not.

        Raises:
            UnansweredError: opened for nothing else, every device was told, and one did not answer.
            DeviceLostError: one could not be told.
        """
        if self._ended.is_set():
            return
        self._stop_task()
        left: list[Exception] = []
        with self._lock:
            for member in self._members:
                mine = {name: channel.safe for name, channel in member.wiring.outputs.items()}
                try:
                    member.drive(mine)
                except Exception as error:
                    left.append(error)
                else:
                    self.levels = {**self.levels, **mine}
            self._made_safe, self._stand, self._not_safe = True, not left, None
            if left:
                is_unanswered = self._only_safe and all(isinstance(error, LinkError) for error in left)
                self._not_safe = (UnansweredError if is_unanswered else DeviceLostError)("; ".join(map(str, left)))
                raise self._not_safe

    def read_back(self) -> Mapping[str, ReadBack]:
        """Where the outputs stand, asked of each device by itself."""
        with self._lock:
            if self._ended.is_set():
                return dict.fromkeys(self.outputs, ReadBack(why="the devices were let go of"))
            return _merged(member.read_back() for member in self._members)

    def look(self, name: str) -> Block:
        """A reading of one input, asked of its device alone; also after another device failed.

        Raises:
            HardwareError: its own device gives no answer.
        """
        member = next(one for one in self._members if name in one.wiring.inputs)
        with self._lock:
            if not member.answers:
                raise LinkError(f"{member.name}: gave no answer")
            values = {name: np.array([member.read()[name]])}
            return Block(
                np.array([self._clock.now_s - self._zero_s]), values, {}, invalid_reasons=member.invalid_reasons()
            )

    def close(self) -> None:
        """Make safe, unless that was the last thing done, and let go of the devices."""
        if self._ended.is_set():
            return
        try:
            if not self._made_safe:
                self.make_safe()
        finally:
            self._let_go()

    @staticmethod
    def _standing(member: Member, measured: bool) -> dict[str, float]:
        try:
            return member.standing()
        except LinkError:
            if measured:
                raise
            return {}

    def _measured(self) -> float:
        """How long one sample takes on all links together; asking where outputs stand counts as driving them."""
        reading_s: list[float] = []
        driving_s = 0.0
        for member in self._members:
            until_s = self._clock.now_s + _PROBING_S
            probed_s: list[float] = []
            while len(probed_s) < _FEWEST_PROBES or (len(probed_s) < _PROBES and self._clock.now_s < until_s):
                begun_s = self._clock.now_s
                member.standing()
                probed_s.append(self._clock.now_s - begun_s)
                member.read()
            driving_s += float(np.quantile(probed_s, _FASTEST))
            reading_s.append(float(np.quantile(member.read_for_s, _FASTEST)))
        asked_s = 0.5 * driving_s
        for member, takes_s in zip(self._members, reading_s, strict=True):  # until they are measured
            member.read_after_s.append(asked_s + 0.5 * takes_s - member.reading_age_s)
            asked_s += takes_s
        return max(driving_s + sum(reading_s), _SHORTEST_S)

    def _refuse_too_slow_for_watchdogs(self) -> None:
        for member in self._members:
            watchdog_s = member.link.watchdog_s
            if member.wiring.outputs and watchdog_s is not None and self._cycle_s > _SHARE * watchdog_s:
                raise LinkError(
                    f"{member.name}: a sample takes {self._cycle_s:.3g} s as measured, too long for the device's own "
                    f"watchdog_s = {watchdog_s:g} s; give it more than {self._cycle_s / _SHARE:.2g} s, or a faster link"
                )

    def _played(self, waveforms: Iterator[Waveform], ahead: int) -> Iterator[Block]:
        """Hand waveforms to the polling thread, always `ahead` of the blocks that come back."""
        self._refuse_if_failed()
        self._stop_task()
        if all(self.levels.get(name) == channel.safe for name, channel in self.outputs.items()):
            for member in self._members:
                member.renew()
        self._made_safe = False
        task = self._task = Task(self._poll)
        failure: Exception | None = None
        task.thread.start()
        try:
            asked, exhausted = 0, False
            while True:
                while not exhausted and asked <= ahead:
                    waveform, failure = next_or_failure(waveforms)
                    exhausted = waveform is None
                    task.todo.put(waveform)
                    asked += 1
                task.judged.set()
                came = task.done.get()
                if isinstance(came, BaseException):
                    raise came
                if came is None:
                    break
                block, is_whole = came
                asked -= is_whole
                yield block
        finally:
            task.end()
        if failure is not None:
            raise failure

    def _poll(self, task: Task) -> None:
        """The polling thread: one task from its first sample to its last."""
        due_s = self._clock.now_s
        try:
            while (waveform := task.next()) is not None:
                due_s = self._run(waveform, due_s, task)
        except BaseException as error:
            if isinstance(error, HardwareError):
                self._failed = error if isinstance(error, DeviceLostError) else None
            task.done.put(error)
        task.done.put(None)

    def _run(self, waveform: Waveform, due_s: float, task: Task) -> float:
        """Play one waveform from `due_s` on, hand its blocks over, and return when the next sample is due."""
        interval_s = 1.0 / waveform.rate_hz
        rows = list(zip(*(values.tolist() for values in waveform.outputs.values()), strict=True)) or [()] * len(
            waveform
        )
        names = tuple(waveform.outputs)
        task.pace.planned(len(rows) * interval_s, interval_s)
        taken = self._nothing_taken()
        soonest_s = due_s
        try:
            for row in rows:
                if self._clock.stopped_before(max(due_s, soonest_s), task.stop):
                    break
                now_s = self._clock.now_s
                if task.pace.is_over(taken.begun_s, now_s + self._blind_s):
                    task.judged.clear()
                    task.done.put((taken.block(), False))
                    task.judged.wait(_JUDGING_S)  # a safe value shall not wait for an exchange that is under way
                    if task.stop.is_set():
                        break
                    now_s, taken = self._clock.now_s, self._nothing_taken()
                taken.late += now_s - due_s > 0.5 * interval_s
                if now_s - due_s > BEHIND_S:
                    due_s = now_s
                with self._lock:
                    self._stand = False  # also after a sample that failed
                    self._sample({**self.levels, **dict(zip(names, row, strict=True))}, taken, task)
                    self._stand = True
                self._blind_s = took_s if (took_s := self._samples_s[-1]) > _BEHIND * interval_s else 0.0
                task.pace.check()
                due_s += interval_s
                soonest_s = now_s + 0.5 * interval_s
        finally:
            if taken.time_s:
                task.done.put((taken.block(), True))
        return due_s

    def _sample(self, levels: Mapping[str, float], taken: Taken, task: Task) -> None:
        """Drive and read once; nothing is read any more when the task is stopped meanwhile."""
        self._refuse_if_failed()  # as the sign of life may have
        begun_s = self._clock.now_s
        self._drive(self._members, levels)
        updated_s = 0.5 * (begun_s + self._clock.now_s)
        readings: dict[str, float] = {}
        delays_s: dict[str, float] = {}
        for member in self._members:
            if task.stop.is_set():  # a safe value shall not wait for readings
                return
            asked_s = self._clock.now_s
            readings |= member.read()
            taken.invalid_reasons |= member.invalid_reasons()
            delay_s = 0.5 * (asked_s + self._clock.now_s) - updated_s - member.reading_age_s
            member.read_after_s.append(delay_s)
            delays_s[member.delay_name] = delay_s
        self._used_s = self._clock.now_s
        self._samples_s.append(self._used_s - begun_s)
        task.pace.took(begun_s, self._used_s)
        taken.add(begun_s, updated_s - self._zero_s, levels, readings, delays_s)

    def _drive(self, members: Iterable[Member], levels: Mapping[str, float]) -> None:
        """Drive these, unless the computer has slept meanwhile."""
        for member in members:
            refuse_after_sleep(self._clock)  # as it may have while the one before was driven
            member.drive(levels)
            self.levels = {**self.levels, **{name: levels[name] for name in member.wiring.outputs}}

    def _nothing_taken(self) -> Taken:
        delays = [member.delay_name for member in self._members if member.wiring.inputs]
        return Taken(self.outputs, self.inputs, delays)

    def _stop_task(self) -> None:
        if self._task is not None:
            self._task.end()

    def _refuse_if_failed(self) -> None:
        if (failure := self._failed or self._not_safe) is not None:
            raise failure
        if self._ended.is_set():
            raise DeviceLostError("the devices were let go of; open them again")

    def _keep_alive(self) -> None:
        beats = [member.link.keep_alive_s for member in self._members if member.link.keep_alive_s is not None]
        if beats:
            system.thread(self._beat, min(beats), name="hil-keep-alive").start()

    def _beat(self, every_s: float) -> None:
        """In a pause, drive again what stands, so that no watchdog takes it for a dead program."""
        while not self._ended.wait(every_s):
            idle_s = self._clock.now_s - self._used_s
            if self._failed is not None or not every_s <= idle_s < _IDLE_S:
                continue
            with self._lock:
                if self._ended.is_set():
                    return  # closed while we waited: a link that is driven now would open again
                if self._failed is not None or not self._stand:
                    continue  # made safe while we waited, perhaps unheard, or on the way: what stood before is over
                try:
                    self._drive([m for m in self._members if m.link.keep_alive_s is not None], self.levels)
                except HardwareError as error:
                    self._failed = error

    def _let_go(self) -> None:
        self._ended.set()
        with self._lock, ExitStack() as links:
            for member in reversed(self._members):
                links.enter_context(suppress(*WHATEVER))  # one that cannot be closed keeps no other from it
                links.callback(member.link.close)


def _median(times_s: deque[float]) -> float:
    return median(times_s) if times_s else math.nan


def _merged(parts: Iterable[Mapping[str, _T]]) -> dict[str, _T]:
    return {name: value for part in parts for name, value in part.items()}
