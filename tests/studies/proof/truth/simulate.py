"""Run a plant with laws concealed in it: the noise-free output and intermediate channels at each sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import solver
from .catalog import all_laws
from .compiled import compiled
from .law import Array, Hidden, row
from .memory import LAW_MEMORY, LAW_SIGNATURE, LAWS_AT_ONCE, PLANT_MEMORY, PLANT_SIGNATURE
from .plant import Plant

SAMPLE_S = 0.004
SUBSTEPS = 40
"""Steps of 0.1 ms."""


@dataclass(frozen=True, slots=True)
class Unit:
    """One individual of a plant, with what is concealed in it."""

    plant: Plant
    parameters: Mapping[str, float]
    hidden: tuple[Hidden, ...] = ()


@dataclass(frozen=True, slots=True)
class Loop:
    """The position loop that keeps an axis on its stroke while it is recorded."""

    proportional_n_m: float = 40_000.0
    derivative_ns_m: float = 2_500.0
    limit_n: float = 900.0
    resolution_n: float = 1000.0 / 32768.0


def nothing(x: float, a: float, b: float, r: Any) -> float:
    return x


def respond(unit: Unit, command: Array, key: float = 0.0, seed: int = 0, substeps: int = SUBSTEPS) -> Array:
    """Return noise-free samples, shape (samples, channels), on a command in input units.

    Args:
        unit: The unit.
        command: Recorded command samples, held for 4 ms each.
        key: Number of the recording, for chance inside laws.
        seed: Seed of chance in what happens to samples.
        substeps: Solver steps a sample.
    """
    applied = _before(unit, command, seed)
    plant, laws, records = _prepared(unit, key, applied[0])
    y = np.zeros((len(command), len(unit.plant.channels)))
    times = (SAMPLE_S, substeps, unit.plant.settle_s, _delay_s(unit))
    solver.integrate(compiled(unit.plant.equations, PLANT_SIGNATURE), plant, laws, records, applied, y, times)
    return y


def track(
    unit: Unit, reference: Array, blur: Array, key: float = 0.0, loop: Loop = Loop(), substeps: int = SUBSTEPS
) -> tuple[Array, Array]:  # fmt: skip
    """Return the force that a position loop commands to follow a reference, and the noise-free samples."""
    plant, laws, records = _prepared(unit, key, 0.0)
    force, y = np.zeros(len(reference)), np.zeros((len(reference), len(unit.plant.channels)))
    gains = (loop.proportional_n_m, loop.derivative_ns_m, loop.resolution_n, loop.limit_n)
    times = (SAMPLE_S, substeps, *gains, _delay_s(unit))
    equations = compiled(unit.plant.equations, PLANT_SIGNATURE)
    solver.track(equations, plant, laws, records, reference, blur, force, y, times)
    return force, y


def displayed(unit: Unit, values: Array, seed: int) -> Array:
    """Return output samples as they arrive in the recording."""
    rng = np.random.default_rng([seed, 2])
    for hidden in unit.hidden:
        after = all_laws()[hidden.law].after
        if after is not None:
            values = after(values, SAMPLE_S, hidden.parameters, rng)
    return values


def _delay_s(unit: Unit) -> float:
    return float(unit.parameters.get("dead_time", 0.0))


def _before(unit: Unit, command: Array, seed: int) -> Array:
    rng = np.random.default_rng([seed, 1])
    for hidden in unit.hidden:
        before = all_laws()[hidden.law].before
        if before is not None:
            command = before(command, SAMPLE_S, hidden.parameters, rng)
    return np.ascontiguousarray(command, dtype=np.float64)


def _prepared(unit: Unit, key: float, command: float) -> tuple[Any, tuple[Any, ...], Any]:
    """Return the plant's record at rest, the compiled laws and their records."""
    acting = [hidden for hidden in unit.hidden if all_laws()[hidden.law].equation is not None]
    if len(acting) > LAWS_AT_ONCE:
        raise ValueError(f"{len(acting)} laws at once, {LAWS_AT_ONCE} are possible")
    records = np.zeros(len(acting), LAW_MEMORY)
    for record, hidden in zip(records, acting, strict=True):
        record["slot"] = all_laws()[hidden.law].slot(unit.plant.name)
        record["p"] = row(hidden, key)
    plant = np.zeros(1, PLANT_MEMORY)
    constants = unit.plant.row(unit.parameters)
    states = unit.plant.start(constants, command)
    plant[0]["c"][: len(constants)] = constants
    plant[0]["s"][: len(states)] = states
    return plant[0], _laws(acting), records


def _laws(acting: Sequence[Hidden]) -> tuple[Any, ...]:
    functions = [compiled(all_laws()[hidden.law].equation, LAW_SIGNATURE) for hidden in acting]
    return (*functions, *[compiled(nothing, LAW_SIGNATURE)] * (LAWS_AT_ONCE - len(functions)))
