"""A channel that resolves less than it did."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.events.event import Events
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.thresholds import FAR, MOST
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.noise import resolution
from hil.language.note import Note
from hil.record.recording import Array

# A line and its uncertainty take so many levels.
_LEAST_LEVELS = 3
# An offset of half a step, to within this share of a step, is the converter's own.
_HALF_A_STEP = 0.1
# Nearly all samples of a unit that is only read coarsely are no further than so many steps, and so much noise, from its
# model, which is itself not exact; and about as many above as below.
_NO_FURTHER, _CENTRED = 0.75, 0.25


def coarse_step(problem: Problem, recorded: Sequence[Experiment]) -> tuple[float, float] | None:
    """The step in which the output comes and its uncertainty, where the model was identified on a finer channel.

    `recorded`: the experiments as they came, with nothing taken out of them.
    """
    known = problem.model.noise
    before = float(problem.model.origin.get("resolution", 0.0))
    if known is None or before <= 0.0:
        return None
    steps = [resolution(e.output) for e in recorded]
    step = float(np.median(steps))
    if not (step > FAR * before and step > MOST * known.std):
        return None
    return lattice(np.unique(np.concatenate([e.output for e in recorded])), step, before)


def coarse(problem: Problem, step: float, std: float, chosen: Fitted, residuals: Array) -> Events:
    """The finding for an output that comes in coarse steps of this size, beside what was chosen.

    A converter that cuts off what is below its level reads half a step too little: no offset of the sensor.
    """
    last, unit = problem.plant.hooks[-1], problem.model.output_unit
    offset, cut = _offset(chosen), cuts_off(chosen, step)
    stated = Note("The signal comes in steps of {step:.3g} {unit}, far coarser than when the model was identified",
                step=step, unit=unit)  # fmt: skip
    if cut and offset < 0.0:
        stated = Note(
            "{steps}, and reads {by:.3g} {unit} too little: it does not round", steps=stated, by=-offset, unit=unit
        )
    elif cut:
        stated = Note(
            "{steps}, and reads {by:.3g} {unit} too much: it does not round", steps=stated, by=offset, unit=unit
        )
    return Events(
        "quantisation", last.stage, last.name, (), {"step": (step, std, unit)}, residuals, problem.experiments,
        stated.stopped,
        "y = q·⌊u/q⌋" if cut and offset < 0.0 else "y = q·⌈u/q⌉" if cut else "y = q·round(u/q)",
        shows_as="sensor_offset" if cut else "",
    )  # fmt: skip


def cuts_off(f: Fitted, step: float) -> bool:
    """Whether the offset of an explanation is that of a converter that cuts off instead of rounding."""
    return abs(abs(_offset(f)) - 0.5 * step) < _HALF_A_STEP * step


def _offset(f: Fitted) -> float:
    return sum(v[0] for term, v in f.pairs if term.name == "sensor_offset")


def lattice(levels: Array, step: float, rounding: float) -> tuple[float, float]:
    """The distance of levels that are whole multiples of it apart, about `step`; rounded to `rounding` in their turn.

    A line through the levels over their number, with its standard uncertainty: what rounding does to levels may grow
    with their number by one rounding over all of them, and then looks like a longer step.
    """
    number = np.concatenate([[0.0], np.cumsum(np.rint(np.diff(levels) / step))])
    if len(levels) < _LEAST_LEVELS:
        return step, rounding / float(np.sqrt(6.0))
    away = number - number.mean()
    slope = float(away @ levels / (away @ away))
    left = levels - levels.mean() - slope * away
    std = float(np.sqrt(left @ left / (len(levels) - 2) / (away @ away)))
    return slope, max(std, rounding / float(np.sqrt(3.0) * np.ptp(number)))
