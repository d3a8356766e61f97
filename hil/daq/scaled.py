"""A DAQ in engineering units: every channel through its calibration, and what is no measurement marked as such."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from hil.daq.calibration import Calibration
from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.contract import Block, Daq, Promises, ReadBack, Waveform, closing_blocks
from hil.errors import LinkError
from hil.record.recording import Array

_Channel = TypeVar("_Channel")
_Scaled = tuple[Mapping[str, _Channel], Mapping[str, _Channel]]  # as the backend has them, and in engineering units

_END = 1e-4  # of a range: nearer to its end than that, a converter may have been held there


class Scaled:
    """A backend behind the calibrations of its channels. Itself a `Daq`; `calibrations` has every channel."""

    def __init__(self, daq: Daq, calibrations: Mapping[str, Calibration]) -> None:
        self._daq = daq
        self._calibrations = calibrations
        self._outputs: _Scaled[OutputChannel] = ({}, {})
        self._inputs: _Scaled[InputChannel] = ({}, {})

    @property
    def promises(self) -> Promises:
        """What the backend keeps."""
        return self._daq.promises

    @property
    def outputs(self) -> Mapping[str, OutputChannel]:
        """The outputs, ranges and safe values in engineering units."""
        raw = self._daq.outputs
        if raw is not self._outputs[0]:
            self._outputs = raw, {name: self._scaled_output(channel) for name, channel in raw.items()}
        return self._outputs[1]

    @property
    def inputs(self) -> Mapping[str, InputChannel]:
        """The inputs, ranges in engineering units."""
        raw = self._daq.inputs
        if raw is not self._inputs[0]:
            self._inputs = raw, {name: self._scaled_input(channel) for name, channel in raw.items()}
        return self._inputs[1]

    @property
    def levels(self) -> Mapping[str, float]:
        """Where each output stands, in engineering units."""
        return {name: self._calibrations[name].value_at(raw) for name, raw in self._daq.levels.items()}

    def actual_rate_hz(self, asked_hz: float) -> float:
        """The backend's actual rate."""
        return self._daq.actual_rate_hz(asked_hz)

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        """Finite acquisition in engineering units."""
        with closing_blocks(self._daq.play(self._raw(waveform), block_samples)) as blocks:
            yield from map(self._values, blocks)

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        """Continuous acquisition in engineering units."""
        with closing_blocks(self._daq.stream(map(self._raw, waveforms))) as blocks:
            yield from map(self._values, blocks)

    @property
    def roll_back(self) -> Callable[[int], None] | None:
        """That of the backend (see `Daq`)."""
        return getattr(self._daq, "roll_back", None)

    def look(self, name: str) -> Block:
        """A reading of one input in engineering units (see `Daq`).

        Raises:
            LinkError: the backend cannot ask for one alone.
        """
        if (look := getattr(self._daq, "look", None)) is None:
            raise LinkError("its device reads no input alone")
        return self._values(look(name))

    def make_safe(self) -> None:
        """Put every output at its safe value."""
        self._daq.make_safe()

    def read_back(self) -> Mapping[str, ReadBack]:
        """Where each output stands, in engineering units, asked of the device."""
        return {name: self._scaled_answer(name, answer) for name, answer in self._daq.read_back().items()}

    def close(self) -> None:
        """Make safe and let go of the device."""
        self._daq.close()

    def _raw(self, waveform: Waveform) -> Waveform:
        raw = {name: self._calibrations[name].raw_at(values) for name, values in waveform.outputs.items()}
        return Waveform(waveform.rate_hz, raw, waveform.count)

    def _values(self, block: Block) -> Block:
        channels = self._daq.inputs
        inputs = {
            name: self._calibrations[name].value_at(measured(raw, channels[name])) for name, raw in block.inputs.items()
        }
        outputs = {name: self._calibrations[name].value_at(raw) for name, raw in block.outputs.items()}
        return replace(block, inputs=inputs, outputs=outputs)

    def _scaled_answer(self, name: str, answer: ReadBack) -> ReadBack:
        return answer if answer.at is None else replace(answer, at=self._calibrations[name].value_at(answer.at))

    def _scaled_output(self, channel: OutputChannel) -> OutputChannel:
        by = self._calibrations[channel.name]
        low, high = by.range_of(channel.low, channel.high)
        size = abs(by.slope)
        pwm = channel.pwm and replace(channel.pwm, dither_amplitude=size * channel.pwm.dither_amplitude)
        safe, step = by.value_at(channel.safe), size * channel.step
        return replace(channel, unit=by.unit, low=low, high=high, safe=safe, pwm=pwm, step=step)

    def _scaled_input(self, channel: InputChannel) -> InputChannel:
        by = self._calibrations[channel.name]
        low, high = by.range_of(channel.low, channel.high)
        return replace(channel, unit=by.unit, low=low, high=high, step=abs(by.slope) * channel.step)


def measured(raw: Array, channel: InputChannel) -> Array:
    """Raw readings, infinite where they stand at an end of the channel's range or beyond it.

    There the quantity may be anything outside. Where a converter reads over its range, the end is where it stops.
    Zero is the exception: where a range begins there (0 … 10 V, 0 … 3 A) it is a reading like any other, and one below
    it too.
    """
    if channel.kind == "digital":
        return raw
    further = (channel.over - _END) * (channel.high - channel.low)
    if channel.low - further <= raw.min() and raw.max() <= channel.high + further:  # quicker, and nearly always so
        return raw
    above = raw > channel.high + further if channel.high != 0.0 else np.isposinf(raw)
    below = raw < channel.low - further if channel.low != 0.0 else np.isneginf(raw)
    if not (above.any() or below.any()):
        return raw
    return np.where(above, np.inf, np.where(below, -np.inf, raw))
