"""A look at recordings before they are fitted, and at a fit before it is believed: a sentence for each doubt."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hil.errors import FileError
from hil.identification.preparation.clipped import without_clipped
from hil.identification.preparation.content import is_of_its_origin
from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.disagreement import disagreement
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.feedback import runs_in_a_loop
from hil.identification.preparation.plausibility.look import implausible
from hil.identification.preparation.plausibility.suspicion import Suspicion, can_be_held_against
from hil.identification.preparation.plausibility.time_unit import wrong_time
from hil.identification.preparation.repeated import stale_sentence, without_held, without_stale
from hil.identification.preparation.sub_sample_response import sub_sample_limits
from hil.identification.preparation.time_constant import time_constant_s
from hil.language.note import Note
from hil.physics.model import Model
from hil.physics.plant import Parameters, Plant
from hil.physics.transfer_function import from_parameters
from hil.record.recording import Array
from hil.signals.tone import power_of

LINEAR = "transfer-function"


@dataclass(frozen=True, slots=True)
class Looked:
    """Experiments as they are fitted; what was done to them, and what stays doubtful, in words.

    `suspicions`: headings that look wrong beside the start. A unit unlike a typical one may be right all the same: the
    fit tells (see `Suspicion.outweighs`).
    """

    experiments: tuple[Experiment, ...]
    notes: tuple[Note, ...]
    suspicions: tuple[Suspicion, ...] = ()


def look(model: Model, experiments: Sequence[Experiment]) -> Looked:
    """Leave out what is no measurement; say what recordings cannot tell, or look like.

    Raises:
        FileError: samples so far apart that a plant of this kind moves between them alone, as in a wrong unit of time.
    """
    strange = [e for e in experiments if not is_of_its_origin(model, e)]
    held_against = strange if can_be_held_against(model) else []
    suspicions = wrong_time(model, held_against)
    slow = [sentence for e in held_against for sentence in _too_slow(model, e)]
    if slow and suspicions:
        raise FileError(suspicions[0].sentence)
    kept, notes = [], []
    for e in experiments:
        suspicions += implausible(model, e) if e in held_against else ()
        measured, left_out = without_invalid(e)
        kept.append(measured)
        notes += [*left_out, *_in_a_loop(e)]
    notes += [*slow, *one_frequency(experiments), *disagreement(kept)]
    return Looked(tuple(kept), tuple(notes), tuple(suspicions))


def without_invalid(e: Experiment) -> tuple[Experiment, list[Note]]:
    """The experiment without samples that are no measurement (clipped, held, not measured anew), and that in words."""
    measured, clipped = without_clipped(e)
    measured, held = without_held(measured)
    measured, repeated = without_stale(measured)
    return measured, [*clipped, *held, *([stale_sentence(e, repeated)] if repeated else [])]


def believed(suspicions: Sequence[Suspicion], fits: Mapping[str, float], at_bounds: bool) -> tuple[Note, ...]:
    """What is still to be said of suspicions where recordings were fitted as they say they are, fits in %.

    `at_bounds`: whether the fit drove parameters to their bounds.

    Raises:
        FileError: a suspicion outweighs the fit.
    """
    for suspicion in suspicions:
        if suspicion.outweighs(fits[suspicion.recording], at_bounds=at_bounds):
            raise FileError(suspicion.sentence)
    return tuple(Note("{doubt}. Other values of the plant fit it as it is", doubt=s.sentence) for s in suspicions)


def doubts(model: Model, experiments: Sequence[Experiment], fits: Mapping[str, float]) -> tuple[Note, ...]:
    """What of a fitted model should not be believed as it stands."""
    below = [
        Note(
            "the fit is {fit:.3g} %: a constant would do better; is it the right channel, unit, sign and plant?",
            fit=fit,
        ).of(name)
        for name, fit in fits.items()
        if fit < 0.0
    ]
    away = [sentence for e in experiments for sentence in _runs_away(model, e)]
    sub_sample = sub_sample_limits(model, experiments) if model.plant == LINEAR else ()
    beyond = _beyond_nyquist(model, experiments)
    return (*below, *away, *sub_sample, *beyond, *_integrates(model), *runs_the_other_way(model))


def _runs_away(model: Model, e: Experiment) -> list[Note]:
    """What is said of a response that grows and grows while its command does not: faster than any integrator's."""
    if model.plant != LINEAR or len(e.output) < CRITERIA.grown_samples:
        return []

    def sizes(values: Array) -> Array:
        return np.array([float(np.abs(part - values[0]).max()) for part in np.array_split(values, 4)])

    out, given = sizes(e.output), sizes(e.on_grid_input())
    if not np.all(out[1:] > CRITERIA.grows * out[:-1]) or given[-1] > CRITERIA.grows * given[:-1].max():
        return []
    unstable = Note(
        "the output grows ever faster while the input does not: the plant is unstable, and no stable form fits it. "
        "Record it in the loop that holds it"
    )
    return [unstable.of(e.name)]


