"""One sine in a gapless stream, listened to until the response is steady and long enough to be measured.

A task that ends and a new one that begins leave a gap in which the command stands still, and the response
needs to settle again. Here the sine goes on until it has been measured; only then does it show which samples
belong to the measurement, and they are marked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.sine_fit import SineFit, sine_fit, sine_phasor
from hil.signals.steady import is_steady
from procedures._run_sequence import RunSequence

_HARMONICS = 5
_LEAST_TURNS = 2
_STALLED = 0.02  # share by which a turn may last longer or shorter than planned


@dataclass(frozen=True, slots=True)
class Tone:
    """A sine about a bias, in the unit of the command."""

    frequency_hz: float
    amplitude: float
    bias: float


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a sine is listened to.

    It is judged in turns of whole periods, each at least a quarter of the valve's settling time.

    Attributes:
        settling_s: of the valve.
        periods, seconds: the least that is measured.
        tolerance: change of the response still to come, as a share of it, at which it counts as steady.
        longest_wait_s: after so long it is measured as it is.
    """

    settling_s: float
    periods: int
    seconds: float
    tolerance: float
    longest_wait_s: float

    @property
    def lead_s(self) -> float:
        """Before the first turn: the worst of the transient."""
        return self.settling_s / 2.0

    @property
    def piece_s(self) -> float:
        """What is handed out at a time; one such piece too many is played at the end."""
        return self.settling_s / 4.0

    def turn_periods(self, frequency_hz: float) -> int:
        """Periods of one turn."""
        return max(1, math.ceil(frequency_hz * self.piece_s - 1e-9))

    def turns(self, frequency_hz: float) -> int:
        """How many turns are measured."""
        periods = max(self.periods, math.ceil(self.seconds * frequency_hz - 1e-9))
        return max(_LEAST_TURNS, math.ceil(periods / self.turn_periods(frequency_hz)))

    def expected_s(self, frequency_hz: float) -> float:
        """Bench time of one sine that is steady at once."""
        measured_s = self.turns(frequency_hz) * self.turn_periods(frequency_hz) / frequency_hz
        return self.lead_s + measured_s + self.piece_s


@dataclass(frozen=True, slots=True)
class Heard:
    """What a sine brought.

    Attributes:
        response: output over command, in output unit per command unit.
        steady: whether it became steady in time. `waited_s`: until it did, from its beginning.
        phase_rad: of the command where it ended; the next sine goes on from there.
    """

    response: complex
    steady: bool
    waited_s: float
    phase_rad: float


def listen(rig: Rig, sequence: RunSequence, tone: Tone, patience: Patience, phase_rad: float, text: str) -> Heard:
    """Drive a sine until it has been measured; its samples are marked as a part of kind "sine"."""
    ear = _Ear(tone, patience, sequence.rate_hz, phase_rad, rig.response.name)
    sequence.say(text)
    for piece in rig.stream(ear.pieces(), sequence.rate_hz):
        if measured := ear.take(piece):
            heard = ear.heard()
            part = {"kind": "sine", "frequency_hz": tone.frequency_hz, "amplitude": tone.amplitude, "bias": tone.bias}
            details = {"steady": heard.steady, "waited_s": round(heard.waited_s, 6), "response": heard.response}
            rig.mark(measured, {**part, **details})
    return ear.heard()


def heard_before(rig: Rig, tone: Tone) -> Heard | None:
    """What a sine brought in the run that this one resumes; None when it was not measured there."""
    for part in rig.finished:
        asked = (part.get("frequency_hz"), part.get("amplitude"), part.get("bias"))
        if part.get("kind") == "sine" and asked == (tone.frequency_hz, tone.amplitude, tone.bias):
            return Heard(complex(*part["response"]), part["steady"], part["waited_s"], 0.0)
    return None


def steady_path(tones: Sequence[Tone], patience: Patience, rate_hz: float) -> Array:
    """The command of sines that are steady at once, one after another, for a check beforehand.

    Each reaches its crests, which may fall between samples here and on one when it lasts longer.
    """
    phase_rad, made = 0.0, []
    for tone in tones:
        count = max(1, round(patience.expected_s(tone.frequency_hz) * rate_hz))
        wave = _wave(tone, 0, count, rate_hz, phase_rad)
        wave[[np.argmin(wave), np.argmax(wave)]] = tone.bias - tone.amplitude, tone.bias + tone.amplitude
        made.append(wave)
        phase_rad += 2.0 * math.pi * tone.frequency_hz * count / rate_hz
    return np.concatenate(made)


