"""Run a plant: recordings in, model output out; or block by block as a live twin."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from hil.errors import InputError, UnknownNameError
from hil.physics.compose import Kernel, kernel
from hil.physics.plant import Plant
from hil.record.recording import Array, Integers, Mask

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


@dataclass(slots=True)
class _Arrays:
    """What the kernel takes for one set of values.

    Attributes:
        steady, coefficients: of the plant, at rest and in motion.
        on, effect_coefficients, offsets: which effects are on, what they take, and where the memory of each begins.
        states, memory: the kernel writes to these alone.
    """

    run: Callable[..., None]
    step_s: float
    sub_steps: int
    steady: Array
    coefficients: Array
    states: Array
    on: Mask
    effect_coefficients: Array
    memory: Array
    offsets: Integers

    def advanced(
        self, plant: Plant, inputs: Array, read_at: float, start: int, settle: bool,
        inject: int = -1, disturbance: Array = _NOTHING, trace: Array | None = None,
        follow: Array = _NO_OBSERVER, measured: Array = _NOTHING,
    ) -> Array:  # fmt: skip
        """Outputs and observed signals, shape (1 + observed, n); states and memory go on."""
        out = np.empty((1 + len(plant.observed), inputs.shape[1]))
        self.run(
            _dense(inputs), self.step_s, self.sub_steps, round(read_at * self.sub_steps), start, settle,
            self.steady, self.coefficients, self.states, self.on, self.effect_coefficients, self.memory, self.offsets,
            inject, _dense(disturbance), trace is not None, _NO_TRACE if trace is None else trace, follow,
            _dense(measured), out,
        )  # fmt: skip
        return out


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
    at, disturbance = (hook_names.index(inject[0]), inject[1]) if inject else (-1, _NOTHING)
    follow = _NO_OBSERVER if measured is None else _observer(plant, parameters, drive.interval_s)
    return _arrays(plant, parameters, drive, effects, factor, count).advanced(
        plant, drive.inputs, drive.read_at, 0, True, at, disturbance, trace, follow,
        _NOTHING if measured is None else measured,
    )  # fmt: skip


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
        settle = self._arrays is None
        if self._arrays is None:
            drive = Drive(inputs, math.nan, self.interval_s)
            self._arrays = _arrays(self.plant, self.parameters, drive, self.effects)
        out = self._arrays.advanced(self.plant, inputs, self.read_at, self._done, settle)
        self._done += inputs.shape[1] * self._arrays.sub_steps
        return out

    def checkpoint(self) -> Callable[[], None]:
        """Keep where it stands; what is returned takes it back there."""
        arrays, done = self._arrays, self._done
        kept = None if arrays is None else (arrays.states.copy(), arrays.memory.copy())

        def roll_back() -> None:
            self._arrays, self._done = arrays, done
            if arrays is not None and kept is not None:
                arrays.states[:], arrays.memory[:] = kept

        return roll_back


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
    plant: Plant,
    parameters: Mapping[str, float],
    drive: Drive,
    effects: Iterable[ActiveEffect],
    factor: float = 1.0,
    samples: float = math.inf,
) -> _Arrays:
    compiled, steps = kernel(plant.name), sub_steps(plant, drive.interval_s, factor)
    step_s = drive.interval_s / steps
    active = {effect.key: tuple(effect.parameters.items()) for effect in effects}
    on, values, offsets = effects_at(compiled, step_s, tuple(active.items()))
    words = plant.line_words(parameters, step_s, samples * steps)
    offsets = np.append(offsets, offsets[-1] + np.cumsum(words, dtype=np.int64))
    return _Arrays(
        compiled.run, step_s, steps, *plant_at(compiled, step_s, tuple(parameters.items())),
        _initial_states(compiled.plant, parameters, drive), on, values, np.zeros(int(offsets[-1]) + 1), offsets,
    )  # fmt: skip


# Fits simulate every recording with the same values, and many effects on the same plant: making these arrays anew
# each time takes longer than a simulation.
_KEPT = 16
_Named = tuple[tuple[str, float], ...]


@lru_cache(_KEPT)
def plant_at(compiled: Kernel, step_s: float, parameters: _Named) -> tuple[Array, Array]:
    """The plant's coefficients at rest and in motion, as the kernel takes them; kept for the next simulations."""
    of, values = compiled.plant.coefficients, dict(parameters)
    return flat(of(values, math.inf)), flat(of(values, step_s))


@lru_cache(_KEPT)
def effects_at(
    compiled: Kernel, step_s: float, active: tuple[tuple[tuple[str, str], _Named], ...]
) -> tuple[Mask, Array, Integers]:
    """Which effects are on, their coefficients, and where the memory of each begins; kept for the next simulations."""
    unknown = {key for key, _ in active} - compiled.indices.keys()
    if unknown:
        known = [f"{name} at {hook}" for name, hook in compiled.indices]
        raise UnknownNameError(f"effect in {compiled.plant.name}", " at ".join(min(unknown)), known)
    count = len(compiled.sites)
    on = np.zeros(count, dtype=np.bool_)
    values = np.zeros(compiled.starts[-1] + 1)
    sizes = np.zeros(1 + count, dtype=np.int64)
    for key, named in active:
        k, given = compiled.indices[key], dict(named)
        site = compiled.sites[k]
        if site.effect.coefficients is not None:
            given = dict(site.effect.coefficients(given, step_s))
        on[k] = True
        values[compiled.starts[k] : compiled.starts[k + 1]] = [given[name] for name in compiled.arguments[k]]
        sizes[1 + k] = site.effect.words_at(site.hook, step_s)
    return on, values, np.cumsum(sizes)


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
