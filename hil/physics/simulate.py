"""Run a plant: recordings in, model output out; or block by block as a live twin."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hil.errors import InputError, UnknownNameError
from hil.physics.compose import Kernel, kernel
from hil.physics.plant import Plant
from hil.record.recording import Array

_NOTHING = np.zeros(1)
_NO_TRACE = np.zeros((1, 1))
_NO_OBSERVER = np.zeros(0)


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect switched on at a hook, with its parameters in the hook's units."""

    name: str
    hook: str
    parameters: Mapping[str, float]

    @property
    def key(self) -> tuple[str, str]:
        """(effect name, hook name)."""
        return self.name, self.hook


@dataclass(frozen=True, slots=True)
class Drive:
    """What drives a simulation, on an even grid.

    Attributes:
        inputs: shape (inputs, n), each value held until the next.
        first_output: sets states that the steady state cannot tell.
        interval_s: of the grid. `read_at` says after which share of it (0…1) the output is sampled:
            0 when command and reading share one clock edge, 1 when the reading follows the update by a sample.
    """

    inputs: Array
    first_output: float
    interval_s: float
    read_at: float = 0.0


@dataclass(frozen=True, slots=True)
class _Laws:
    """What a kernel is told of the plant's parameters, at rest and in motion."""

    of: Kernel
    steady: Array
    coefficients: Array


@dataclass(frozen=True, slots=True)
class _Switches:
    """What a kernel is told of effects: which are on, their coefficients, and where the memory of each begins."""

    of: Kernel
    on: NDArray[np.bool_]
    effect_coefficients: Array
    offsets: NDArray[np.int64]


@dataclass(slots=True)
class _Arrays:
    """Arguments of the kernel for one set of values; it writes to `states` and `memory` alone."""

    step_s: float
    sub_steps: int
    laws: _Laws
    switches: _Switches
    states: Array
    memory: Array


def sub_steps(plant: Plant, interval_s: float, factor: float = 1.0) -> int:
    """Sub-steps per sample at which the plant's page is accurate, times a factor."""
    accurate = max(1, math.ceil(interval_s / plant.sub_step_s - 1e-9))
    return max(1, round(factor * accurate))


def simulate(
    plant: Plant,
    parameters: Mapping[str, float],
    drive: Drive,
    effects: Sequence[ActiveEffect] = (),
    *,
    factor: float = 1.0,
    inject: tuple[str, Array] | None = None,
    trace: Array | None = None,
    measured: Array | None = None,
) -> Array:
    """The plant's output and observed signals, shape (1 + observed, n), from its steady state.

    Args:
        plant: an installed plant.
        parameters: every base parameter by name.
        drive: the inputs.
        effects: those that are switched on.
        factor: finer sub-steps than the plant asks for, to measure the solver's own error, or coarser ones.
        inject: (hook, values) adds a free disturbance of shape (n,) to what passes a hook.
        trace: shape (hooks, n), contiguous, filled with what arrives at each hook.
        measured: shape (n,); the plant's observer leads the simulation back to it, but where it is NaN.

    Raises:
        InputError: no such hook or effect in this plant, or an array of another shape than it needs.
    """
    _check_rows("inputs", drive.inputs, plant, [signal.heading for signal in plant.inputs])
    count = drive.inputs.shape[1]
    hook_names = [hook.name for hook in plant.hooks]
    if trace is not None:
        _check_rows("trace", trace, plant, hook_names, count)
    if inject:
        _check_injected(inject, plant, hook_names, count)
    if measured is not None and measured.shape != (count,):
        raise InputError(f"{plant.name}: a measured output of shape {measured.shape}, must be ({count},)")
    compiled = kernel(plant.name)
    arrays = _arrays(compiled, parameters, drive, effects, sub_steps(plant, drive.interval_s, factor))
    out = np.empty((1 + len(plant.observed), count))
    compiled.run(
        _dense(drive.inputs), arrays.step_s, arrays.sub_steps, round(drive.read_at * arrays.sub_steps), 0, True,
        arrays.laws.steady, arrays.laws.coefficients, arrays.states,
        arrays.switches.on, arrays.switches.effect_coefficients, arrays.memory, arrays.switches.offsets,
        hook_names.index(inject[0]) if inject else -1, _dense(inject[1]) if inject else _NOTHING,
        trace is not None, _NO_TRACE if trace is None else trace,
        _NO_OBSERVER if measured is None else _observer(plant, parameters, drive.interval_s),
        _NOTHING if measured is None else _dense(measured), out,
    )  # fmt: skip
    return out


