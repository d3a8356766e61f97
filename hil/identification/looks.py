"""A look at recordings before they are fitted, and at a fit before it is believed: a sentence for each doubt."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hil.errors import FileError
from hil.identification.clipped import without_clipped
from hil.identification.experiment import Experiment
from hil.identification.feedback import runs_in_a_loop
from hil.identification.noise import NOISE_OVER_RESOLUTION, resolution, white_floor
from hil.identification.time_constant import time_constant_s
from hil.physics.model import Model
from hil.physics.plant import Plant
from hil.physics.transfer_function import from_parameters
from hil.record.recording import Array

_REVERSED = -0.7  # correlation with a typical unit from which on an output runs the other way
_SAME_FREQUENCY, _LEAST_PERIODS, _LINE_WIDTH, _ALL_POWER = 1.05, 3, 3, 0.999  # of a command that is one sine
_SAME_RUN = 0.95  # share of equal runs of repeats, of a channel that was held between slower samples
_LINEAR = "transfer-function"


@dataclass(frozen=True, slots=True)
class Looked:
    """Experiments as they are fitted, what was done to them, and what stays doubtful, in words."""

    experiments: tuple[Experiment, ...]
    said: tuple[str, ...]


def look(model: Model, experiments: Sequence[Experiment]) -> Looked:
    """Leave out what is no measurement; say what recordings cannot tell, or look like.

    Raises:
        FileError: an output runs the other way than any unit of this plant.
    """
    kept, said = [], []
    for e in experiments:
        _refuse_reversed(model, e)
        told, clipped = without_clipped(e)
        told, held = without_held(told)
        kept.append(told)
        said += [*clipped, *held, *_too_slow(model, e), *_in_a_loop(e)]
    return Looked(tuple(kept), (*said, *one_frequency(experiments)))


def without_held(e: Experiment) -> tuple[Experiment, list[str]]:
    """The experiment without samples that only repeat one of a slower channel, and that in words."""
    starts = np.flatnonzero(np.diff(e.output, prepend=np.nan) != 0.0)
    lengths = np.diff(starts)
    if len(lengths) < 20:
        return e, []
    usual = int(np.median(lengths))
    fresh = e.output[starts]
    noisy = white_floor(fresh) >= NOISE_OVER_RESOLUTION * resolution(fresh) > 0.0
    if usual < 2 or not noisy or np.mean(lengths == usual) < _SAME_RUN:
        return e, []
    repeated = np.ones(len(e.output), dtype=np.bool_)
    repeated[starts] = False
    said = (
        f"{e.name}: channel '{e.output_heading}' shows each value {usual} times: it was sampled every "
        f"{usual * e.interval_s:.4g} s and held in between; the repeats are left out"
    )
    return e.without(repeated), [said]


def doubts(model: Model, experiments: Sequence[Experiment], fits: Mapping[str, float]) -> tuple[str, ...]:
    """What of a fitted model should not be believed as it stands."""
    below = [
        f"{name}: the fit is below 0 %: a constant would do better; is it the right channel, unit, sign and plant?"
        for name, fit in fits.items()
        if fit < 0.0
    ]
    return (*below, *_beyond_nyquist(model, experiments), *_integrates(model))


def _refuse_reversed(model: Model, e: Experiment) -> None:
    plant = model.definition
    if "any" in (plant.inputs[0].unit, plant.output.unit) or plant.observer is not None:
        return  # a gain may have either sign, a position that adds up has none of its own
    expected = e.respond(plant, model.values, model.active_effects)[0]
    if _correlation(expected[e.told], e.told_output) < _REVERSED:
        raise FileError(
            f"{e.name}: the output '{e.output_heading}' runs the other way: where the command of a {plant.title} goes "
            "up, it goes down; is its sign right, or that of the command?"
        )


def _correlation(first: Array, second: Array) -> float:
    spread = float(np.std(first) * np.std(second))
    if spread == 0.0:
        return 0.0
    return float(np.mean((first - first.mean()) * (second - second.mean()))) / spread


def _too_slow(model: Model, e: Experiment) -> list[str]:
    if model.definition.inputs[0].unit == "any":
        return []
    constant_s = time_constant_s(model, e)
    if not 0.0 < 2.0 * constant_s < e.interval_s:
        return []
    apart = f"samples lie {e.interval_s:.3g} s apart"
    follows = f"a {model.definition.title} has followed its command after {constant_s:.2g} s"
    return [f"{e.name}: {apart}, and {follows}; is the unit of time right?"]


def one_frequency(experiments: Sequence[Experiment]) -> list[str]:
    """What is said where every command holds the same single frequency."""
    found_hz = [single_frequency_hz(e.on_grid_input(), e.interval_s) for e in experiments]
    if not found_hz or not all(found_hz) or max(found_hz) > _SAME_FREQUENCY * min(found_hz):
        return []
    tells = f"the command holds one frequency, {found_hz[0]:.4g} Hz, which tells two numbers, a gain and a phase there"
    return [f"{tells}; the gain at rest and the order are not determined: add a frequency or steps"]


def single_frequency_hz(values: Array, interval_s: float) -> float:
    """The frequency of a steady sine, 0 for anything else."""
    power = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values)))) ** 2
    at, total = int(np.argmax(power)), float(power.sum())
    if at < _LEAST_PERIODS or total == 0.0:
        return 0.0
    near = float(power[max(at - _LINE_WIDTH, 0) : at + _LINE_WIDTH + 1].sum())
    return at / (len(values) * interval_s) if near > _ALL_POWER * total else 0.0


def _in_a_loop(e: Experiment) -> list[str]:
    if not runs_in_a_loop(e.on_grid_input(), e.output):
        return []
    seen = "the command answers to the noise of the output: this was recorded in a closed loop"
    return [
        f"{e.name}: {seen}. A fit as if in an open one may be wrong, and no stable form fits an unstable plant",
    ]


def _beyond_nyquist(model: Model, experiments: Sequence[Experiment]) -> tuple[str, ...]:
    fastest_s = min(e.interval_s for e in experiments)
    limit = math.pi / fastest_s
    corners = {name: v.value for name, v in model.parameters.items() if v.unit == "rad/s" and v.std is not None}
    if model.plant == _LINEAR:
        corners = {"a pole": float(np.abs(from_parameters(model.values).poles).max(initial=0.0))}
    shown = f"what samples {fastest_s:.3g} s apart can show ({limit:.4g} rad/s)"
    beyond = [f"{name} at {value:.4g} rad/s" for name, value in corners.items() if value > limit]
    return tuple(f"{what} lies beyond {shown}: it is no measurement" for what in beyond)


def _integrates(model: Model) -> tuple[str, ...]:
    plant: Plant = model.definition
    if plant.integrates is None or not plant.integrates(model.values):
        return ()
    return ("the output goes on while the input stands: the plant integrates",)
