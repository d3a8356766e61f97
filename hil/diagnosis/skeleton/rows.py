"""The regression of a misfit: recordings as means over short stretches, and what the library can change in them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from hil.cores import parallel_map
from hil.diagnosis.intake.problem import COARSER, Problem
from hil.diagnosis.search.terms import Term, all_terms
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.time_constant import time_constant_s
from hil.physics.model import Model
from hil.physics.plant import Parameters
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array, Integers, Mask

# A small step of a base parameter beside the starts of its term, as a share of its size: its slope.
_SLOPE = 0.02
# Rows in the time that a simulation remembers, and rows in a block: a stretch that its memory does not reach across.
_IN_MEMORY, IN_BLOCK = 15.0, 50
# Rows of one recording where the plant does not settle, and of all recordings together at most.
_IN_RECORDING, _MOST = 2000, 8000
# Delays at which the state is looked at, in rows.
_LAGS = (2, 8, 32)
# A plant that adds up its errors, and has no observer, is compared by what they grow in so many rows.
_GROWTH = 10
# What is kept of recordings that were driven alike, in bytes: 20 of 76 s at 250 Hz.
_KEPT_BYTES = 1 << 27

_Changes = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True, slots=True)
class Column:
    """One change of the model: an effect of the library at a hook, or a base parameter at another value.

    Attributes:
        name: of the effect or the parameter. `hook`: where the effect acts; empty for a parameter.
        values: of the effect's parameters, or of the parameter.
    """

    name: str
    hook: str
    values: Mapping[str, float]

    def apply(self, parameters: dict[str, float], effects: list[ActiveEffect]) -> None:
        """Put the change into a simulation's arguments."""
        if self.hook:
            effects.append(ActiveEffect(self.name, self.hook, dict(self.values)))
        else:
            parameters.update(self.values)


def columns_of(problem: Problem) -> tuple[Column, ...]:
    """Every library term at each of its starts, and every base parameter at some steps; none that runs by the clock."""
    terms = all_terms(problem, problem.nominal_residuals)
    return tuple(
        Column(term.name, term.hook, {**dict(term.held), **term.named(start)})
        for term in terms
        if not term.by_clock
        for start in _starts(term)
    )


def _starts(term: Term) -> Sequence[tuple[float, ...]]:
    if term.kind == "effect":
        return term.starts
    u = term.unknowns[0]
    step = _SLOPE * max(abs(term.nominal), u.scale)
    return (*term.starts, (term.nominal + (step if term.nominal + step <= u.high else -step),))


@dataclass(frozen=True, slots=True)
class Rows:
    """Means over short stretches.

    Attributes:
        misfit: nominal simulation minus recording, in units of the channel's noise floor; 0 where invalid; shape (n,).
        changes: what every column changes in the simulation, in the same unit, shape (columns, n).
        state: command and simulated output, as they are and their differences over delays, shape (n, s).
        recording: the number of the recording. `channel`: of its output, 0, or an inner signal. `block`: the number of
            the block within all recordings. Shape (n,).
        valid: where more than half of the samples were measured, shape (n,).
        samples: of the recording in each row.
    """

    misfit: Array
    changes: NDArray[np.float32]
    state: Array
    recording: Integers
    channel: Integers
    block: Integers
    valid: Mask
    samples: int

    def some(self, own: Mask) -> Rows:
        """Some of them."""
        return Rows(
            self.misfit[own], self.changes[:, own], self.state[own], self.recording[own], self.channel[own],
            self.block[own], self.valid[own], self.samples,
        )  # fmt: skip


def row_s(model: Model, experiments: Sequence[Experiment]) -> float:
    """The length of a row in s: a small part of the time that the simulation remembers."""
    longest = max(experiments, key=lambda e: e.duration_s)
    memory_s = _memory_s(model, longest)
    own = memory_s / _IN_MEMORY if memory_s > 0.0 else longest.duration_s / _IN_RECORDING
    return max(own, sum(e.duration_s for e in experiments) / _MOST, max(e.interval_s for e in experiments))


