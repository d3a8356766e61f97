"""The guard: the DAQ that wraps every DAQ. Nothing reaches an output but through it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress

import numpy as np

from hil.clock import Clock, VirtualClock, refuse_after_sleep
from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.contract import Block, Daq, Promises, Waveform, closing_blocks
from hil.errors import HardwareError, LinkError, RangeError, StoppedError, StorageError
from hil.safety.envelope import Envelope
from hil.safety.interlock import Violation, Watches
from hil.safety.interrupt import uninterrupted
from hil.safety.latch import Latch
from hil.safety.limits import Limits
from hil.safety.protection import Protection
from hil.safety.ramp import way_to


class Guard:
    """A backend behind its limits and interlocks. Itself a `Daq`, in engineering units.

    Every waveform is checked whole before its first sample, every block as soon as it is read. Whatever ends a
    task before its end (a violation, an error, Ctrl-C, a reader that leaves early) makes the outputs safe
    before it is raised. Opening a guard makes them safe too.

    Args:
        daq: the backend, in engineering units.
        protection: its limits and interlocks.
        latch: what has tripped; outlives the guard where it has a file.
        clock: by which outputs stand at their level between tasks.
        keep: takes every block, whatever it was played for, before it is judged: the recording.
        note: takes every event (`note(name, **details)`): an indication, a hold, a stop, a trip.
        beat: the sign of life for a watchdog, told whether outputs are driven; given before a task, with each
            block, and when outputs are safe. What it raises ends the task.
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
    ) -> None:
        daq.make_safe()
        self.latch = latch or Latch()
        self._daq = daq
        self._protection = protection
        self._clock = clock or VirtualClock()
        self._limits = Limits(daq, protection.envelopes, self._clock)
        self._watches = Watches(protection.interlocks)
        self._keep = keep
        self._note = note
        self._beat = beat
        self._over = ""
        self._unrecorded: StorageError | None = None
        self._looked = False

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
        if rate_hz * self._protection.block_s < 1.0 - 1e-9:
            raise RangeError(
                f"sample rate {rate_hz:g} Hz: a sample each {1.0 / rate_hz:.4g} s, and block_s = "
                f"{self._protection.block_s:g} s promises that inputs are judged more often"
            )
        return rate_hz

    def tighten(self, name: str, limits: Envelope) -> None:
        """Narrow the limits of an output for as long as the guard lives (see `Limits.tighten`)."""
        self._limits.tighten(name, limits)

    def check(self, waveform: Waveform) -> None:
        """Raise `RangeError` if any sample would leave the envelope; drives nothing."""
        self._limits.check(waveform)

    def ready(self) -> None:
        """Wait until a waveform may be played: nothing has tripped, no `hold` is in force.

        The first time, the bench is looked at with its outputs where they stand, so that no output moves
        before every interlock has been judged.

        Raises:
            TrippedError, StoppedError: an interlock tripped or stopped the run, now or before.
        """
        with self._safe_on_error():
            self.latch.check()
            if self._over:
                raise StoppedError(f"{self._over}; this run is over")
            if not self._looked:
                self._looked = True
                self._stand(self._protection.look_s)
            self._wait_for_holds()

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
            yield from self._judged(self._daq.play(admitted, samples))

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
        """Bring every output to its safe value, down its ramp where it has one; cannot be interrupted."""
        with uninterrupted():
            try:
                self._ramp_down()
            except HardwareError as error:
                self._note_if_possible("ramp to safe failed", error=str(error))
            self._daq.make_safe()
            with suppress(HardwareError):
                self._beat(False)

    def close(self) -> None:
        """Make safe and let go of the device. May be called twice.

        Raises:
            TrippedError: an interlock tripped on the way.
            StorageError: the way could not be recorded, and nothing else went wrong.
        """
        tripped = self.latch.trips
        with uninterrupted():
            try:
                self.make_safe()
            finally:
                self._daq.close()
        if self.latch.trips != tripped:
            self.latch.check()
        if self._unrecorded is not None and sys.exception() is None:
            unrecorded, self._unrecorded = self._unrecorded, None
            raise unrecorded

    @contextmanager
    def _safe_on_error(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            self.make_safe()
            raise

    def _judged(self, blocks: Iterator[Block]) -> Iterator[Block]:
        self._beat(True)
        with closing_blocks(blocks):
            for block in blocks:
                self._beat(True)
                self._keep(block)
                refuse_after_sleep(self._clock)
                self._limits.seen()
                for violation in self._watches.judge(block, self._blind_s(block)):
                    self._act(violation)
                _refuse_no_number(block, self._watches.ended_by)
                yield block
        self._beat(any(channel.safe != self.levels[name] for name, channel in self.outputs.items()))

    def _pieces(self, waveforms: Iterable[Waveform]) -> Iterator[Waveform]:
        for waveform in waveforms:
            yield from waveform.slices(self._protection.block_samples(waveform.rate_hz))

    def _act(self, violation: Violation) -> None:
        lock = violation.interlock
        if lock.action == "trip":
            with uninterrupted():
                self._daq.make_safe()
                self.latch.trip(lock.name, violation.text)
        self._note_if_possible(lock.action, interlock=lock.name, text=violation.text)
        if lock.action in ("trip", "stop"):
            self._over = violation.text
            self.latch.check()
            raise StoppedError(f"{violation.text}; the run was stopped, outputs are safe")

    def _wait_for_holds(self) -> None:
        waited_s = 0.0
        while (holding := self._watches.holding) is not None:
            if waited_s >= self._protection.patience_s:
                self._over = f"interlock '{holding.name}' held the run for {waited_s:g} s; allowed: {holding.allowed}"
                raise StoppedError(f"{self._over}; the run was stopped, outputs are safe")
            self._stand(self._protection.block_s)
            waited_s += self._protection.block_s

    def _stand(self, duration_s: float) -> None:
        """Read one block with every output where it stands."""
        rate_hz = self._protection.rate_hz
        samples = max(1, round(duration_s * rate_hz))
        levels = {name: np.full(samples, level) for name, level in self.levels.items()}
        (still,) = self._limits.admit([Waveform(rate_hz, levels)])
        for _ in self._judged(self._daq.play(still, samples)):
            pass

    def _ramp_down(self) -> None:
        safe = {name: channel.safe for name, channel in self.outputs.items()}
        ramps, rate_hz = self._protection.ramps_per_s, self._ramp_rate_hz
        if self._clock.slept_s or all(self.levels[name] == safe[name] for name in ramps):
            return  # after a sleep nobody knows where a ramp would have to begin
        path = way_to(safe, self.levels, ramps, rate_hz)
        if path is None:
            return
        with closing_blocks(self._daq.play(path, self._protection.block_samples(rate_hz))) as blocks:
            for block in blocks:
                with suppress(HardwareError):
                    self._beat(True)
                try:
                    self._keep(block)
                except StorageError as error:  # said when the outputs are safe
                    self._unrecorded = error
                for violation in self._watches.judge(block):
                    self._note_if_possible(violation.interlock.action, text=violation.text)
                    if violation.interlock.action == "trip":
                        self.latch.trip(violation.interlock.name, violation.text)
                        return

    def _blind_s(self, block: Block) -> float:
        """How long the next reading will take on a link that is slower than its sample rate."""
        return self._daq.promises.sample_s or 0.0 if block.late else 0.0

    @property
    def _ramp_rate_hz(self) -> float:
        """In coarser steps on a link that has become slow: the way down shall not take longer."""
        takes_s = self._daq.promises.sample_s or 0.0
        planned_hz = self._protection.rate_hz
        return planned_hz if takes_s * planned_hz <= 1.0 else 0.5 / takes_s

    def _note_if_possible(self, event: str, **details: str) -> None:
        with suppress(StorageError):
            self._note(event, **details)


def _refuse_no_number(block: Block, watched: frozenset[str]) -> None:
    """A channel without any measurement ends the run, unless an interlock watches it and decides how long it may."""
    for name, values in block.inputs.items():
        wrong = np.isnan(values)
        if name not in watched and wrong.any():
            at_s = float(block.time_s[int(np.argmax(wrong))])
            raise LinkError(f"'{name}' has no measurement at {at_s:.3f} s: dead sensor or device")