@dataclass(slots=True)
class Twin:
    """A plant that runs block by block and keeps its state between blocks: the live twin.

    Time is the caller's: `advance` runs exactly as many samples as it is given.
    """

    plant: Plant
    parameters: Mapping[str, float]
    interval_s: float
    effects: tuple[ActiveEffect, ...] = ()
    read_at: float = 0.0
    _arrays: _Arrays | None = field(default=None, init=False)
    _done: int = field(default=0, init=False)

    def advance(self, inputs: Array) -> Array:
        """Outputs, shape (1 + observed, n), for inputs of shape (inputs, n); the first call settles first."""
        _check_rows("inputs", inputs, self.plant, [signal.heading for signal in self.plant.inputs])
        compiled = kernel(self.plant.name)
        settle = self._arrays is None
        if self._arrays is None:
            steps = sub_steps(self.plant, self.interval_s)
            drive = Drive(inputs, math.nan, self.interval_s)
            self._arrays = _arrays(compiled, self.parameters, drive, self.effects, steps)
        a = self._arrays
        out = np.empty((1 + len(self.plant.observed), inputs.shape[1]))
        compiled.run(
            _dense(inputs), a.step_s, a.sub_steps, round(self.read_at * a.sub_steps), self._done, settle,
            a.laws.steady, a.laws.coefficients, a.states,
            a.switches.on, a.switches.effect_coefficients, a.memory, a.switches.offsets,
            -1, _NOTHING, False, _NO_TRACE, _NO_OBSERVER, _NOTHING, out,
        )  # fmt: skip
        self._done += inputs.shape[1] * a.sub_steps
        return out


def _dense(values: Array) -> Array:
    """What the compiled kernel takes; a copy of what another process handed over read-only, or of every other value."""
    return np.require(values, np.float64, ("C", "W"))


def _check_rows(what: str, values: Array, plant: Plant, rows: Sequence[str], count: int | None = None) -> None:
    # The compiled kernel does not look at bounds: a missing row would be read from whatever lies behind.
    fits = values.ndim == 2 and len(values) == len(rows) and (values.shape[1] == count if count else values.size > 0)
    if not fits:
        raise InputError(
            f"{plant.name}: {what} of shape {values.shape}; a row of {count or 'one or more'} samples is needed "
            f"for each of {', '.join(rows)}"
        )


def _check_injected(inject: tuple[str, Array], plant: Plant, hook_names: Sequence[str], count: int) -> None:
    name, values = inject
    if name not in hook_names:
        raise UnknownNameError(f"hook of {plant.name}", name, hook_names)
    if values.shape != (count,):
        raise InputError(f"{plant.name}: disturbance at {name} of shape {values.shape}, must be ({count},)")


def _arrays(
    compiled: Kernel,
    parameters: Mapping[str, float],
    drive: Drive,
    effects: Iterable[ActiveEffect],
    steps: int,
) -> _Arrays:
    step_s = drive.interval_s / steps
    switches = _switches(compiled, {effect.key: effect.parameters for effect in effects}, step_s)
    return _Arrays(
        step_s,
        steps,
        _laws(compiled, parameters, step_s),
        switches,
        _initial_states(compiled.plant, parameters, drive),
        np.zeros(int(switches.offsets[-1]) + 1),
    )