def _too_slow(model: Model, e: Experiment) -> list[Note]:
    constant_s = time_constant_s(model, e)
    if not 0.0 < 2.0 * constant_s < e.interval_s:
        return []
    slow = Note(
        "samples lie {apart_s:.3g} s apart, and a {plant} follows its command within {constant_s:.2g} s; is the unit "
        "of time right? If it is, sample at {rate_hz:g} Hz or faster",
        apart_s=e.interval_s, plant=Note(model.definition.title), constant_s=constant_s,
        rate_hz=enough_hz(1.0 / constant_s),
    )  # fmt: skip
    return [slow.of(e.name)]


def one_frequency(experiments: Sequence[Experiment]) -> list[Note]:
    """What is said where every command holds the same single frequency."""
    found_hz = [single_frequency_hz(e.on_grid_input(), e.interval_s) for e in experiments]
    if not found_hz or not all(found_hz) or max(found_hz) > CRITERIA.same_frequency * min(found_hz):
        return []
    one = Note(
        "one frequency, {frequency_hz:.4g} Hz, determines a gain and a phase. The gain at rest and the order are not "
        "identifiable: add a frequency or steps",
        frequency_hz=found_hz[0],
    )
    return [one]


def single_frequency_hz(values: Array, interval_s: float) -> float:
    """The frequency of a steady sine, 0 for anything else."""
    power = power_of(values)
    at, total = int(np.argmax(power)), float(power.sum())
    if at < CRITERIA.sine_periods or total == 0.0:
        return 0.0
    near = float(power[max(at - CRITERIA.line_width, 0) : at + CRITERIA.line_width + 1].sum())
    return at / (len(values) * interval_s) if near > CRITERIA.all_power * total else 0.0


def _in_a_loop(e: Experiment) -> list[Note]:
    if not runs_in_a_loop(e.on_grid_input(), e.output):
        return []
    seen = Note(
        "the command answers to the noise of the output: this was recorded in a closed loop. An open-loop fit may be "
        "wrong, and no stable form fits an unstable plant"
    )
    return [seen.of(e.name)]


def fastest_shown_rad_s(experiments: Sequence[Experiment]) -> float:
    """The fastest pole that samples so far apart can show."""
    return math.pi / min(e.interval_s for e in experiments)


def fastest_pole_rad_s(values: Parameters) -> float:
    """Of a transfer function by its parameters; 0 for one without poles."""
    return float(np.abs(from_parameters(values).poles).max(initial=0.0))


def _beyond_nyquist(model: Model, experiments: Sequence[Experiment]) -> list[Note]:
    limit, notes = fastest_shown_rad_s(experiments), []
    for name, value in _corners(model).items():
        if value <= limit:
            continue
        note = Note(
            "{name} at {corner:.4g} rad/s is no measurement: samples {apart_s:.3g} s apart show at most {limit:.4g} "
            "rad/s",
            name=name, corner=value, limit=limit, apart_s=math.pi / limit,
        )  # fmt: skip
        if not model.origin.get("discrepancy"):  # a wrong model's poles ask for no rate
            rate_hz = _rate_hz(model, value, limit)
            note = Note("{note}. Sample at {rate_hz:g} Hz or faster", note=note, rate_hz=rate_hz)
        notes.append(note)
    return notes


def _corners(model: Model) -> dict[str, float]:
    """The poles of a fitted model that were estimated, in rad/s, by what they are called."""
    if model.plant == LINEAR:
        return {Note("a pole"): fastest_pole_rad_s(model.values)}
    return {name: v.value for name, v in model.parameters.items() if v.unit == "rad/s" and v.std is not None}


def enough_hz(corner_rad_s: float) -> float:
    """The rate, to two digits, that gives a first-order lag of this corner ten samples in its rise.

    Åström and Wittenmark, Computer-Controlled Systems, take four to ten.
    """
    return float(f"{CRITERIA.rise_samples * corner_rad_s / math.log(9.0):.2g}")


def too_slow_hz(model: Model, experiments: Sequence[Experiment]) -> float:
    """The rate that the fastest pole of a fitted model needs; 0 where the samples show it, or the model is wrong."""
    if model.origin.get("discrepancy"):
        return 0.0
    fastest = max(_corners(model).values(), default=0.0)
    limit = fastest_shown_rad_s(experiments)
    return _rate_hz(model, fastest, limit) if fastest > limit else 0.0


def _rate_hz(model: Model, corner_rad_s: float, limit_rad_s: float) -> float:
    """The rate for a pole beyond what samples show; of a form that nobody's physics bounds, for a decade beyond."""
    return enough_hz(min(corner_rad_s, 10.0 * limit_rad_s) if model.plant == LINEAR else corner_rad_s)


def runs_the_other_way(model: Model) -> tuple[Note, ...]:
    """What is said of a transfer function with a gain below zero, beyond its uncertainty."""
    gains = [model.parameters[name] for name in ("gain", "integrator_gain")] if model.plant == LINEAR else []
    if not any(gain.value < -CRITERIA.significant * gain.std for gain in gains if gain.std):
        return ()
    return (Note("the output falls where the input rises: is its sign right, or that of the input?"),)


def _integrates(model: Model) -> tuple[Note, ...]:
    plant: Plant = model.definition
    if plant.integrates is None or not plant.integrates(model.values):
        return ()
    return (Note("the output goes on while the input stands: the plant integrates"),)
