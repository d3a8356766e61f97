"""A plant that runs as time goes on, tick by tick, whatever drives it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hil.physics.model import Model
from hil.physics.simulate import Twin
from hil.record.recording import Array


class World:
    """The plant behind simulated devices.

    Ticks are the instants at which outputs may change. Between two of them the plant runs at its own
    sub-steps, its inputs held. Results do not depend on how many ticks are asked for at once.

    Args:
        model: the plant with its values and effects.
        tick_s: from one tick to the next.
        inputs: what drives the plant when the world begins, in its units; it has settled under it.

    Attributes:
        ticks: how many have passed.
    """

    def __init__(self, model: Model, tick_s: float, inputs: Mapping[str, float]) -> None:
        plant = model.definition
        self._input_names = tuple(signal.name for signal in plant.inputs)
        self._output_names = (plant.output.name, *(signal.name for signal in plant.observed))
        self.ticks = 0
        self._twin = Twin(plant, model.values, tick_s, model.active_effects, read_at=1.0)
        self._held = np.array([[inputs[name]] for name in self._input_names])
        self._seen = np.full((len(self._output_names), 1), np.nan)
        self.advance({name: np.array([inputs[name]]) for name in self._input_names})
        self.ticks = 0

    def advance(self, inputs: Mapping[str, Array]) -> Signals:
        """Run for n ≥ 1 ticks under inputs of shape (n,), in the plant's units."""
        rows = np.array([inputs[name] for name in self._input_names])
        held = np.concatenate((self._held, rows), axis=1)
        seen = np.concatenate((self._seen, self._twin.advance(rows)), axis=1)
        self._held, self._seen = held[:, -1:], seen[:, -1:]
        self.ticks += rows.shape[1]
        return Signals(
            dict(zip(self._input_names, held, strict=True)), dict(zip(self._output_names, seen, strict=True))
        )

    def checkpoint(self) -> Callable[[], None]:
        """Keep how it stands; what is returned takes it back there."""
        twin, ticks, held, seen = self._twin.checkpoint(), self.ticks, self._held, self._seen

        def roll_back() -> None:
            twin()
            self.ticks, self._held, self._seen = ticks, held, seen

        return roll_back


@dataclass(frozen=True, slots=True)
class Signals:
    """Every signal of the plant over n ticks: its value just before each tick and at the end, shape (n + 1,).

    Inputs are `held` from tick to tick; all others `run`, straight enough between ticks that are no longer than
    the sub-step of the plant.
    """

    held: Mapping[str, Array]
    running: Mapping[str, Array]

    def read(self, name: str, delay: float, every: int, samples: int) -> Array:
        """A signal at ticks 0, `every`, 2·`every`, …, each read `delay` ticks later; shape (samples,).

        What is held changes just after its tick.
        """
        whole = int(delay)
        part = delay - whole
        values = self.held[name] if name in self.held else self.running[name]
        before = values[whole::every][:samples]
        if part == 0.0:
            return before
        after = values[whole + 1 :: every][:samples]
        return after if name in self.held else before + part * (after - before)
