"""Channels and stamps that are not in the unit that their heading says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.errors import FileError, UnitError
from hil.identification.experiment import Experiment
from hil.identification.grey_box import fit_percent
from hil.physics.model import Model
from hil.record.recording import Array, split_heading
from hil.units import scale_and_offset

# Units in which channels of one kind are written; one of them taken for another is off by their ratio.
_MISTAKEN = (
    ("l/min", "ml/min", "l/s", "m^3/h", "m^3/s", "gallon/minute", "cm^3/s"),
    ("bar", "mbar", "kPa", "MPa", "Pa", "psi"),
    ("m", "cm", "mm", "um", "inch"),
    ("N", "kN", "kgf", "lbf"),
    ("A", "mA"),
    ("V", "mV"),
    ("%", "1"),
    ("N*m", "kgf*m", "lbf*ft"),
    ("rad", "deg"),
    ("m/s", "mm/s", "mm/min", "m/min"),
    ("rpm", "rad/s", "Hz"),
)
_BARE = ("%", "rad", "rpm")  # kinds that arithmetic of units does not tell from other numbers
_LARGEST_FACTOR = 2000.0
# Decimals that were lost.
_DECIMALS = (1000.0, 100.0, 10.0, 0.1, 0.01, 0.001)
_FACTOR_TOLERANCE = 0.08
# Those of time: minutes, milliseconds, and lost decimals. Stamps are exact where the unit is all that is wrong.
_TIME_FACTORS = (1000.0, 100.0, 60.0, 10.0, 0.1, 1 / 60.0, 0.01, 0.001)
_TIME_TOLERANCE = 0.01
GOOD_FIT = 80.0
_POOR_FIT = 50.0
_AS_THEN = 2.0  # per cent, from the fit that a recording had when a model was made of it
_MUCH_LESS, _HALF = 0.2, 0.5
_LESS_THAN_OWN, _SAME_FIT = 10.0, 0.1
_ALSO_MOVES, _CHANGED_GAIN = 0.5, 1.5
# Below and above so many times what is expected, in level and moves alike, no effect makes an output of the same shape;
# an effect beside a wrong unit hides how many times exactly.
_TOO_SMALL, _TOO_LARGE = 0.12, 5.0


def unit_factors(unit: str) -> tuple[float, ...]:
    """Factors that a wrong unit brings to a channel of this one."""
    factors = set(_DECIMALS)
    for group in _MISTAKEN:
        try:
            sizes = [scale_and_offset(other, unit)[0] for other in group]
        except UnitError:
            continue
        belongs = any(abs(np.log(size)) < _FACTOR_TOLERANCE for size in sizes)
        if belongs or group[0] not in _BARE:
            both = {factor for size in sizes for factor in (size, 1.0 / size)}
            large = {f for f in both if _FACTOR_TOLERANCE < abs(np.log(f)) < np.log(_LARGEST_FACTOR)}
            factors |= {f for f in large if all(abs(np.log(f / known)) > 1e-6 for known in factors)}
    return tuple(sorted(factors, key=lambda f: float(f"{f:.12g}")))


def is_of_its_origin(model: Model, e: Experiment) -> bool:
    """Whether this is a recording that the model was identified from: it fits as it did then."""
    fits = {str(name).rpartition("/")[2]: fit for name, fit in (model.origin.get("fit_percent") or {}).items()}
    then = fits.get(e.name.rpartition("/")[2])
    if then is None:
        return False
    free_run = e.respond(model.definition, model.values, model.active_effects)[0]
    return bool(abs(fit_percent(e.output, free_run) - float(then)) < _AS_THEN)


def refuse_reversed(model: Model, e: Experiment, simulated: Array) -> None:
    """An output that is what the model expects but for its sign; `simulated` of `expected`.

    Raises:
        FileError: it runs the other way.
    """
    before = fit_percent(e.output, simulated)
    if model.definition.observer is None:
        slope, fit = _moves(simulated, e.output)
        turned = fit if slope < 0.0 else 0.0
    else:
        turned = _in_another_unit(model, e, len(e.drive.inputs), -1.0).fit
    if before < 0.0 and turned > _POOR_FIT:
        raise FileError(
            f"{e.name}: the output '{e.output_heading}' runs the other way than the model: where the model rises, it "
            "falls; is its sign right, or that of the command?"
        )


def expected(model: Model, e: Experiment) -> Array:
    """What the model expects; led back to the recording where it would drift away from any, right or wrong."""
    plant = model.definition
    response: Array = e.respond(plant, model.values, model.active_effects, following=plant.observer is not None)[0]
    return response


def good_fit(model: Model) -> float:
    """From which fit on the channels are what they say; less where the model never fitted well, run freely."""
    own = [] if model.definition.observer else list((model.origin.get("fit_percent") or {}).values())
    return min(GOOD_FIT, float(np.median(own)) - _LESS_THAN_OWN) if own else GOOD_FIT


def refuse_wrong_unit(model: Model, e: Experiment, simulated: Array) -> None:
    """A channel that is what the model expects but for the factor of a unit; `simulated` of `expected`.

    Raises:
        FileError: it looks like a wrong unit.
    """
    before, led_back = fit_percent(e.output, simulated), model.definition.observer is not None
    if not (before < _POOR_FIT or led_back):  # led back, a model fits half of anything
        return
    moves, fit_of_moves = _moves(simulated, e.output)
    level, fit_of_level = _times(simulated, e.output)  # small moves may be smaller for a reason, a level hardly is
    also_moves = abs(moves / level - 1.0) < _ALSO_MOVES if level else False
    for slope, fit in ((moves, fit_of_moves), (level, fit_of_level if also_moves else 0.0)):
        beyond_effects = also_moves and not led_back and not _TOO_SMALL < slope < _TOO_LARGE
        factor = _unit_factor(e.output_heading, slope, np.inf if beyond_effects else _FACTOR_TOLERANCE)
        if factor and fit > GOOD_FIT:
            raise FileError(
                f"{e.name}: channel '{e.output_heading}' is {slope:.3g} times what the model expects; "
                f"a factor near {factor:.4g} looks like a wrong unit"
            )
    _refuse_what_fits_in_another_unit(model, e, before)


def _refuse_what_fits_in_another_unit(model: Model, e: Experiment, before: float) -> None:
    tried = [
        _in_another_unit(model, e, channel, k)
        for channel in range(len(e.drive.inputs) + 1)
        for k in unit_factors(_unit_of(model, e, channel))
    ]
    best = max(tried, key=lambda found: found.fit)
    likely = [found for found in tried if found.factor == best.factor and found.fit >= best.fit - _SAME_FIT]
    if best.fit > _enough(model, before, best.factor):
        first, *others = likely
        also = "".join(f" (or '{other.channel}' {other.how} by it)" for other in others)
        raise FileError(
            f"{e.name}: channel '{first.channel}' fits the model only when {first.how} by {first.factor:.4g}{also}; "
            "it looks like a wrong unit"
        )


@dataclass(frozen=True, slots=True)
class _InAnotherUnit:
    """The fit of the model with an input multiplied by a factor, or with the output divided by it."""

    channel: str
    how: str
    factor: float
    fit: float


def _in_another_unit(model: Model, e: Experiment, channel: int, factor: float) -> _InAnotherUnit:
    """`channel`: of the inputs, in their order; the output after them."""
    if channel < len(e.drive.inputs):
        inputs = e.drive.inputs.copy()
        inputs[channel] *= factor
        heading = model.definition.inputs[channel].heading if channel else e.input
        read = replace(e, drive=replace(e.drive, inputs=inputs))
        return _InAnotherUnit(heading, "multiplied", factor, fit_but_for_gain(model, read))
    # a loop that starts at its first reading starts somewhere else
    begins = replace(e.drive, first_output=e.drive.first_output / factor)
    read = replace(e, drive=begins, output=e.output / factor)
    return _InAnotherUnit(e.output_heading, "divided", factor, fit_but_for_gain(model, read))


def fit_but_for_gain(model: Model, e: Experiment) -> float:
    """The fit of the model; with a gain that may have changed besides, where it fits well so."""
    simulated = expected(model, e)
    fit = fit_percent(e.output, simulated)
    if model.definition.observer is not None:
        return fit
    (gain, of_moves), (of_level, _) = _moves(simulated, e.output), _times(simulated, e.output)
    likely = all(1.0 / _CHANGED_GAIN < times < _CHANGED_GAIN for times in (gain, of_level))
    return max(fit, of_moves) if likely and of_moves > GOOD_FIT else fit


def _enough(model: Model, before: float, factor: float) -> float:
    """The fit in another unit from which no physics is looked for.

    What integrates does not move many times as much as expected for any reason: friction stops it from moving.
    """
    halved = 100.0 - _HALF * (100.0 - before)
    if model.definition.observer is None:
        return max(halved, good_fit(model))
    if factor > _TOO_LARGE:
        return halved
    return GOOD_FIT if before < _POOR_FIT else 100.0 - _MUCH_LESS * (100.0 - before)


def _times(simulated: Array, measured: Array) -> tuple[float, float]:
    """How many times the one is in the other, and how much of that one (rms, in %) this explains."""
    power, size = float(simulated @ simulated), float(np.sqrt(measured @ measured))
    if power == 0.0 or size == 0.0:
        return 0.0, 0.0
    slope = float(simulated @ measured) / power
    return slope, 100.0 * (1.0 - float(np.linalg.norm(measured - slope * simulated)) / size)


def _moves(simulated: Array, measured: Array) -> tuple[float, float]:
    """The same of how they move about their means."""
    return _times(simulated - simulated.mean(), measured - measured.mean())


def _unit_of(model: Model, e: Experiment, channel: int) -> str:
    """The unit of an input, in their order; of the output after them."""
    if channel == len(e.drive.inputs):
        return split_heading(e.output_heading)[1]
    return model.definition.inputs[channel].unit if channel else split_heading(e.input)[1]


def _unit_factor(heading: str, slope: float, tolerance: float) -> float | None:
    """The factor of a wrong unit of this channel that is nearest, within a tolerance of its logarithm."""
    if slope <= 0.0:
        return None
    near = min(unit_factors(split_heading(heading)[1]), key=lambda factor: abs(np.log(slope / factor)))
    return near if abs(np.log(slope / near)) < tolerance else None


def refuse_wrong_time(model: Model, experiments: Sequence[Experiment]) -> None:
    """Stamps of a wrong unit make a unit look slow or quick: no channel shows it, and physics would be found for it.

    Suspected only where the samples are as many times as far apart as a wrong unit makes them; recordings at a tenth
    of the rate are common, so that the model has to fit much better besides.

    Raises:
        FileError: recordings whose time is off by the factor of a wrong unit.
    """
    known = [float(interval_s) for interval_s in model.origin.get("intervals_s") or ()]
    suspected: dict[float, list[Experiment]] = {}
    for e in experiments:
        if (factor := _time_factor(e.interval_s, known)) is not None:
            suspected.setdefault(factor, []).append(e)
    for factor, group in suspected.items():
        votes = [_vote(model, e, factor) for e in group]
        if votes.count(1) > votes.count(-1):
            e = group[votes.index(1)]
            raise FileError(
                f"{e.name}: its samples are {factor:.4g} times as far apart as where the model was identified, and "
                f"the model fits only with the time divided by {factor:.4g}; it looks like a wrong unit of time. If "
                "it is right, identify the model on a recording of this interval too"
            )


def _vote(model: Model, e: Experiment, factor: float) -> int:
    """1 where the model fits much better with the time divided by a factor, −1 where much worse, 0 where neither.

    Its gain and level are left free: they have nothing to do with time.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what leads a simulation back is not made for seconds
        fits = [_moves(expected(model, t), t.output)[1] for t in (e, _quicker(e, factor))]
    recorded, divided = 100.0 - np.nan_to_num(fits, nan=-np.inf)
    if min(recorded, divided) > 100.0 - _POOR_FIT or min(recorded, divided) > _HALF * max(recorded, divided):
        return 0
    return 1 if divided < recorded else -1


def _time_factor(interval_s: float, known: Sequence[float]) -> float | None:
    """How many times too far apart the samples are if the unit of time is wrong; None if they are as they were."""
    times = [interval_s / other for other in known]
    if any(abs(np.log(ratio)) < _TIME_TOLERANCE for ratio in times):
        return None
    return next((f for f in _TIME_FACTORS for ratio in times if abs(np.log(ratio / f)) < _TIME_TOLERANCE), None)


def _quicker(e: Experiment, factor: float) -> Experiment:
    """The experiment in so many times less time."""
    drive = replace(e.drive, interval_s=e.drive.interval_s / factor)
    grid_s = None if e.grid_s is None else e.grid_s / factor
    read_s = None if e.read_s is None else e.read_s / factor
    return replace(e, time_s=e.time_s / factor, drive=drive, grid_s=grid_s, read_s=read_s)