class _Ear:
    """Hands out pieces of a sine, takes back what they brought, and knows when that is enough."""

    def __init__(self, tone: Tone, patience: Patience, rate_hz: float, phase_rad: float, response: str) -> None:
        self._tone, self._patience, self._rate_hz = tone, patience, rate_hz
        self._turns, self._turn_periods = patience.turns(tone.frequency_hz), patience.turn_periods(tone.frequency_hz)
        self._phase_rad = phase_rad
        self._response = response
        self._sent = 0
        self._start_s: float | None = None
        self._time_s, self._values = np.empty(0), np.empty(0)
        self._fits: list[SineFit] = []
        self._phasors: list[complex] = []
        self._first: int | None = None
        self._steady = True

    def pieces(self) -> Iterator[Array]:
        """The lead and the fewest turns, then further ones, each in a short piece and the rest, until enough was heard.

        While the short one plays, the turns before are judged; those that are measured anyhow then come in one.
        """
        turn = _LEAST_TURNS
        yield self._next(self._lead + self._edge(turn))
        while not self._done:
            first = self._first_piece(turn)
            yield self._next(first)
            if self._done:
                return
            until = max(turn + 1, 0 if self._first is None else self._first + self._turns)
            if rest := self._edge(until) - self._edge(turn) - first:
                yield self._next(rest)
            turn = until

    def take(self, piece: Recording) -> int:
        """Take what a piece brought; the number of samples to be marked when the measurement is whole, else 0."""
        if self._done:
            return 0
        first = self._lead if self._start_s is None else 0
        if self._start_s is None:
            self._start_s = float(piece.time_s[0])
        self._time_s = np.concatenate((self._time_s, piece.stamps(self._response)[first:]))
        self._values = np.concatenate((self._values, piece.values(self._response)[first:]))
        while not self._done and (length := self._whole_turns()):
            self._judge(self._judged_s(self._time_s[:length]), self._values[:length])
            self._time_s, self._values = self._time_s[length:], self._values[length:]
        return self._edge(len(self._phasors)) - self._edge(self._first or 0) if self._done else 0

    def heard(self) -> Heard:
        """What was measured."""
        first, omega = self._first or 0, 2.0 * math.pi * self._tone.frequency_hz
        given = self._tone.amplitude * np.exp(1j * (self._phase_rad - omega * (self._start_s or 0.0)))
        answer = np.mean(self._phasors[first:])
        waited_s = self._patience.lead_s + self._edge(first) / self._rate_hz
        ended_rad = math.fmod(self._phase_rad + omega * self._sent / self._rate_hz, 2.0 * math.pi)
        return Heard(complex(answer / given), self._steady, waited_s, ended_rad)

    @property
    def _lead(self) -> int:
        return max(1, round(self._patience.lead_s * self._rate_hz))

    @property
    def _done(self) -> bool:
        return self._first is not None and len(self._phasors) - self._first >= self._turns

    def _whole_turns(self) -> int:
        """Samples of the next turn, or of all that have come once the response is steady; 0 while none is whole."""
        done = len(self._phasors)
        until = done + 1 if self._first is None else self._first + self._turns
        while until > done and self._edge(until) - self._edge(done) > len(self._time_s):
            until -= 1
        return self._edge(until) - self._edge(done)

    def _judge(self, time_s: Array, values: Array) -> None:
        """Fit the turn that has come, and compare it with those before; steady ones are fitted together."""
        if self._first is not None:
            turns = round(len(time_s) / self._length(len(self._phasors)))
            phasor = sine_phasor(time_s, values, self._tone.frequency_hz, harmonics=_HARMONICS)
            self._phasors += [phasor] * turns
            return
        self._fits.append(sine_fit(time_s, values, self._tone.frequency_hz, harmonics=_HARMONICS))
        self._phasors.append(self._fits[-1].phasor)
        if is_steady(self._fits, self._patience.tolerance):
            self._first = len(self._fits) - 2
        elif self._edge(len(self._fits)) / self._rate_hz >= self._patience.longest_wait_s:
            self._first, self._steady = len(self._fits) - 1, False

    def _judged_s(self, stamps_s: Array) -> Array:
        """Stamps of a turn; those that were planned where a host that stalled has stretched or squeezed it.

        A turn that does not last as long as its periods cannot be fitted with harmonics. What is reported is fitted
        to the whole measurement, at the stamps as they were.
        """
        planned_s = stamps_s[0] + np.arange(len(stamps_s)) / self._rate_hz
        lasted = (stamps_s[-1] - stamps_s[0]) / (planned_s[-1] - planned_s[0])
        return stamps_s if abs(lasted - 1.0) <= _STALLED else planned_s

    def _edge(self, turn: int) -> int:
        """Sample, counted from the first turn, at which a turn begins."""
        return round(turn * self._turn_periods * self._rate_hz / self._tone.frequency_hz)

    def _length(self, turn: int) -> int:
        return self._edge(turn + 1) - self._edge(turn)

    def _first_piece(self, turn: int) -> int:
        """How long it is: about `Patience.piece_s`, as one of equal pieces."""
        length = self._length(turn)
        return round(length / max(1, round(length / (self._patience.piece_s * self._rate_hz))))

    def _next(self, samples: int) -> Array:
        wave = _wave(self._tone, self._sent, samples, self._rate_hz, self._phase_rad)
        self._sent += samples
        return wave


def _wave(tone: Tone, first: int, samples: int, rate_hz: float, phase_rad: float) -> Array:
    turn = 2.0 * math.pi * tone.frequency_hz / rate_hz
    return tone.bias + tone.amplitude * np.sin(turn * np.arange(first, first + samples) + phase_rad)