def _memory_s(model: Model, e: Experiment) -> float:
    """The plant's time constant, or the observer's where it never settles but at an end; 0 where there is none."""
    plant = model.definition
    if plant.observer is not None:
        return e.interval_s / max(plant.observer(model.values, e.interval_s).values())
    return time_constant_s(model, e) if plant.forgets(model.values) else 0.0


def rows_of(
    model: Model, experiments: Sequence[Experiment], columns: Sequence[Column], floors: Mapping[str, float],
    length_s: float,
) -> Rows:  # fmt: skip
    """The rows of all recordings, channel by channel.

    Args:
        model: the nominal model.
        experiments: the recordings.
        columns: what may be changed in the model.
        floors: noise of each channel, by name; that of the output under "output".
        length_s: of a row.
    """
    parts = parallel_map(lambda e: _of_recording(model, e, columns, floors, length_s), experiments)
    channels = [(k, channel) for k, found in enumerate(parts) for channel in found]
    blocks, first = [], 0
    for _, channel in channels:
        blocks.append(first + np.arange(len(channel.misfit)) // IN_BLOCK)
        first = int(blocks[-1][-1]) + 1
    return Rows(
        np.concatenate([c.misfit for _, c in channels]),
        np.concatenate([c.changes for _, c in channels], axis=1),
        np.concatenate([c.state for _, c in channels]),
        np.concatenate([np.full(len(c.misfit), k) for k, c in channels]),
        np.concatenate([np.full(len(c.misfit), c.place) for _, c in channels]),
        np.concatenate(blocks),
        np.concatenate([c.valid for _, c in channels]),
        max(1, round(length_s / experiments[0].interval_s)),
    )


@dataclass(frozen=True, slots=True)
class _Channel:
    misfit: Array
    changes: NDArray[np.float32]
    state: Array
    valid: Mask
    place: int


def answers(
    model: Model, e: Experiment, floors: Mapping[str, float], length_s: float,
    parameters: Parameters, effects: Sequence[ActiveEffect], factor: float = 1.0,
) -> Mapping[str, Array]:  # fmt: skip
    """The rows of a recording as simulated, by channel, in units of the noise floor.

    A plant with an observer, which adds up its errors, is led back to the recording: what is wrong at a moment shows at
    that moment, and the simulation is where the unit is.

    Args:
        model: the nominal model.
        e: the recording.
        floors: noise of each channel, by name.
        length_s: of a row.
        parameters: of the simulation.
        effects: those that are switched on in it.
        factor: of the plant's sub-steps.
    """
    found = _simulated(model, e, parameters, effects, factor)
    return {name: _rows(model, e, found[k], length_s) / floors[name] for name, k in _channels(model, e, floors).items()}


def _simulated(
    model: Model, e: Experiment, parameters: Parameters, effects: Sequence[ActiveEffect], factor: float
) -> Array:
    plant = model.definition
    with np.errstate(all="ignore"):
        return e.respond(plant, parameters, effects, factor=factor, following=plant.observer is not None)


def _channels(model: Model, e: Experiment, floors: Mapping[str, float]) -> Mapping[str, int]:
    """The places of what is compared of a recording: its output and the inner signals that it has."""
    names = ["output", *(s.name for s in model.definition.observed)]
    return {name: k for k, name in enumerate(names) if name in floors and (k == 0 or name in e.observed)}


def _rows(model: Model, e: Experiment, values: Array, length_s: float) -> Array:
    """Means of a signal; what they have grown by, where errors add up and no observer leads back."""
    plant, rows = model.definition, _means(values, samples_in(length_s, e))
    return rows if plant.observer is not None or plant.forgets(model.values) else _grown(rows)


def samples_in(length_s: float, e: Experiment) -> int:
    """Samples of a recording in a row."""
    return max(1, round(length_s / e.interval_s))


def _of_recording(
    model: Model, e: Experiment, columns: Sequence[Column], floors: Mapping[str, float], length_s: float
) -> list[_Channel]:
    nominal = answers(model, e, floors, length_s, model.values, model.active_effects)
    sampled = _simulated(model, e, model.values, model.active_effects, 1.0)
    changes = _kept.of(_driven_alike(model, e, columns, floors, length_s),
                       partial(_changes, model, e, columns, floors, length_s))  # fmt: skip
    samples, places = samples_in(length_s, e), _channels(model, e, floors)
    state = _state(_means(e.on_grid_input(), samples), floors["output"] * nominal["output"])
    found = []
    for name, k in places.items():
        measured = e.output if k == 0 else e.observed[name]
        tells = e.valid_in(name)
        valid = _means(tells.astype(float), samples) > 0.5
        recorded = _rows(model, e, np.where(tells, measured, sampled[k]), length_s)
        misfit = np.where(valid, nominal[name] - recorded / floors[name], 0.0)
        own = np.zeros((len(state), 1 + len(model.definition.observed)))
        own[:, k] = 1.0
        found.append(_Channel(misfit, changes[name], np.hstack([state, own]), valid, k))
    return found


def _changes(
    model: Model, e: Experiment, columns: Sequence[Column], floors: Mapping[str, float], length_s: float
) -> _Changes:
    """What every column changes in the rows of a recording, by channel, shape (columns, n) each."""
    simulated = partial(answers, model, e, floors, length_s)
    coarse = simulated(model.values, model.active_effects, COARSER)
    changes = {name: np.empty((len(columns), len(rows)), np.float32) for name, rows in coarse.items()}
    for k, column in enumerate(columns):
        parameters, effects = dict(model.values), list(model.active_effects)
        column.apply(parameters, effects)
        for name, rows in simulated(parameters, effects, COARSER).items():
            changes[name][k] = np.nan_to_num(rows - coarse[name])
    return changes


def _driven_alike(
    model: Model, e: Experiment, columns: Sequence[Column], floors: Mapping[str, float], length_s: float
) -> str:
    """A hash of all that `_changes` depends on; empty where that is also what was measured, or when."""
    plant, drive = model.definition, e.drive
    starts = plant.initial(model.values, tuple(drive.inputs[:, 0].tolist()), drive.first_output)
    if plant.observer is not None or starts or e.is_late or e.ripples is not None or e.read_s is not None:
        return ""
    grid_s = e.time_s if e.grid_s is None else np.concatenate([e.time_s, e.grid_s])
    what_counts = (
        plant.name, sorted(model.values.items()), model.active_effects, columns, sorted(floors.items()), length_s,
        tuple(_channels(model, e, floors)), drive.interval_s, drive.read_at, drive.inputs.shape, e.skew_s,
    )  # fmt: skip
    return hashlib.sha256(repr(what_counts).encode() + drive.inputs.tobytes() + grid_s.tobytes()).hexdigest()


class _Kept:
    """The changes of the latest recordings: units of one type that went through one programme share them."""

    def __init__(self) -> None:
        self._by_hash: dict[str, _Changes] = {}
        self._lock = Lock()

    def of(self, key: str, made: Callable[[], _Changes]) -> _Changes:
        """Those of a hash, made where they are not there; those of no hash are not kept."""
        with self._lock:
            found = self._by_hash.pop(key, None)
        if found is None:
            found = made()
        if key:
            with self._lock:
                self._by_hash[key] = found
                while sum(sum(rows.nbytes for rows in one.values()) for one in self._by_hash.values()) > _KEPT_BYTES:
                    del self._by_hash[next(iter(self._by_hash))]
        return found


_kept = _Kept()


def _means(values: Array, count: int) -> Array:
    """Means over so many samples, one after another; what is left over at the end is left out."""
    whole = len(values) // count * count
    return values[:whole].reshape(-1, count).mean(axis=1)


def _grown(values: Array) -> Array:
    """By how much values have grown in the last rows."""
    before = np.concatenate([np.full(min(_GROWTH, len(values)), values[0]), values[:-_GROWTH]])
    return values - before[: len(values)]


def _state(command: Array, output: Array) -> Array:
    columns = []
    for values in (command, output):
        columns.append(values)
        for lag in _LAGS:
            past = np.concatenate([np.full(min(lag, len(values)), values[0]), values[:-lag]])[: len(values)]
            columns.append(values - past)
    return np.column_stack(columns)
