"""Limits of all outputs of a bench, and what each output has done so far."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from hil.arrays import ROUNDING
from hil.clock import Clock
from hil.daq.contract import Daq, Waveform
from hil.errors import RangeError
from hil.safety.envelope import Envelope, Past


class Limits:
    """The envelope of every output of a backend; an output that is not named has the range of its device.

    Between tasks an output stands at its level, and its dwell goes on by the clock.
    """

    def __init__(self, daq: Daq, envelopes: Mapping[str, Envelope], clock: Clock) -> None:
        whole = {name: Envelope(channel.low, channel.high) for name, channel in daq.outputs.items()}
        self._envelopes = {name: e.tightened(envelopes.get(name, e)) for name, e in whole.items()}
        self._daq = daq
        self._clock = clock
        self._pasts = {name: e.start(daq.levels[name]) for name, e in self._envelopes.items()}
        self._seen_s = clock.now_s

    @property
    def envelopes(self) -> dict[str, Envelope]:
        """The limits in force, by output."""
        return dict(self._envelopes)

    def tighten(self, name: str, limits: Envelope) -> None:
        """Narrow the limits of an output; there is no way to widen them.

        Raises:
            RangeError: nothing would be left, or not the output's safe value or the level at which it stands.
        """
        tightened = self._envelopes[name].tightened(limits)
        for what, value in (("safe value", self._daq.outputs[name].safe), ("present level", self._daq.levels[name])):
            if not tightened.low <= value <= tightened.high:
                raise RangeError(
                    f"output '{name}': limits {tightened.low:g} … {tightened.high:g} leave out its {what} {value:g}"
                )
        self._envelopes[name] = tightened

    def check(self, waveform: Waveform) -> None:
        """Raise `RangeError` if any sample would leave its envelope."""
        self._admitted(waveform, self._pasts_now())

    def admit(self, waveforms: Iterable[Waveform]) -> Iterator[Waveform]:
        """The waveforms of one task, each checked whole before it is handed on, rounding trimmed off.

        Raises:
            RangeError: a sample would leave its envelope, given everything before it.
        """
        self._pasts = self._pasts_now()
        for waveform in waveforms:
            admitted, self._pasts = self._admitted(waveform, self._pasts)
            yield admitted

    def seen(self) -> None:
        """Say that the outputs have been driven until now."""
        self._seen_s = self._clock.now_s

    def _admitted(self, waveform: Waveform, pasts: Mapping[str, Past]) -> tuple[Waveform, dict[str, Past]]:
        outputs, after = {}, dict(pasts)
        for name, values in waveform.outputs.items():
            if name not in self._envelopes:
                raise RangeError(f"no output '{name}'; this bench drives: {', '.join(self._envelopes)}")
            values = np.asarray(values, dtype=np.float64)
            outputs[name], after[name] = self._envelopes[name].admit(
                values, waveform.rate_hz, pasts[name], name=name, unit=self._daq.outputs[name].unit
            )
        return Waveform(waveform.rate_hz, outputs), after

    def _pasts_now(self) -> dict[str, Past]:
        stood_s = self._clock.now_s - self._seen_s
        levels = self._daq.levels
        return {name: self._past_now(name, past, levels[name]).held_for(stood_s) for name, past in self._pasts.items()}

    def _past_now(self, name: str, past: Past, level: float) -> Past:
        if math.isclose(level, past.value, rel_tol=ROUNDING, abs_tol=ROUNDING):
            return past
        return self._envelopes[name].start(level)  # a task was cut short
