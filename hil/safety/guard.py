"""The guard: the DAQ that wraps every DAQ. Nothing reaches an output but through it."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress

import numpy as np

from hil.arrays import ROUNDING
from hil.clock import Clock, VirtualClock, refuse_after_sleep
from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.contract import Block, Daq, Promises, ReadBack, Waveform, closing_blocks, joined
from hil.errors import (
    DeviceLostError,
    HardwareError,
    InputError,
    LinkError,
    RangeError,
    StoppedError,
    StorageError,
    TrippedError,
    reason,
)
from hil.record.invalid_samples import is_measured
from hil.safety.envelope import Envelope
from hil.safety.interlock import Interlock, Violation, Watch, Watches
from hil.safety.interrupt import Halted, cut_by_halt, uninterrupted
from hil.safety.latch import Latch
from hil.safety.limits import Limits
from hil.safety.operator import Operator, patience_over
from hil.safety.outputs import AGAIN_S, Outputs
from hil.safety.protection import Protection
from hil.safety.ramp import way_to
from hil.safety.witness import Witnesses, stands_at

_AHEAD_SAMPLES = 1 << 16  # are played at once at most where time is virtual


class Guard:
    """A backend behind its limits and interlocks. Itself a `Daq`, in engineering units.

    Every waveform is checked whole before its first sample, every block as soon as it is read. Whatever ends a
    task before its end (a violation, an error, Ctrl-C, a reader that leaves early) makes the outputs safe
    before it is raised, and reads them back. Opening a guard makes them safe too. What came of it stands in
    `output_states`; no error of a device on the way takes the place of the one that ended the task.

    In virtual time many blocks are played and judged as one. Where an interlock is broken in them they are taken back,
    and played and judged one by one, so that a trip comes at the sample at which it would have come.

    An end is final: whatever ended a task (see `is_end`), or was said to have ended the run (`end`), is raised again by
    every later call, so that a procedure that catches everything drives nothing more.

    Args:
        daq: the backend, in engineering units.
        protection: its limits and interlocks.
        latch: what has tripped; outlives the guard where it has a file.
        clock: by which outputs stand at their level between tasks.
        keep: takes every block, whatever it was played for: the recording. Only a trip comes before it.
        note: takes every event (`note(name, **details)`): an indication, a hold, a stop, a trip.
        beat: the sign of life for a watchdog, told whether outputs are driven; given before a task, with each
            block, and when outputs are safe. What it raises ends the task.
        known: what is known of the outputs, where somebody has begun to keep it; else begun anew.
        operator: what is asked from outside: a stop, a hold.
    """

    def __init__(
        self,
        daq: Daq,
        protection: Protection,
        latch: Latch | None = None,
        clock: Clock | None = None,
        keep: Callable[[Block], None] = lambda _block: None,
        note: Callable[..., None] = lambda _event, **_details: None,
        beat: Callable[[bool], None] = lambda _driven: None,
        output_states: Outputs | None = None,
        operator: Operator | None = None,
    ) -> None:
        self._clock = clock or VirtualClock()
        self._operator = operator or Operator()
        self.output_states = output_states or Outputs()
        if not self.output_states.by_name:
            self.output_states.opened(daq.outputs)
        self._beat = beat
        self._daq = daq
        self._tell_safe()
        self.output_states.check()
        self.output_states.witnesses = Witnesses(protection.witnesses, daq.inputs)
        self.latch = latch or Latch()
        self._protection = protection
        self._limits = Limits(daq, protection.envelopes, self._clock)
        self._watches = Watches(protection.interlocks)
        self._roll_back: Callable[[int], None] | None = getattr(daq, "roll_back", None)
        self._block_samples = 1
        self._keep = keep
        self._note = note
        self._over: BaseException | None = None
        self._unrecorded: StorageError | None = None
        self._looked = self._closed = False

    @property
    def promises(self) -> Promises:
        """What the backend keeps."""
        return self._daq.promises

    @property
    def outputs(self) -> Mapping[str, OutputChannel]:
        """The outputs in use."""
        return self._daq.outputs

    @property
    def inputs(self) -> Mapping[str, InputChannel]:
        """The inputs in use."""
        return self._daq.inputs

    @property
    def levels(self) -> Mapping[str, float]:
        """Where each output stands."""
        return self._daq.levels

    @property
    def limits(self) -> Mapping[str, Envelope]:
        """The limits in force, by output."""
        return self._limits.envelopes

    def actual_rate_hz(self, asked_hz: float) -> float:
        """The backend's actual rate.

        Raises:
            RangeError: the device does not have it, or a block would be over before its first sample.
        """
        rate_hz = self._daq.actual_rate_hz(asked_hz)
        if rate_hz * self._protection.block_s < 1.0 - ROUNDING:
            raise RangeError(
                f"sample rate {rate_hz:g} Hz: a sample each {1.0 / rate_hz:.4g} s, and block_s = "
                f"{self._protection.block_s:g} s promises that inputs are judged more often"
            )
        return rate_hz

    @property
    def over(self) -> BaseException | None:
        """What ended the run, where something has."""
        return self._over

    def end(self, error: BaseException) -> None:
        """The run is over: a task that is at work ends with its block, and this is raised by every call from now on.

        The first end stays the one. From any thread.
        """
        if self._over is None:
            self._over = error

    def tighten(self, name: str, limits: Envelope) -> None:
        """Narrow the limits of an output for as long as the guard lives (see `Limits.tighten`)."""
        self._refuse_when_over()
        self._limits.tighten(name, limits)

    def check(self, waveform: Waveform) -> None:
        """Raise `RangeError` if any sample would leave the envelope; drives nothing."""
        self._refuse_when_over()
        self._limits.check(waveform)

    def ready(self) -> None:
        """Wait until a waveform may be played: nothing has tripped, no `hold` is in force.

        The first time, the bench is looked at with its outputs where they stand, so that no output moves
        before every interlock has been judged.

        Raises:
            TrippedError, StoppedError: an interlock tripped or stopped the run.
            BaseException: what has ended the run before.
        """
        self._refuse_when_over()
        with self._safe_on_error():
            self.latch.check()
            if not self._looked:
                self._looked = True
                self.output_states.witnesses.rested(self._stand(self._protection.look_s))
            self._wait_for_holds()

    def wait_for_operator(self) -> None:
        """Stand, as in any hold, until the operator says to go on.

        Raises:
            StoppedError: patience is over.
            BaseException: what has ended the run.
        """
        self._operator.ask_to_confirm()
        self.ready()

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        """Finite acquisition, checked whole before the first sample; blocks as long as the protection says.

        Raises:
            RangeError: a sample would leave the envelope; nothing of the waveform was driven.
            TrippedError, StoppedError: an interlock was broken.
        """
        self.ready()
        with self._safe_on_error():
            (admitted,) = self._limits.admit([waveform])
            samples = block_samples or self._protection.block_samples(waveform.rate_hz)
            yield from self._played(admitted, samples, 1 if block_samples else self._ahead(samples))

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        """Continuous acquisition; each waveform is checked before its first sample, blocks as with `play`.

        Raises:
            RangeError: a sample would leave the envelope; nothing of that waveform was driven.
            TrippedError, StoppedError: an interlock was broken.
        """
        self.ready()
        with self._safe_on_error():
            yield from self._judged(self._daq.stream(self._pieces(self._limits.admit(waveforms))))

    def make_safe(self) -> None:
        """Bring every output to its safe value, down its ramp where it has one; cannot be interrupted.

        Raises:
            NotSafeError: one could not be brought there, or was not read back there although it can be.
        """
        self._go_safe()
        self.output_states.check()

    def read_back(self) -> Mapping[str, ReadBack]:
        """What the backend answers when it is asked where the outputs stand."""
        return self._daq.read_back()

    def close(self) -> None:
        """Make safe and let go of the device; what came of it stands in `output_states`. May be called twice.

        Raises:
            TrippedError: an interlock tripped on the way.
            Halted: somebody pressed stop on the way.
            StorageError: the way could not be recorded, and nothing else went wrong.
        """
        tripped = self.latch.trips
        with uninterrupted():
            if not self.output_states.asked or self._operator.waits:
                self._go_safe()
            self._operator.tell(self.output_states)  # a stop that is pressed from now on has its answer
            self._let_go()
            self._closed = True
        if self.latch.trips != tripped:
            self.latch.check()
        if sys.exception() is None:  # pressed on the way down: the procedure was through, and the run is stopped
            self._operator.check()
        if self._unrecorded is not None and sys.exception() is None:
            unrecorded, self._unrecorded = self._unrecorded, None
            raise unrecorded

    @contextmanager
    def _safe_on_error(self) -> Iterator[None]:
        tripped = self.latch.trips
        try:
            yield
        except BaseException as error:
            if is_end(error):
                self.end(error)
            self._go_safe()
            new = [why for name, why in self.latch.trips.items() if name not in tripped and why not in str(error)]
            if new:
                self._end_tripped()  # of a reader who left, or a signal on the way, nothing else would say it
                for why in new:
                    error.add_note(why)
            if error is self._over and isinstance(error, LinkError | DeviceLostError):
                self._ask_witnesses(error)
            raise

    def _end_tripped(self) -> None:
        try:
            self.latch.check()
        except TrippedError as tripped:
            self.end(tripped)

    def _ask_witnesses(self, lost: HardwareError) -> None:
        """A stop that cuts off a device ends the task by its dead link: the contact says whether somebody pressed.

        Raises:
            TrippedError: somebody did; it is what ended the run.
        """
        for lock in self._protection.interlocks:
            if not lock.is_emergency_stop:
                continue
            if (pressed := self._witness(lock, lost)) is None:
                continue
            self._note_if_possible(lock.action, interlock=lock.name, text=pressed.text)
            with uninterrupted():
                self.latch.trip({lock.name: pressed.text})
            try:
                self.latch.check()
            except TrippedError as tripped:
                tripped.add_note(reason(lost))
                self._over = tripped
                raise

    def _witness(self, lock: Interlock, lost: HardwareError) -> Violation | None:
        """What the contact says after a device was lost; that nobody pressed is noted on the error."""
        name, look = lock.allowed.channel, getattr(self._daq, "look", None)
        try:
            found = None if look is None else Watch(lock).judge(look(name))
        except HardwareError as error:
            lost.add_note(f"emergency stop '{name}': its contact could not be read ({reason(error)})")
            return None
        if found is None and look is not None:
            lost.add_note(f"emergency stop '{name}': nobody pressed (its contact is closed)")
        return found

    def _refuse_when_over(self) -> None:
        if self._over is not None:
            raise self._over

    def _go_safe(self) -> None:
        """Down the ramp, then safe and read back. Never raises; `output_states` says what came of it."""
        if self._closed:
            return
        with uninterrupted():
            try:
                with cut_by_halt():
                    self._ramp_down()
            except Halted:
                pass  # it jumps
            except BaseException as error:  # whatever it is, a jump is left
                self._note_if_possible("ramp to safe failed", error=reason(error))
            self._tell_safe()

    def _tell_safe(self) -> None:
        with uninterrupted():
            self._make_safe()
            self.output_states.hear_witnesses(self._look, self._confirming, self._clock)
            is_stopped = self._operator.answer(self.output_states)  # before the sign that nothing is confirmed any more
            if self.output_states.are_commanded:
                with suppress(Exception):
                    self._beat(False)
            if is_stopped:
                self._note_if_possible("stop", by=self._operator.stopped_by or "operator")

    def _make_safe(self) -> None:
        self._confirming()
        self.output_states.make_safe(self._daq, self._confirming, self._clock)

    def _look(self, name: str) -> Block:
        """A reading of an input while outputs are safe; one that times itself reads all of them, which is recorded."""
        if self._daq.promises.timing == "polled":
            return self._daq.look(name)  # type: ignore[attr-defined, no-any-return]
        rate_hz = self._protection.rate_hz
        samples = math.ceil(AGAIN_S * rate_hz)
        safe = {output: np.full(samples, channel.safe) for output, channel in self.outputs.items()}
        block = joined(list(self._daq.play(Waveform(rate_hz, safe))))
        self._keep_if_possible(block)
        return block

    def _keep_if_possible(self, block: Block) -> None:
        try:
            self._keep(block)
        except StorageError as error:  # said when the outputs are safe
            self._unrecorded = error

    def _confirming(self) -> None:
        """A sign of life on a way that may take many time-outs: slow is not hung."""
        with suppress(Exception):
            self._operator.confirms(self.output_states)

    def _live(self) -> None:
        """A sign of life on the way down a ramp."""
        with suppress(Exception):
            self._beat(True)

    def _let_go(self) -> None:
        try:
            self._daq.close()
        except BaseException as error:
            self._note_if_possible("the device could not be closed", error=reason(error))

    def _played(self, waveform: Waveform, samples: int, blocks: int = 1) -> Iterator[Block]:
        """A waveform in blocks of so many samples, so many of them at once."""
        self._operator.check()
        self.output_states.driving(waveform)
        self._block_samples = samples
        return self._judged(self._daq.play(waveform, samples * blocks))

    def _ahead(self, samples: int) -> int:
        """How many blocks of so many samples may be played at once."""
        return 1 if self._roll_back is None else max(1, _AHEAD_SAMPLES // samples)

    def _judged(self, blocks: Iterator[Block]) -> Iterator[Block]:
        self._beat(True)
        with closing_blocks(blocks):
            for block in blocks:
                self._refuse_when_over()
                self._operator.check()
                self._beat(True)
                are_many = self._roll_back is not None and len(block) > self._block_samples
                if self._roll_back is not None and are_many and not self._passes(block):
                    self._roll_back(self._block_samples)
                    continue
                violations = [] if are_many else self._watches.judge(block, self._daq.promises.blind_s)
                if not self._tripped(violations, block):
                    self._keep(block)
                    self._note_all(violations)
                self._limits.seen()
                self._refuse_broken(violations)
                refuse_after_sleep(self._clock)
                _refuse_no_number(block, self._watches.ended_by)
                yield block
        self._beat(any(channel.safe != self.levels[name] for name, channel in self.outputs.items()))

    def _pieces(self, waveforms: Iterable[Waveform]) -> Iterator[Waveform]:
        for waveform in waveforms:
            self._operator.check()
            self.output_states.driving(waveform)
            samples = self._block_samples = self._protection.block_samples(waveform.rate_hz)
            if self._ahead(samples) == 1 or len(waveform) <= samples:
                yield from waveform.slices(samples)
                continue
            # While the last block plays the next waveform is asked for: not before all others were judged.
            blocks, last = waveform.slices((len(waveform) - 1) // samples * samples)
            yield from blocks.slices(samples * self._ahead(samples))
            yield last

    def _passes(self, block: Block) -> bool:
        """Whether nothing at all is to be said of several blocks in one."""
        return all(map(is_measured, block.inputs.values())) and self._watches.pass_over(block)

    def _tripped(self, violations: Collection[Violation], block: Block) -> bool:
        """Whether one of them trips: then make safe, latch, and record it all last (a disk may be slow)."""
        trips = {found.interlock.name: found.text for found in violations if found.interlock.action == "trip"}
        if trips:
            with uninterrupted():
                try:
                    self._make_safe()  # its witnesses are heard once the trip is kept
                    self.latch.trip(trips)
                finally:
                    self._live()  # a slow disk is no program that hangs
                    self._keep_if_possible(block)
                    self._note_all(violations)
        return bool(trips)

    def _note_all(self, violations: Iterable[Violation]) -> None:
        for violation in violations:
            lock = violation.interlock
            self._note_if_possible(lock.action, interlock=lock.name, text=violation.text)

    def _refuse_broken(self, violations: Iterable[Violation]) -> None:
        """End the task where one of them does; a trip goes before a stop."""
        for violation in violations:
            if violation.interlock.action in ("trip", "stop"):
                self.latch.check()
                raise StoppedError(f"{violation.text}; the run was stopped")

    def _wait_for_holds(self) -> None:
        self._wait_for_interlocks()
        if self._operator.hold_asked:
            self._wait_for_operator()

    def _wait_for_operator(self) -> None:
        self._note("hold", by="operator")
        self._operator.holding(True)
        if self._daq.promises.timing == "virtual":
            self._operator.wait(self._protection.patience_s)
        else:
            self._stand_while_held()
        self._operator.holding(False)
        self._note("resume", by="operator")

    def _stand_while_held(self) -> None:
        waited_s = 0.0
        while self._operator.hold_asked:
            if waited_s >= self._protection.patience_s:
                raise patience_over(waited_s)
            self._stand(self._protection.block_s)
            waited_s += self._protection.block_s
        self._wait_for_interlocks()

    def _wait_for_interlocks(self) -> None:
        waited_s = 0.0
        while (holding := self._watches.holding) is not None:
            if waited_s >= self._protection.patience_s:
                raise StoppedError(
                    f"interlock '{holding.name}' held the run for {waited_s:g} s; allowed: {holding.allowed}; the run "
                    "was stopped"
                )
            self._stand(self._protection.block_s)
            waited_s += self._protection.block_s

    def _stand(self, duration_s: float) -> Block:
        """Read one block with every output where it stands."""
        rate_hz = self._protection.rate_hz
        samples = max(1, round(duration_s * rate_hz))
        levels = {name: np.full(samples, level) for name, level in self.levels.items()}
        (still,) = self._limits.admit([Waveform(rate_hz, levels)])
        return joined(list(self._played(still, samples)))

    def _ramp_down(self) -> None:
        safe = {name: channel.safe for name, channel in self.outputs.items()}
        ramps, order, rate_hz = self._protection.ramps_per_s, self._protection.shutdown_order, self._ramp_rate_hz
        are_there = all(self.levels[name] == safe[name] for name in (*ramps, *order))
        if self._operator.stop_asked or self._clock.slept_s or are_there:
            return  # after a sleep nobody knows where a ramp would have to begin
        path = way_to(safe, self.levels, ramps, rate_hz, order)
        if path is None or not self._stand_as_left((*ramps, *order)):
            return
        self.output_states.driving(path)
        with closing_blocks(self._daq.play(path, self._protection.block_samples(rate_hz))) as blocks:
            for block in blocks:
                if self._operator.stop_asked:
                    return
                violations = self._watches.judge(block)
                if self._tripped(violations, block):
                    return
                self._live()
                self._keep_if_possible(block)
                self._note_all(violations)

    def _stand_as_left(self, names: Collection[str]) -> bool:
        """Whether every device that can be asked answers, and these outputs stand where they were left.

        After a lost answer, which a signal may have covered, a device may have restarted: a ramp from where it does not
        stand would drive it away. One that says only that it is away gives an answer.
        """
        for name, answer in self._daq.read_back().items():
            if not answer.can or answer.is_away:
                continue
            if answer.at is None:
                return False
            if name in names and not stands_at(self.levels[name], answer.at, self.outputs[name]):
                return False
        return True

    @property
    def _ramp_rate_hz(self) -> float:
        """In coarser steps on a link that has become slow: the way down shall not take longer."""
        takes_s = self._daq.promises.sample_s or 0.0
        planned_hz = self._protection.rate_hz
        return planned_hz if takes_s * planned_hz <= 1.0 else 0.5 / takes_s

    def _note_if_possible(self, event: str, **details: str) -> None:
        with suppress(Exception):
            self._note(event, **details)


def is_end(error: BaseException) -> bool:
    """Whether an error that comes out of a task ends the run.

    What was refused before its first sample does not, nor a reader who leaves a stream early.
    """
    return not isinstance(error, InputError | GeneratorExit)


def _refuse_no_number(block: Block, watched: frozenset[str]) -> None:
    """A channel without any measurement ends the run, unless an interlock watches it and decides how long it may."""
    for name, values in block.inputs.items():
        if name not in watched and not is_measured(values) and np.isnan(values).any():
            at_s = float(block.time_s[int(np.argmax(np.isnan(values)))])
            why = block.invalid_reasons.get(name, "dead sensor or device")
            raise LinkError(f"'{name}' has no measurement at {at_s:.3f} s: {why}")
