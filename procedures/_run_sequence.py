"""The sequence of a run: checked whole before anything moves, begun and ended at neutral, its duration known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hil.record.recording import Array
from hil.rig import Rig
from hil.signals.ramps import ramp
from procedures._scale import Scale, check_at_least

_PIECE_S = 5.0  # of a long command, which is not in memory as a whole
_SAMPLES, _SETTLINGS = 1000, 4.0  # least of a sweep: samples, and settling times of the valve


class RunSequence:
    """What a procedure drives, from neutral and back: the path that was checked, and how far the run is.

    Args:
        rig: what is driven.
        rate_hz: sample rate of everything that is driven.
        path: the command of the whole run, from neutral on, ramps included; shape (n,). It is checked, and the
            limits are narrowed to it for the rest of the run.
        plan: what is going to be done, for the record.
        further_s: what is driven beyond the path, of which it shows a sample, in s.

    Raises:
        RangeError: a sample of the path would leave the envelope; nothing has moved.
    """

    def __init__(self, rig: Rig, rate_hz: float, path: Array, plan: Mapping[str, Any], further_s: float = 0.0) -> None:
        self.rate_hz = rate_hz
        self._rig = rig
        self._expected_s = len(path) / rate_hz + further_s
        rig.check(path, rate_hz)
        neutral = rig.command.safe
        rig.tighten(min(float(path.min()), neutral), max(float(path.max()), neutral))
        rig.note("plan", expected_s=round(self._expected_s, 1), **plan)
        rig.expect(self._expected_s)

    def go_to(self, level: float) -> None:
        """Ramp to a level and let the valve settle there."""
        self.say(f"to {level:.4g} {self._rig.command.unit}")
        self._rig.ramp_to(level, self.rate_hz)

    def warm_up(self, level: float, duration_s: float) -> None:
        """Go to a level and stay there before anything is measured."""
        self.go_to(level)
        samples = round(duration_s * self.rate_hz)
        if samples:
            self.play(np.full(samples, level), "warming up", {"kind": "warm-up"})

    def play(self, command: Array, text: str, part: Mapping[str, Any] | None = None) -> None:
        """Drive a command without a gap."""
        self.say(text)
        for _ in self._rig.stream(self._pieces(command), self.rate_hz, part=part):
            pass

    def say(self, text: str) -> None:
        """Tell what is being done."""
        self._rig.progress(0.0, text)

    def finish(self) -> None:
        """Back to neutral."""
        self.go_to(self._rig.command.safe)

    def _pieces(self, command: Array) -> Iterator[Array]:
        samples = max(1, round(_PIECE_S * self.rate_hz))
        for first in range(0, len(command), samples):
            yield command[first : first + samples]


def ramped(rig: Rig, start: float, level: float, rate_hz: float) -> Array:
    """What `Rig.ramp_to` needs at most from one level to another: the slowest way there, and settling."""
    slew_per_s = rig.command.slew_per_s
    still = np.full(max(1, round(rig.settling_s * rate_hz)), level)
    if slew_per_s is None or start == level:
        return still
    way = ramp(start, level, max(abs(level - start) / slew_per_s, 1.0 / rate_hz), rate_hz)
    return np.concatenate((way[1:], still))


def joined(rig: Rig, rate_hz: float, warm_up_s: float, pieces: Sequence[Array]) -> Array:
    """The path of a run: neutral, warm-up at the first level, each piece with a ramp to where it begins, neutral."""
    at = rig.command.safe
    path = []
    for i, piece in enumerate(pieces):
        first = float(piece[0])
        path.append(ramped(rig, at, first, rate_hz))
        if i == 0:
            path.append(np.full(round(warm_up_s * rate_hz), first))
        path.append(piece)
        at = float(piece[-1])
    return np.concatenate((*path, ramped(rig, at, rig.command.safe, rate_hz)))


def check_cycle(rig: Rig, cycle_s: float, rate_hz: float) -> None:
    """Raise `SettingError` unless a sweep up and down has enough samples and is slow enough for the valve."""
    check_at_least("cycle_s", max(_SAMPLES / rate_hz, _SETTLINGS * rig.settling_s), cycle_s, "s")


def sweep(rig: Rig, bottom: float, top: float, cycle_s: float, rate_hz: float, cycles: int = 1) -> Array:
    """The command up and down, with a wait of one settling time at each end; `cycle_s` counts the ways only."""
    up, wait = ramp(bottom, top, cycle_s / 2.0, rate_hz), round(rig.settling_s * rate_hz)
    once = (up[1:], np.full(wait, top), up[-2::-1], np.full(wait, bottom))
    return np.concatenate(([bottom], *once * cycles))


def sweep_part(rig: Rig, scale: Scale, bottom: float, top: float, cycle_s: float) -> dict[str, float]:
    """What the evaluation needs to know of such a sweep, as fields of its part."""
    return {
        "cycle_s": cycle_s, "speed_per_s": 2.0 * (top - bottom) / cycle_s, "settling_s": rig.settling_s,
        "neutral": scale.neutral, "span": top - bottom, "full": scale.full,
    }  # fmt: skip
