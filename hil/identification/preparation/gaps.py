"""Samples that a recorder did not keep: put back as places that say nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hil.errors import FileError
from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.time_constant import time_constant_s
from hil.identification.uncertainty.noise import resolution, white_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array, Mask
from hil.signals.runs import runs


def bridged(model: Model, experiments: Sequence[Experiment]) -> tuple[list[Experiment], tuple[Note, ...]]:
    """Every recording as `filled` makes it for a unit that settles as the model does, and what was done."""
    if all(e.grid_s is None for e in experiments):
        return list(experiments), ()
    constant_s = max(time_constant_s(model, e) for e in experiments)
    made = [filled(e, constant_s, model.definition.forgets(model.values)) for e in experiments]
    return [e for e, _ in made], tuple(words for _, note in made for words in note)


def filled(e: Experiment, constant_s: float, forgets: bool) -> tuple[Experiment, list[Note]]:
    """A recording with even stamps but for samples that are missing, made even; and what was done, in words.

    The command is drawn straight through a hole, unless it is long or the command has jumped in it. What a unit did
    then is unknown, so that its output says nothing until the unit has settled. One that never forgets (it
    integrates) has only the longest stretch without such a hole left.

    Stamps that are uneven otherwise are left as they are: the command is held between them. `constant_s`: the time
    constant of the unit, five of which it is given to settle.

    Raises:
        FileError: next to nothing is left.
    """
    if e.grid_s is None:
        return e, []
    gaps = _long_gaps(e)
    if e.command_is_known:
        known = Note("{gaps}, in the output; the command is known in between", gaps=_counted(gaps)) if gaps else None
        return e, [known.of(e.name)] if known else []
    at = _places(e)
    if at is None:
        return e, [Note("{gaps}; the command is taken as held", gaps=_counted(gaps)).of(e.name)] if gaps else []
    missing = np.ones(at[-1] + 1, dtype=np.bool_)
    missing[at] = False
    if not missing.any():
        return e, []
    even = _bridged(e, e.grid_s, at, missing)
    unknown = _unknown(even.drive.inputs, missing)
    share = 100.0 * float(missing.mean())
    seen = _counted(gaps) if gaps else Note("{share:.2g} % of its samples are missing", share=share)
    if not unknown:
        return even, [Note("{seen}; the command is drawn straight through", seen=seen).of(e.name)]
    if not forgets:
        kept = _enough(_cut(even, missing, unknown), seen)
        used = Note("{seen}; only {duration_s:.4g} s from {start_s:.4g} s are used", seen=seen,
                    duration_s=kept.duration_s, start_s=kept.time_s[0])  # fmt: skip
        return kept, [used.of(e.name)]
    settling_s = CRITERIA.settled_after * constant_s
    unsettled = np.zeros_like(missing)
    for start, stop in unknown:
        unsettled[start : stop + int(np.ceil(settling_s / even.drive.interval_s))] = True
    note = Note(
        "{seen}; where the command is unknown ({count} ×) and {settling_s:.3g} s after it samples are left out",
        seen=seen, count=len(unknown), settling_s=settling_s,
    )  # fmt: skip
    return _enough(even.without_all(unsettled), note), [note.of(e.name)]


def _enough(kept: Experiment, seen: Note) -> Experiment:
    left = int(kept.valid.sum())
    if left < CRITERIA.fewest_samples:
        raise FileError(
            Note("{seen}: {left} samples are left; at least {least} are needed",
                 seen=seen, left=left, least=CRITERIA.fewest_samples).of(kept.name)
        )  # fmt: skip
    return kept


def _long_gaps(e: Experiment) -> list[tuple[float, float]]:
    """When they begin, and how long they are."""
    steps = np.diff(e.time_s)
    return [(float(e.time_s[k]), float(steps[k])) for k in np.flatnonzero(steps > CRITERIA.gap * e.interval_s)]


def _counted(gaps: list[tuple[float, float]]) -> Note:
    start_s, long_s = max(gaps, key=lambda gap: gap[1])
    return Note(
        "gaps in the samples: {count}, the longest {long_s:.3g} s at {start_s:.4g} s",
        count=len(gaps), long_s=long_s, start_s=start_s,
    )  # fmt: skip


def _places(e: Experiment) -> NDArray[np.intp] | None:
    """Where the samples lie on an even grid, in its intervals from the first; None where they lie on none."""
    if e.read_s is not None:
        return None
    at = np.concatenate(([0], np.cumsum(np.rint(np.diff(e.time_s) / e.interval_s).astype(np.intp))))
    if np.diff(at).min() < 1 or at[-1] > CRITERIA.most_times_longer * len(at):
        return None
    from_grid = e.time_s - e.time_s[0] - at * e.duration_s / at[-1]
    return at if np.abs(from_grid).max() <= CRITERIA.off_grid * e.interval_s else None


def _bridged(e: Experiment, grid_s: Array, at: NDArray[np.intp], missing: Mask) -> Experiment:
    """The experiment on an even grid, straight through every hole; `grid_s`: on which its command was held."""
    count = np.arange(len(missing))
    time_s = np.linspace(e.time_s[0], e.time_s[-1], len(missing))
    # just after its stamp a command is on the grid, whatever the rounding of the stamp
    held = np.minimum(np.searchsorted(grid_s, e.time_s, side="right"), len(grid_s) - 1)

    def drawn(values: Array) -> Array:
        return np.interp(count, at, values)

    inputs = np.array([drawn(row[held]) for row in e.drive.inputs])
    drive = replace(e.drive, inputs=inputs, interval_s=e.duration_s / (len(time_s) - 1))
    observed = {name: _as_noisy(drawn(values), values, missing) for name, values in e.observed.items()}
    output = _as_noisy(drawn(e.output), e.output, missing)

    def moved(samples: Mask) -> Mask:
        on_even = np.zeros_like(missing)
        on_even[at] = samples
        return on_even

    even = replace(
        e, time_s=time_s, drive=drive, grid_s=None, output=output, observed=observed,
        invalid={name: moved(samples) for name, samples in e.invalid.items()}, ripples=None,
    )  # fmt: skip
    return even.without_all(missing)


def _as_noisy(drawn: Array, recorded: Array, missing: Mask) -> Array:
    """What is drawn through holes, with the noise and in the steps of the channel.

    Nothing is ever fitted to it; but a channel that is smooth in its holes would look less noisy, or finer, than it is,
    or as if it repeated its samples.
    """
    noise = white_floor(recorded) * np.random.default_rng(len(drawn)).standard_normal(len(drawn))
    step = resolution(recorded)
    noisy = drawn + noise
    stepped = np.rint(noisy / step) * step if step > 0.0 else noisy
    return np.where(missing, stepped, drawn)


def _unknown(inputs: Array, missing: Mask) -> list[tuple[int, int]]:
    """The holes in which nobody knows what was commanded: long ones, and those in which a command has jumped."""
    least = CRITERIA.least_jump * np.ptp(inputs, axis=1)
    found = []
    for start, stop in runs(missing):
        before, after = max(start - 2, 0), min(stop + 1, len(missing) - 1)
        beside = np.maximum(
            np.abs(inputs[:, start - 1] - inputs[:, before]), np.abs(inputs[:, after] - inputs[:, stop])
        )
        rise = np.abs(inputs[:, stop] - inputs[:, start - 1])
        jumps = rise > least + CRITERIA.steeper * (stop - start + 1) * beside
        if stop - start >= CRITERIA.gap or jumps.any():
            found.append((start, stop))
    return found


def _cut(even: Experiment, missing: Mask, unknown: list[tuple[int, int]]) -> Experiment:
    """The longest stretch without a hole in which the command is unknown, as a recording of its own."""
    holes = [(0, 0), *unknown, (len(missing), len(missing))]
    start, stop = max(((before[1], after[0]) for before, after in pairwise(holes)), key=lambda s: s[1] - s[0])
    part = slice(start, stop)
    drive = replace(
        even.drive, inputs=np.ascontiguousarray(even.drive.inputs[:, part]), first_output=float(even.output[start])
    )
    return replace(
        even, time_s=even.time_s[part], drive=drive, output=even.output[part],
        observed={name: values[part] for name, values in even.observed.items()},
        invalid={name: samples[part] for name, samples in even.invalid.items()}, ripples=None,
    )  # fmt: skip
