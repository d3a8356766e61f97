"""Figures of a noisy step response, read from a smooth estimate of all of it, with their uncertainty.

The response is as sharp soon after the command jumps as it is smooth later on, so it is smoothed over the logarithm of
time. The uncertainty comes from recordings that are drawn again: the estimate with noise of the size and colour that
was found, rounded as the converter rounds, smoothed and read in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from hil.errors import InputError
from hil.identification.step.criteria import CRITERIA
from hil.identification.step.step_response import StepFigures, leaves, moves_once, step_figures
from hil.identification.uncertainty.fit import rms
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, about, draws_of
from hil.language.note import Note
from hil.record.recording import Array, Recording
from hil.signals.autoregression import coloured_noise, whitener_of
from hil.signals.interval import UNIFORM
from hil.signals.products import one_blas_thread
from hil.signals.rounding import before_rounding, rounded_again, rounding_step
from hil.signals.smooth_curve import Smoother
from hil.signals.straight_line import weighted_line
from hil.signals.tone import Tone, standing_tone

_PARABOLA = (17.0 - 5.0 * np.arange(-2, 3) ** 2) / 35.0  # Savitzky, Golay: Anal. Chem. 36(8), 1964
_CROSSED = ("onset_s", "rise_s", "response_s")  # a level is passed once; bands are entered and left by noise
_NAMES = tuple(field.name for field in fields(StepFigures))


@dataclass(frozen=True, slots=True)
class MeasuredStep:
    """Figures of a noisy step with their standard uncertainties.

    Attributes:
        figures: of the smooth estimate.
        std: standard uncertainty of each figure, infinite where the noise can move it past the record.
        change_std: of final less start.
        noise_std: of a sample, in the output's unit.
        made_by_noise: the overshoot that the same evaluation reads, root mean square, from resampled responses that
            never pass their final value: noise and a smoothed corner make it.
        moving: by how much the response still changes over the stretch that gives its final value; 0 for less than
            noise can make.
        from_command, to_command: the step, in the command's unit.
        tone_hz: frequency of a tone that went on before and after the step and was taken out, or None.
    """

    figures: StepFigures
    std: StepFigures
    change_std: float
    noise_std: float
    made_by_noise: float
    moving: float
    from_command: float
    to_command: float
    tone_hz: float | None = None

    def still_moving(self, unit: str) -> tuple[Note, ...]:
        """What is said of a response, in this unit, that had not come to rest; nothing of one that had."""
        if abs(self.moving) <= CRITERIA.still * abs(self.figures.final - self.figures.start):
            return ()
        return (
            Note(
                "the response still moves by {change:.2g} {unit} over the end of the step, from which its final value "
                "is read; hold it longer.",
                change=self.moving, unit=unit,
            ),
        )  # fmt: skip


def measured_steps(
    recording: Recording, input_name: str, output_name: str, *, band: float = 0.02, level_std: float = 0.0
) -> tuple[MeasuredStep, ...]:
    """Figures of every step of the command in a recording, with uncertainty.

    A step begins where the command jumps and ends at the next jump. The same samples give the same results.
    `level_std` is how well a steady level is known beyond the noise of its own stretch, in the output's unit.

    Raises:
        InputError: the command holds no step, or the response does not follow one.
    """
    command = recording.channel(input_name)
    edges = jumps(command.values)
    if not edges:
        raise InputError(f"{recording.name}: channel '{command.heading}' holds no step")
    output = recording.values(output_name)
    stamps_s, grid = recording.stamps(output_name), rounding_step(output)
    made = []
    for before, first, stop in zip([0, *edges], edges, [*edges[1:], len(recording)], strict=False):
        time_s = stamps_s[first:stop] - recording.time_s[first]
        step = _Step(time_s, output[first:stop], output[before:first], grid, level_std)
        with one_blas_thread():
            made.append(_measured(step, float(command.values[first - 1]), float(command.values[first]), band))
    return tuple(made)


@dataclass(frozen=True, slots=True)
class _Step:
    """Stamps from the step on and the response there, the response before it, the step of the converter.

    `level_std` is as in `measured_steps`.
    """

    time_s: Array
    response: Array
    before: Array
    grid: float
    level_std: float

    @property
    def rest(self) -> Array:
        """What stands before the step."""
        return self.before[-max(1, round(CRITERIA.rest_share * len(self.before))) :]

    @property
    def tail(self) -> slice:
        """What stands at its end."""
        return slice(-max(1, round(CRITERIA.tail_share * len(self.response))), None)


def _measured(recorded: _Step, from_command: float, to_command: float, band: float) -> MeasuredStep:
    step, tone = _without_tone(recorded)
    whitener = _whitener(step)
    smoother = step_smoother(step.time_s, whitener)
    start = float(np.mean(step.rest))
    found, loose = smoother.curves_each(step.response - start, (1.0, CRITERIA.looser))
    (curve,), (foot,), innovation = smoother.at(found) + start, smoother.at(loose) + start, float(found.noise_std[0])
    figures = step_figures(step.time_s, curve, start=start, final=float(np.mean(curve[step.tail])), band=band)

    rng = draws_of(step.response)
    # where the codes lie beneath one level says nothing of where they lie beneath the other
    shifts = rng.random((2, DRAWS, 1)) if step.grid else np.zeros((2, DRAWS, 1))

    def drawn(count: int) -> Array:
        return before_rounding(innovation, step.grid) * coloured_noise(rng, (DRAWS, count), whitener)

    noise = drawn(len(curve))
    noisy = rounded_again(curve + noise, step.grid, shifts[0])
    again, feet = (smoother.at(one) for one in smoother.curves_each(noisy - start, (1.0, CRITERIA.looser)))
    again += start
    feet += start
    moved_levels = step.level_std * rng.normal(size=(2, DRAWS))
    rests = rounded_again(start + drawn(len(step.rest)), step.grid, shifts[1])
    starts = np.mean(rests, axis=1) + moved_levels[0]
    finals = np.mean(again[:, step.tail], axis=1) + moved_levels[1]
    read = [
        _read(step, one, first, last, band, its_foot)
        for one, its_foot, first, last in zip(again, feet, starts.tolist(), finals.tolist(), strict=True)
    ]
    columns = np.array([astuple(one) for one in read if one is not None], dtype=np.float64)
    std = _spread(columns, figures, missing=len(read) - len(columns))
    std = _with_smoothing_difference(std, figures, _read(step, foot, start, figures.final, band))
    figures = replace(figures, onset_s=_foot_time(step, foot, figures))
    sharp = [
        _read(step, _sharp(one), first, last, band)
        for one, first, last in zip(
            (step.response, *noisy), [start, *starts.tolist()], [figures.final, *finals.tolist()], strict=True
        )
    ]
    std = _with_hidden(std, figures, [figures, *read], sharp)
    if before_rounding(innovation, step.grid) > 0.0:  # else a sharp reading is one of codes
        figures, std = _sharper(figures, std, sharp, float(np.median(np.diff(step.time_s))))
    once = moves_once(foot, start, figures.final)
    if (
        not once
        or np.mean([moves_once(*one) for one in zip(feet, starts, finals, strict=True)]) < CRITERIA.certain_onset
    ):
        std = replace(std, onset_s=math.inf)
    changes = columns[:, 1] - columns[:, 0]
    change_std = about(changes, figures.final - figures.start)
    limit = np.minimum if figures.final > start else np.maximum
    stopped = rounded_again(limit(curve, figures.final) + noise, step.grid, shifts[0])
    never = smoother.at(smoother.curves(stopped - start))
    ends = np.vstack((curve, again))[:, step.tail]
    moved, *moves = (ends[:, -1] - ends[:, 0]).tolist()
    return MeasuredStep(
        figures, replace(std, band=band), change_std,
        float(np.std(step.response - curve)), _overshoot(never, step.tail),
        moved if abs(moved) > CRITERIA.moving * about(np.array(moves), moved) else 0.0,
        from_command, to_command, None if tone is None else tone.frequency_hz,
    )  # fmt: skip


def step_smoother(time_s: Array, whitener: Array) -> Smoother:
    """For a response to a step at t = 0, smoothed over log time: it is as sharp soon after as it is smooth later on."""
    places = np.log1p(np.maximum(time_s, 0.0) / (CRITERIA.sharp * float(time_s[-1])))
    return Smoother.on(places, min(CRITERIA.coefficients, max(8, len(places) // 2)), whitener, twice=True)


def _overshoot(changed: Array, tail: slice) -> float:
    """Root mean square of the overshoots of what responses have changed by, shape (m, n), as a share of it."""
    changes = np.mean(changed[:, tail], axis=1)
    farthest = np.where(changes > 0.0, np.max(changed, axis=1), np.min(changed, axis=1))
    over = farthest / changes - 1.0
    return rms(np.maximum(over, 0.0))


def _read(
    step: _Step, curve: Array, start: float, final: float, band: float, foot: Array | None = None
) -> StepFigures | None:  # fmt: skip
    """Figures of a resampled response, the onset from a looser estimate if there is one; None where it has none."""
    try:
        figures = step_figures(step.time_s, curve, start=start, final=final, band=band)
    except InputError:
        return None
    return figures if foot is None else replace(figures, onset_s=_foot_time(step, foot, figures))


def _foot_time(step: _Step, foot: Array, figures: StepFigures) -> float:
    return leaves(step.time_s, foot, figures.start, figures.final)


def _with_smoothing_difference(std: StepFigures, smooth: StepFigures, loose: StepFigures | None) -> StepFigures:
    """The uncertainties with what a looser estimate reads differently of the times at which levels are crossed."""
    if loose is None:
        return std
    apart = {name: getattr(loose, name) - getattr(smooth, name) for name in _CROSSED}
    return replace(std, **{name: math.hypot(getattr(std, name), off) for name, off in apart.items()})


def _sharp(samples: Array) -> Array:
    """Parabolas through every five samples, shape (n,): sharper than the estimate, and noisier."""
    made = samples.copy()
    if len(samples) > len(_PARABOLA):
        made[2:-2] = np.convolve(samples, _PARABOLA, "valid")
    return made


def _with_hidden(
    std: StepFigures, figures: StepFigures, smooth: Sequence[StepFigures | None], sharp: Sequence[StepFigures | None]
) -> StepFigures:
    """The uncertainties with what the estimate has smoothed away of a corner.

    A sharper reading of the samples departs from the estimate by noise, and by no more than noise makes of resampled
    samples; what it departs by beyond that is granted.
    """
    with np.errstate(invalid="ignore"):  # a time that is past the record in both
        apart = np.array([
            np.full(len(astuple(figures)), math.nan) if a is None or b is None else np.subtract(astuple(b), astuple(a))
            for a, b in zip(smooth, sharp, strict=True)
        ])  # fmt: skip
    known = np.isfinite(apart[1:]).all(axis=0) & np.isfinite(apart[0])
    hidden = np.zeros(apart.shape[1])
    beyond = np.abs(apart[0, known] - apart[1:, known].mean(axis=0))
    hidden[known] = np.where(beyond > CRITERIA.sharper * apart[1:, known].std(axis=0), beyond, 0.0)
    return StepFigures(*np.hypot(astuple(std), hidden).tolist())


def _sharper(
    figures: StepFigures, std: StepFigures, sharp: Sequence[StepFigures | None], interval_s: float
) -> tuple[StepFigures, StepFigures]:
    """Times by the sharper reading where noise leaves it sure to within what sampling hides."""
    if sharp[0] is None or None in sharp:
        return figures, std
    resampled = np.array([astuple(one) for one in sharp[1:] if one is not None])
    for i, name in enumerate(_NAMES):
        value = getattr(figures, name)
        found = about(resampled[:, i], value) if name.endswith("_s") and math.isfinite(value) else math.inf
        if found < UNIFORM * interval_s:
            figures = replace(figures, **{name: getattr(sharp[0], name)})
            std = replace(std, **{name: found})
    return figures, std


def _spread(columns: Array, figures: StepFigures, missing: int) -> StepFigures:
    if missing or len(columns) < 2:
        return StepFigures(*[math.inf] * len(astuple(figures)))
    return StepFigures(*(about(column, value) for column, value in zip(columns.T, astuple(figures), strict=True)))


def _without_tone(step: _Step) -> tuple[_Step, Tone | None]:
    """The step without a tone that goes on where the response stands, before it and at its end."""
    interval_s = float(np.median(np.diff(step.time_s)))
    before_s = step.time_s[0] + interval_s * np.arange(-len(step.before), 0)
    tail_s = step.time_s[step.tail]
    segments = [(before_s[-len(step.rest) :], step.rest), (tail_s, step.response[step.tail])]
    tone = standing_tone([(at_s, _straightened(values)) for at_s, values in segments if len(values) > 2])
    if tone is None:
        return step, None
    before, response = step.before - tone.at(before_s), step.response - tone.at(step.time_s)
    return replace(step, before=before, response=response), tone


def _whitener(step: _Step) -> Array:
    """From the quieter of the stretches in which the response stands; what noise hides within a code has no colour."""
    segments = [_straightened(values) for values in (step.rest, step.response[step.tail]) if len(values) > 2]
    if not segments:
        return np.ones(1)
    quietest = min(segments, key=lambda values: float(np.std(values)))
    if before_rounding(float(np.std(quietest)), step.grid) == 0.0:
        return np.ones(1)
    return whitener_of(quietest)


def _straightened(values: Array) -> Array:
    """Less the straight line through it."""
    return weighted_line(np.linspace(-1.0, 1.0, len(values)), values).residuals


def jumps(values: Array) -> list[int]:
    """Samples at which the command jumps from standing still to standing still."""
    change = np.abs(np.diff(values))
    still = np.concatenate(([True, True], change == 0.0, [True, True]))
    large = np.flatnonzero(change > max(CRITERIA.jump * float(np.ptp(values)), 0.0))
    # still[i + 2] belongs to change[i]: two samples at rest on either side make a step of it
    return [int(i) + 1 for i in large if still[i : i + 2].all() and still[i + 3 : i + 5].all()]
