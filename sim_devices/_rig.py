"""A plant with the instruments of a bench on it: what outputs drive, and what inputs read."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hil.daq.channel import Wiring
from hil.record.recording import Array
from sim_devices._chain import InputStages, OutputStage
from sim_devices._lines import lines_of
from sim_devices._settings import Settings
from sim_devices._simulation import model_of
from sim_devices._world import Signals, World

_CHUNK_TICKS = 1 << 14


class SimulatedRig:
    """The plant behind terminals, settled under the levels at which their outputs are found.

    Args:
        settings: of converters, clock and world.
        wiring: the channels in use; the simulation has an instrument for each.
        levels: by output.

    Attributes:
        stages: of the outputs.
        inputs: of the inputs.
    """

    def __init__(self, settings: Settings, wiring: Wiring, levels: Mapping[str, float]) -> None:
        model = model_of(settings.simulation)
        lines, instruments = lines_of(model), settings.simulation.instruments
        fitted = {name: (instrument, lines.get(instrument.signal)) for name, instrument in instruments.items()}
        self.stages = {name: OutputStage(c, *fitted[name], settings.bits) for name, c in wiring.outputs.items()}
        self.inputs = InputStages(wiring.inputs, fitted, settings)
        self._tick_s = 1.0 / settings.clock_hz
        driven = {stage.signal for stage in self.stages.values()}
        self._idle = [signal.name for signal in model.definition.inputs if signal.name not in driven]
        rest = self._driven({name: np.array([level]) for name, level in levels.items()}, 1, 1, 0)
        self._world = World(model, self._tick_s, {signal: values[0] for signal, values in rest.items()})

    @property
    def ticks(self) -> int:
        """How many have passed."""
        return self._world.ticks

    def run(self, outputs: Mapping[str, Array], samples: int, every: int = 1) -> Signals:
        """Let time pass under outputs, shape (samples,), each value for so many ticks."""
        return self._world.advance(self._driven(outputs, samples, every, self.ticks))

    def hold(self, levels: Mapping[str, float], ticks: int) -> tuple[Signals, int]:
        """Let n ≥ 1 ticks pass with outputs at their levels; the last signals, and over how many ticks they are."""
        while True:
            some = min(ticks, _CHUNK_TICKS)
            seen = self.run({name: np.full(some, level) for name, level in levels.items()}, some)
            ticks -= some
            if ticks <= 0:
                return seen, some

    def checkpoint(self) -> Callable[[], None]:
        """Keep how plant, power stages and noise stand; what is returned takes them back there."""
        kept = [self._world.checkpoint(), self.inputs.checkpoint(), *(s.checkpoint() for s in self.stages.values())]

        def roll_back() -> None:
            for part in kept:
                part()

        return roll_back

    def _driven(self, outputs: Mapping[str, Array], samples: int, every: int, first_tick: int) -> dict[str, Array]:
        """What acts on the plant, tick by tick; what no output is connected to stays at zero."""
        driven = {stage.signal: stage.drive(outputs[name], every, first_tick, self._tick_s)
                  for name, stage in self.stages.items() if stage.signal}  # fmt: skip
        for name, stage in self.stages.items():
            if stage.powers in driven:
                driven[stage.powers] *= stage.drive(outputs[name], every, first_tick, self._tick_s) != 0.0
        return driven | {signal: np.zeros(every * samples) for signal in self._idle}
