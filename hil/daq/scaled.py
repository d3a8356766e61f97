"""A DAQ in engineering units: every channel through its calibration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from hil.daq.calibration import Calibration
from hil.daq.channel import InputChannel, OutputChannel
from hil.daq.contract import Block, Daq, Promises, Waveform, closing_blocks


class Scaled:
    """A backend behind the calibrations of its channels. Itself a `Daq`; `calibrations` has every channel."""

    def __init__(self, daq: Daq, calibrations: Mapping[str, Calibration]) -> None:
        self._daq = daq
        self._calibrations = calibrations

    @property
    def promises(self) -> Promises:
        """What the backend keeps."""
        return self._daq.promises

    @property
    def outputs(self) -> Mapping[str, OutputChannel]:
        """The outputs, ranges and safe values in engineering units."""
        return {name: self._scaled_output(channel) for name, channel in self._daq.outputs.items()}

    @property
    def inputs(self) -> Mapping[str, InputChannel]:
        """The inputs, ranges in engineering units."""
        return {name: self._scaled_input(channel) for name, channel in self._daq.inputs.items()}

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

    def make_safe(self) -> None:
        """Put every output at its safe value."""
        self._daq.make_safe()

    def close(self) -> None:
        """Make safe and let go of the device."""
        self._daq.close()

    def _raw(self, waveform: Waveform) -> Waveform:
        raw = {name: self._calibrations[name].to_raw(values) for name, values in waveform.outputs.items()}
        return Waveform(waveform.rate_hz, raw)

    def _values(self, block: Block) -> Block:
        inputs = {name: self._calibrations[name].to_value(raw) for name, raw in block.inputs.items()}
        outputs = {name: self._calibrations[name].to_value(raw) for name, raw in block.outputs.items()}
        return replace(block, inputs=inputs, outputs=outputs)

    def _scaled_output(self, channel: OutputChannel) -> OutputChannel:
        by = self._calibrations[channel.name]
        low, high = by.range_of(channel.low, channel.high)
        return replace(channel, unit=by.unit, low=low, high=high, safe=by.value_at(channel.safe))

    def _scaled_input(self, channel: InputChannel) -> InputChannel:
        by = self._calibrations[channel.name]
        low, high = by.range_of(channel.low, channel.high)
        return replace(channel, unit=by.unit, low=low, high=high)