# Fits simulate every recording with the same values, and many effects on the same plant: making these arrays anew
# each time takes longer than a simulation.
_KEPT = 16
_recent_laws: dict[object, _Laws] = {}
_recent_switches: dict[object, _Switches] = {}


def _laws(compiled: Kernel, parameters: Mapping[str, float], step_s: float) -> _Laws:
    key = (compiled.plant.name, step_s, tuple(parameters.items()))
    found = _recent_laws.get(key)
    if found is None or found.of is not compiled:
        of = compiled.plant.coefficients
        found = _Laws(compiled, flat(of(parameters, math.inf)), flat(of(parameters, step_s)))
        _keep(_recent_laws, key, found)
    return found


def _switches(compiled: Kernel, active: Mapping[tuple[str, str], Mapping[str, float]], step_s: float) -> _Switches:
    key = (compiled.plant.name, step_s, tuple((of, *given.items()) for of, given in active.items()))
    found = _recent_switches.get(key)
    if found is None or found.of is not compiled:
        found = _switched(compiled, active, step_s)
        _keep(_recent_switches, key, found)
    return found


_Kept = TypeVar("_Kept")


def _keep(recent: dict[object, _Kept], key: object, made: _Kept) -> None:
    if len(recent) >= _KEPT:
        recent.clear()
    recent[key] = made


def _switched(compiled: Kernel, active: Mapping[tuple[str, str], Mapping[str, float]], step_s: float) -> _Switches:
    plant = compiled.plant
    unknown = active.keys() - compiled.indices.keys()
    if unknown:
        known = [f"{name} at {hook}" for name, hook in compiled.indices]
        raise UnknownNameError(f"effect in {plant.name}", " at ".join(min(unknown)), known)
    count = len(compiled.sites)
    on = np.zeros(count, dtype=np.bool_)
    values = np.zeros(compiled.starts[-1] + 1)
    sizes = np.zeros(1 + count + len(plant.lines_s), dtype=np.int64)
    for key, given in active.items():
        k = compiled.indices[key]
        site = compiled.sites[k]
        if site.effect.coefficients is not None:
            given = site.effect.coefficients(given, step_s)
        on[k] = True
        values[compiled.starts[k] : compiled.starts[k + 1]] = [given[name] for name in compiled.arguments[k]]
        scaled = {parameter.name: parameter for parameter in site.effect.parameters_at(site.hook)}
        sizes[1 + k] = site.effect.memory(scaled, step_s)
    sizes[1 + count :] = [math.ceil(length / step_s) + 4 for length in plant.lines_s.values()]
    return _Switches(compiled, on, values, np.cumsum(sizes))


def _observer(plant: Plant, parameters: Mapping[str, float], interval_s: float) -> Array:
    """The observer's gains, one for each scalar state."""
    if plant.observer is None:
        raise InputError(f"{plant.name} has no observer to follow a measured output with")
    gains = plant.observer(parameters, interval_s)
    return np.array([gains.get(name, 0.0) for name in plant.scalars])


def flat(coefficients: Mapping[str, float | Array]) -> Array:
    """A plant's coefficients as its kernel takes them, in their order, arrays row by row."""
    values: list[float] = []
    for value in coefficients.values():
        if isinstance(value, np.ndarray):
            values += value.ravel().tolist()
        else:
            values.append(value)
    return np.array(values, dtype=np.float64)


def _initial_states(plant: Plant, parameters: Mapping[str, float], drive: Drive) -> Array:
    first = tuple(float(value) for value in drive.inputs[:, 0])
    given = plant.initial(parameters, first, drive.first_output)
    states = np.zeros(sum(plant.states.values()) + 1 + len(plant.observed))
    at = 0
    for name, width in plant.states.items():
        states[at : at + width] = given.get(name, 0.0)
        at += width
    return states
