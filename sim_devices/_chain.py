"""What lies between a terminal and the plant: converter, instrument, noise."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.daq.channel import InputChannel, OutputChannel, Pwm
from hil.physics.pwm import PwmDrive
from hil.record.recording import Array
from hil.units import scale_and_offset
from sim_devices._converter import Converter
from sim_devices._lines import Line
from sim_devices._settings import Settings
from sim_devices._simulation import Instrument
from sim_devices._world import Signals


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """A straight line between a plant's signal, in its unit, and a terminal: signal = slope · raw + offset."""

    slope: float
    offset: float

    @classmethod
    def of(cls, instrument: Instrument, line: Line | None) -> Sensitivity:
        """That of an instrument on a line of the plant, whose unit may differ from the instrument's."""
        if line is None or line.unit == "any":
            return cls(instrument.slope, instrument.offset)
        a, b = scale_and_offset(instrument.unit, line.unit)
        return cls(a * instrument.slope, a * instrument.offset + b)


class OutputStage:
    """From the value that a program gives to what acts on the plant.

    Attributes:
        signal: the plant's input that it drives; empty when it goes nowhere.
        powers: the plant's input that acts only while this is not 0; empty for none.
        pwm: carrier and dither of a PWM current output, which may be changed while it drives.
    """

    def __init__(self, channel: OutputChannel, instrument: Instrument, line: Line | None, bits: int) -> None:
        self.signal, self.powers = line.signal if line else "", instrument.powers
        self._sensitivity = Sensitivity.of(instrument, line)
        self._converter = Converter.of(channel.kind, channel.low, channel.high, bits)
        self._low, self._high = channel.low, channel.high
        self._coil, self._pwm = instrument.coil, channel.pwm
        self._drive: PwmDrive | None = None

    @property
    def pwm(self) -> Pwm | None:
        """See the class."""
        return self._pwm

    @pwm.setter
    def pwm(self, given: Pwm | None) -> None:
        if given != self._pwm:
            self._pwm, self._drive = given, None

    def checkpoint(self) -> Callable[[], None]:
        """Keep how the power stage stands; what is returned takes it back there."""
        drive = self._drive
        stood = drive.checkpoint() if drive else lambda: None

        def roll_back() -> None:
            self._drive = drive
            stood()

        return roll_back

    def drive(self, raw: Array, every: int, first_tick: int, tick_s: float) -> Array:
        """The plant's input at each tick, for values that each stand for `every` ticks."""
        values = self._converter.convert(raw)
        if every > 1:
            values = np.repeat(values, every)
        if self.pwm is not None and self.pwm.dither_hz is not None:
            time_s = (first_tick + np.arange(len(values))) * tick_s
            values += self.pwm.dither_amplitude * np.sin(2.0 * math.pi * self.pwm.dither_hz * time_s)
            np.clip(values, self._low, self._high, out=values)  # a current drive neither pulls nor exceeds itself
        if self.pwm is not None and self._coil is not None:
            self._drive = self._drive or self._coil.drive(self.pwm.carrier_hz, float(values[0]))
            values = self._drive.drive(values, tick_s)
        return self._sensitivity.slope * values + self._sensitivity.offset


class InputStages:
    """From the plant to the values that a program reads, all inputs of a device at once.

    Each has noise of its own, drawn sample by sample, so that it does not depend on how samples are cut.

    Args:
        channels: the inputs.
        fitted: the instrument on each, and the line that it reads.
        settings: converters, noise and multiplexer of the device.
    """

    def __init__(
        self,
        channels: Mapping[str, InputChannel],
        fitted: Mapping[str, tuple[Instrument, Line | None]],
        settings: Settings,
    ) -> None:
        chosen = [fitted[name] for name in channels]
        sensitivities = [Sensitivity.of(instrument, line) for instrument, line in chosen]
        converters = [Converter.of(c.kind, c.low, c.high, settings.bits, c.over) for c in channels.values()]
        self._names = tuple(channels)
        self._sources = [line.signal if line else instrument.value or 0.0 for instrument, line in chosen]
        self._pressed_s = [math.inf if i.pressed_s is None else i.pressed_s for i, _ in chosen]
        self._slopes = _column(s.slope for s in sensitivities)
        self._offsets = _column(s.offset for s in sensitivities)
        self._noise_raw = _column(math.hypot(settings.noise_v, i.noise / abs(i.slope)) for i, _ in chosen)
        self._noise = [np.random.default_rng([settings.simulation.seed, zlib.crc32(n.encode())]) for n in channels]
        self._skew = settings.skew_s * settings.clock_hz
        self._converter = Converter(
            _column(c.low for c in converters), _column(c.lsb for c in converters), _column(c.codes for c in converters)
        )

    def read(self, signals: Signals, delay: float, every: int, time_s: Array) -> dict[str, Array]:
        """Readings by input, one every so many ticks, the first input `delay` ticks after its own.

        `time_s` are the device's own times of the samples, shape (n,).
        """
        samples = len(time_s)
        values = np.empty((len(self._names), samples))
        for i, source in enumerate(self._sources):
            at = delay + i * self._skew
            if isinstance(source, str):
                values[i] = signals.read(source, at, every, samples)
            else:
                values[i] = np.where(time_s < self._pressed_s[i], source, 0.0)
        values -= self._offsets
        values /= self._slopes
        if self._noise_raw.any():
            noise = np.empty_like(values)
            for row, generator in zip(noise, self._noise, strict=True):
                generator.standard_normal(out=row)
            noise *= self._noise_raw
            values += noise
        return dict(zip(self._names, self._converter.convert(values), strict=True))

    def checkpoint(self) -> Callable[[], None]:
        """Keep where the noise stands; what is returned takes it back there."""
        states = [generator.bit_generator.state for generator in self._noise]

        def roll_back() -> None:
            for generator, state in zip(self._noise, states, strict=True):
                generator.bit_generator.state = state

        return roll_back


def _column(numbers: Iterable[Any]) -> Array:
    return np.array(list(numbers), dtype=np.float64)[:, None]
