"""A recording that begins while the unit still moves: what was commanded before it is an unknown of its own.

A simulation begins at rest at the first command. Where a longer recording was cut in two, or the recorder was started
late, the unit was still on its way, and a true model would look wrong until that is forgotten. The command before the
recording is taken in levels that last twice as long each, the further back they lie: whatever the unit's times are,
some of them tell where it stood and how it moved.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hil.identification.preparation.criteria import CRITERIA, EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.fit import explains_little, fit_percent
from hil.identification.uncertainty.noise import channel_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array
from hil.signals.colour import colour_factor
from hil.signals.information_criterion import bic
from hil.signals.interval import COVERED
from hil.signals.straight_line import weighted_line


def begins_at_rest(e: Experiment) -> bool:
    """Whether the output is noise about a level before the command first moves; False where too few samples tell."""
    moved = np.diff(e.on_grid_input()) != 0.0
    still = e.output[: int(np.argmax(moved)) + 1]
    if len(still) < CRITERIA.fewest_at_rest:
        return False
    line = weighted_line(np.linspace(-1.0, 1.0, len(still)), still)
    left, std = line.residuals, line.slope_std() * math.sqrt(colour_factor(line.residuals))
    return abs(line.slope) <= COVERED * std and float(np.std(left)) <= COVERED * channel_floor(e.valid_output)


def levels_of(e: Experiment) -> int:
    """How many levels are taken before a recording."""
    return int(math.log2(len(e.output)))


def is_worth(plain: Array, after: Array, count: int) -> bool:
    """Whether so many levels are worth their number, by the Bayesian criterion.

    Args:
        plain: errors of what begins at rest, shape (n,).
        after: of what begins after the levels, shape (n,).
        count: of the levels.
    """
    independent = len(after) / colour_factor(after)
    found, nothing = bic(float(after @ after), independent, count), bic(float(plain @ plain), independent, 0)
    return bool(after.any()) and found < nothing


def begun_in_motion(model: Model, e: Experiment) -> tuple[Experiment, tuple[Note, ...]]:
    """The recording with the command before it that explains how it begins, and what was done, in words.

    As it is where the Bayesian criterion finds those levels not worth their number, where even with them the model
    leaves more than half of the output, where the plant never forgets, and where the samples lie on no grid.
    """
    span = float(np.ptp(e.drive.inputs[0]))
    is_even = e.grid_s is None and e.read_s is None and e.ripples is None and not e.is_late
    if not is_even or span == 0.0 or e.stands_still or not model.definition.forgets(model.values) or begins_at_rest(e):
        return e, ()
    count = levels_of(e)

    def errors(change: Array) -> Array:
        begun = _after(e, change)
        return begun.telling(begun.simulated(model)[0] - e.output)

    plain = e.telling(e.simulated(model)[0] - e.output)
    if not (plain.any() and errors(np.zeros(count)).any()):  # no noise, and nothing to explain
        return e, ()

    def found_from(change: Array) -> tuple[Array, Array]:
        left = errors(change)
        for _ in range(EFFORT.rounds):
            slopes = (
                np.array([errors(change + EFFORT.level_step * span * unit) - left for unit in np.eye(count)]).T
                / EFFORT.level_step
            )
            # a level lies about the first one as far as the command goes, and what is left says how much a sample tells
            power = float(np.mean(left**2))
            step = np.linalg.solve(slopes.T @ slopes + power * np.eye(count), -slopes.T @ left - power * change / span)
            if not is_worth(plain[e.valid], (left + slopes @ step)[e.valid], count):
                break
            tried = errors(change + span * step)
            if not float(tried @ tried) < float(left @ left):
                break
            change, left = change + span * step, tried
        return change, left

    change, left = found_from(np.zeros(count))
    if float(np.std(left[e.valid])) > COVERED * channel_floor(e.valid_output):
        # a sensor blind to the direction: the unit may have run the other way, to which no small change leads
        other = found_from(np.full(count, -2.0 * e.drive.inputs[0, 0]))
        change, left = min((change, left), other, key=lambda found: float(found[1] @ found[1]))
    if explains_little([e.valid_output], [left]) or not is_worth(plain[e.valid], left[e.valid], count):
        return e, ()
    fit = fit_percent(e.valid_output, e.valid_output + plain[e.valid])
    last = int(np.flatnonzero(np.abs(plain - left) > COVERED * float(np.std(left))).max(initial=0))
    note = Note(
        "begins in motion: its first {lasting_s:.3g} s answer to earlier commands, which are fitted too; begun at rest "
        "the fit is {fit:.2f} %",
        lasting_s=(last + 1) * e.interval_s, fit=fit,
    )  # fmt: skip
    return _after(e, change), (note.of(e.name),)


def _after(e: Experiment, change: Array) -> Experiment:
    """The recording after levels of its first input that differ from its first value, the oldest first, shape (k,)."""
    held = np.repeat(change, 2 ** np.arange(len(change))[::-1])
    earlier = np.repeat(e.drive.inputs[:, :1], len(held), axis=1)
    earlier[0] += held
    before_s = e.time_s[0] - e.drive.interval_s * np.arange(len(held), 0, -1)
    return replace(
        e, drive=replace(e.drive, inputs=np.ascontiguousarray(np.hstack((earlier, e.drive.inputs)))),
        grid_s=np.concatenate((before_s, e.time_s)), is_late=True, command_is_known=True,
    )  # fmt: skip
