"""The frequency response that a bench would measure on a model: a stepped sine, simulated and evaluated.

For a linear model this is its transfer function. With friction, a flow curve or sides of their own it is the
describing function at that amplitude and bias, which is what a frequency-response test reports.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.identification.frequency.measuring_chain import MeasuringChain
from hil.physics.plant import Parameters, Plant
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Array, Complex
from hil.signals.sine_fit import sine_phasor
from hil.signals.stepped_sine import sine

_SETTLE_PERIODS = 2
_SETTLE_S = 1.0
_HARMONICS = 3


@dataclass(frozen=True, slots=True)
class SineTest:
    """A stepped sine made ready: what drives it and how its response is read.

    Attributes:
        frequency_hz: shape (n,). `amplitude`, `bias`: of the command.
        rate_hz: of the samples.
        command: all frequencies one after another, shape (samples,).
        periods: per frequency, where its measured period lies, and the time there since the sine began.
    """

    frequency_hz: Array
    amplitude: float
    bias: float
    rate_hz: float
    command: Array
    periods: tuple[tuple[slice, Array], ...]

    def response(self, plant: Plant, parameters: Parameters, effects: Sequence[ActiveEffect] = ()) -> Complex:
        """Output over command at every frequency, the hold of the command taken out, shape (n,)."""
        drive = Drive(self.command[None, :], math.nan, 1.0 / self.rate_hz)
        output = simulate(plant, parameters, drive, effects)[0]
        found = np.array([
            sine_phasor(time_s, output[part], frequency, harmonics=_HARMONICS)
            for frequency, (part, time_s) in zip(self.frequency_hz.tolist(), self.periods, strict=True)
        ])  # fmt: skip
        return found / self.amplitude / MeasuringChain(hold_s=1.0 / self.rate_hz).at(self.frequency_hz)


def sine_test(frequencies_hz: Sequence[float], amplitude: float, bias: float) -> SineTest:
    """A test at 1 kHz of one measured period per frequency, after two periods and at least a second to settle."""
    rate_hz, blocks, periods, at = 1000.0, [], [], 0
    for frequency in frequencies_hz:
        settle = max(_SETTLE_PERIODS, math.ceil(_SETTLE_S * frequency))
        block = sine(frequency, amplitude, rate_hz, settle + 1, bias=bias)
        first = round(settle * rate_hz / frequency)
        periods.append((slice(at + first, at + len(block)), np.arange(first, len(block)) / rate_hz))
        blocks.append(block)
        at += len(block)
    frequency_hz = np.array(frequencies_hz, dtype=np.float64)
    return SineTest(frequency_hz, amplitude, bias, rate_hz, np.concatenate(blocks), tuple(periods))
