"""Grey-box identification: the physical parameters of a plant, from several recordings together."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from threading import Lock

import numpy as np

from hil.catalog import entries, models
from hil.identification.frequency.table_fit import AS_THEY_SHOW, Orders
from hil.identification.grey_box.alternative_optima import alternative_optima
from hil.identification.grey_box.criteria import CRITERIA, EFFORT
from hil.identification.grey_box.discrepancy import discrepancy_of, note_of
from hil.identification.grey_box.estimate import Estimate, Unknown, estimate
from hil.identification.grey_box.free import all_values, check_free, effects_at, moved, named_values, unknown_of
from hil.identification.grey_box.lines import common_line, line_at
from hil.identification.grey_box.multistart import multistart
from hil.identification.grey_box.residuals import Residuals
from hil.identification.grey_box.structure import StructureChoice, choose_structure, with_orders
from hil.identification.grey_box.systematic import Systematic, systematic
from hil.identification.grey_box.witnesses import witnesses
from hil.identification.preparation.averaged import with_means
from hil.identification.preparation.content import content_of
from hil.identification.preparation.experiment import DEAD, Experiment, require_excitation, sample_intervals_s
from hil.identification.preparation.gaps import bridged
from hil.identification.preparation.initial_condition import start_slope, with_free_start
from hil.identification.preparation.mean_period import with_mean_periods
from hil.identification.preparation.recording_quality import (
    LINEAR,
    believed,
    doubts,
    fastest_pole_rad_s,
    fastest_shown_rad_s,
    look,
    one_frequency,
    too_slow_hz,
)
from hil.identification.preparation.start_in_motion import begins_at_rest, begun_in_motion, is_worth, levels_of
from hil.identification.preparation.sub_sample_response import dead_time_std_s, responds_within_sample
from hil.identification.preparation.travel import travelled
from hil.identification.uncertainty.fit import explains_little, fit_percent, rms
from hil.identification.uncertainty.noise import Measured, channel_floor, measured_noise, resolution
from hil.language.note import Note
from hil.physics.model import Covariance, Model, Value, load_model, typical_model
from hil.physics.plant import Parameter, Parameters, Plant, Structure
from hil.record.recording import Array, Mask
from hil.record.run_folder.progress import Progress, quiet
from hil.signals.interval import COVERED, rounded, width
from hil.signals.products import one_blas_thread

# Simulations after which a fit is usually half done, and the share that is done before it.
_USUAL_SIMULATIONS, _BEFORE_FIT = 60.0, 0.1
_OF_DYNAMICS = ("s", "rad/s", "1")  # units of time constants, corners and dampings
_STARTS = 2  # times that what moved a unit before is fitted by turns with the model

Tick = Callable[[], None]


@dataclass(frozen=True, slots=True)
class GreyBoxFit:
    """A model fitted to experiments, the parameters that ended on a bound, and fit % per recording.

    `readings`: what a reader of the parameters would work out first, in words.
    """

    model: Model
    on_bound: tuple[str, ...]
    fits: dict[str, float]
    notes: tuple[Note, ...]
    readings: tuple[Note, ...] = ()

    def summary(self) -> str:
        """A table of parameters with their uncertainty, fits and notes, for a terminal."""
        rows = [f"{self.model.plant}", *(f"  {reading}" for reading in self.readings)]
        absent = self.model.definition.typical if self.model.plant == LINEAR else {}  # what a form does not have
        for name, found in named_values(self.model).items():
            if found.std is None and found.value == absent.get(name):
                continue
            row = (
                f"  {name:18} {rounded(found.value, found.std):>12} {width(found.std):12} {found.unit:8}{_whole(found)}"
            )
            rows.append(row.rstrip())
        rows += [f"  fit {fit:7.2f} %  {name}" for name, fit in self.fits.items()]
        return "\n".join([*rows, *(f"  note: {note}" for note in self.notes)])


def _whole(found: Value) -> str:
    """With what the stated calibrations add; nothing where none was stated."""
    whole = found.std_with_calibration
    if whole is None or not found.calibration_std or not np.isfinite(whole):
        return ""
    return f"with calibration ± {COVERED * whole:.2g}"


def starting_model(plant_or_file: str, free: Sequence[str] = ()) -> Model:
    """The start of an identification: a plant at its typical values, or a model: its file, or an installed one's name.

    Raises:
        FileError, UnknownNameError: no such plant or file. SettingError: a parameter to free is unknown.
    """
    path = Path(plant_or_file)
    installed = plant_or_file in models() and plant_or_file not in {entry.name for entry in entries("plants")}
    model = load_model(path) if path.suffix == ".json" or installed else typical_model(plant_or_file)
    for name in free:
        check_free(model, name)
    return model


@dataclass(frozen=True, slots=True)
class _Asked:
    """Parameters to estimate beside the free ones, the orders of a transfer function, and a counter of simulations."""

    free: Sequence[str]
    orders: Orders
    tick: Tick


def fit_plant(
    model: Model, experiments: Sequence[Experiment], also_free: Sequence[str] = (), progress: Progress = quiet,
    orders: Orders = AS_THEY_SHOW,
) -> GreyBoxFit:  # fmt: skip
    """Estimate the plant's parameters from all experiments together, effects of the model included as they are.

    Args:
        model: start values; parameters that are not free stay at them.
        experiments: what to fit.
        also_free: parameters to estimate beside those that the plant does not hold fixed.
        progress: called with how far it is, a share and what is done; how many simulations a fit takes is a guess.
        orders: what a transfer function is to have; the rest of it is chosen by evidence.

    Raises:
        FileError: no input or no output moves.
        SettingError: orders that none of the plant's structures has.
    """
    with one_blas_thread():
        return _fit_plant(model, experiments, _Asked(also_free, orders, _ticking(progress)), progress)


def _fit_plant(model: Model, experiments: Sequence[Experiment], asked: _Asked, progress: Progress) -> GreyBoxFit:
    require_excitation(experiments)
    progress(0.0, "looking at the recordings")
    still = tuple(
        Note("{stands}: {why}; it is left out", stands=e.where_it_stands, why=DEAD).of(e.name)
        for e in experiments
        if e.stands_still
    )
    used = [e for e in experiments if not e.stands_still]
    model, zero = _with_zero(model, used)
    looked = look(model, used)
    alive = looked.experiments
    still = (*still, *zero, *looked.notes)
    even, remarks = bridged(model, alive)
    found = _fitted(model, even, asked, (*still, *remarks))
    again, remarks = bridged(found.model, alive)
    before, left, later = (sum(int(np.count_nonzero(~e.valid)) for e in each) for each in (alive, even, again))
    if later - left > CRITERIA.late * max(left - before, 0):  # the start settles too soon to be left in
        found, even = _fitted(model, again, asked, (*still, *remarks)), again
    near, has_forms = _near(model, found, even, asked), _structure(found.model) is not _structure(model)
    for _ in range(_STARTS):
        begun = [begun_in_motion(near, e.reading_as_in(near)) for e in even]
        moving = tuple(note for _, own in begun for note in own)
        if not moving:
            break
        moved_before, levels = [e for e, _ in begun], sum(levels_of(e) for e, own in begun if own)
        notes = (*still, *remarks, *moving)
        after = _fitted(near if has_forms else model, moved_before, asked, notes)
        if not is_worth(_errors(found.model, even), _errors(after.model, moved_before), levels):
            break
        if has_forms:  # once it is worth it, its form is chosen anew
            after = _fitted(model, moved_before, asked, notes)
        found, near = after, after.model
    progress(1.0, "fitted")
    found = replace(found, notes=(*found.notes, *believed(looked.suspicions, found.fits, bool(found.on_bound))))
    content = {e.name: content_of(e) for e in used}  # what tells its recordings from any others
    found = replace(found, model=replace(found.model, origin={**found.model.origin, "content": content}))
    return _none_identifiable(found) if model.definition.structures and one_frequency(alive) else found


def _with_zero(model: Model, experiments: Sequence[Experiment]) -> tuple[Model, tuple[Note, ...]]:
    """The model with the zero of its output where the readings say that it is, and what is said of that."""
    zero = model.definition.zero
    if zero is None or (travel := travelled(experiments)) is None:
        return model, ()
    values = zero(model.values, travel)
    notes = tuple(
        Note("'{channel}' reads {least:.4g} to {greatest:.4g}: {name} is taken as {value:.4g}",
             channel=experiments[0].output_heading, least=travel.least, greatest=travel.greatest, name=name,
             value=value)
        for name, value in values.items()
    )  # fmt: skip
    return moved(model, values) if values else model, notes


def _near(model: Model, found: GreyBoxFit, experiments: Sequence[Experiment], asked: _Asked) -> Model:
    """The fitted model, or one that was fitted without the first halves.

    What was fitted as if recordings began at rest may be too wrong to tell that they do not. It is not believed where
    it leaves more than the noise, and nothing shows that they rest.
    """
    if all(begins_at_rest(e) or not _fails(found.model, e) for e in experiments):
        return found.model
    late = [e.without(np.arange(len(e.output)) < len(e.output) // 2) for e in experiments]
    if any(np.ptp(e.valid_output) == 0.0 for e in late):  # what stands still tells no model
        return found.model
    return _fitted(model, late, asked, ()).model


def _errors(model: Model, experiments: Sequence[Experiment]) -> Array:
    """What a model leaves of the readings, shape (n,)."""
    read = [e.reading_as_in(model) for e in experiments]
    return np.concatenate([(e.simulated(model)[0] - e.output)[e.valid] for e in read])


def _fails(model: Model, e: Experiment) -> bool:
    """Whether a model leaves more than the noise."""
    error = _errors(model, [e])
    return float(np.mean(error**2)) * e.weight**2 > CRITERIA.misfit


def _none_identifiable(found: GreyBoxFit) -> GreyBoxFit:
    """Marks all parameters as not identifiable: one excitation frequency fixes only one gain and one phase."""
    parameters = {n: v if v.std is None else replace(v, std=np.inf) for n, v in found.model.parameters.items()}
    return replace(found, model=replace(found.model, parameters=parameters))


def _driven_out(found: Estimate) -> tuple[int, ...]:
    """Places of values that ended on a bound which is no natural end: the fit would have gone on beyond it."""
    return tuple(
        k
        for k, (u, value) in enumerate(zip(found.unknowns, found.values.tolist(), strict=True))
        if u.at_bound(value) and not u.at_natural_end(value) and abs(value) > 1e-3 * u.scale
    )


def _ticking(progress: Progress) -> Tick:
    """Counts simulations, and reports each as progress."""
    counted, one_at_a_time = count(1), Lock()

    def tick() -> None:
        with one_at_a_time:
            done = next(counted)
            progress(
                _BEFORE_FIT + (1.0 - _BEFORE_FIT) * done / (done + _USUAL_SIMULATIONS), f"fitting, simulation {done}"
            )

    return tick


def _fitted(model: Model, experiments: Sequence[Experiment], asked: _Asked, remarks: tuple[Note, ...]) -> GreyBoxFit:
    choice = _structure_of(model, experiments, asked.orders)
    model, note = (model, ()) if choice is None else (_of_structure(model, choice), (choice.sentence,))
    plant = model.definition
    experiments, averaged = with_means(model, experiments)
    experiments, periods = with_mean_periods(model, experiments)
    remarks = (*remarks, *averaged, *periods)
    names = [p.name for p in plant.parameters if _is_free(model, p) or p.name in asked.free]
    names += [name for name in dict.fromkeys(asked.free) if "." in name]
    found, fitting = _best_reading(model, names, experiments, asked.tick)
    used, near = fitting.experiments, model
    if any(e.ripples is not None for e in used):  # what the phase of a dither does is only known about the fit itself
        near = moved(model, _merged(model, found))
        found = fitting.at(_merged(model, found), names)
    found = replace(found, fixed_at_bound=_driven_out(found))
    at = _merged(model, found)
    about = Residuals(plant, used, near.values, effects_at(model.active_effects, at))
    beside = systematic(about, found, {p.name: at[p.name] for p in plant.parameters})
    other, remarks_of_others = alternative_optima(found, at, fitting.at)
    beside = replace(beside, model=beside.model + other, notes=(*beside.notes, *remarks_of_others))
    if choice is not None:
        of_form = np.diag([choice.form_std(u.name) ** 2 for u in found.unknowns])
        beside = replace(beside, model=beside.model + of_form, notes=(*beside.notes, *_other_forms(choice)))
    readings = tuple(_real_pairs(found, beside.model)) if model.plant == LINEAR else ()
    whole = [e if e.whole is None else e.whole.reading_at(e.drive.read_at) for e in used]
    return replace(_result(model, plant, found, whole, (*remarks, *note), beside), readings=readings)


def _structure_of(model: Model, experiments: Sequence[Experiment], orders: Orders) -> StructureChoice | None:
    """The structure that experiments support, if the plant has several and none was chosen before.

    A pole faster than samples can show may stand for samples that were read at the end of their interval: then that is
    tried, unless the recordings declare it.
    """
    if not model.definition.structures or _structure(model) is not None:
        return None
    plant = with_orders(model.definition, orders)
    choice = choose_structure(plant, experiments)
    if model.plant != LINEAR or any(e.reading_known for e in experiments):
        return choice
    if fastest_pole_rad_s(choice.chosen.values) <= fastest_shown_rad_s(experiments):
        return choice
    other = choose_structure(plant, [e.reading_at(1.0) for e in experiments])
    is_plainer = len(other.chosen.structure.free) <= len(choice.chosen.structure.free)
    return other if is_plainer and other.chosen.mean_square <= choice.chosen.mean_square else choice


def _of_structure(model: Model, choice: StructureChoice) -> Model:
    values = {name: Value(value, model.parameters[name].unit) for name, value in choice.chosen.values.items()}
    return replace(model, parameters=values, origin={**model.origin, "structure": choice.chosen.structure.name})


def _real_pairs(found: Estimate, beside: Array) -> Iterator[Note]:
    """Time constants of pairs of poles that are real: what everybody reads, where the pair's own numbers say little."""
    at = {u.name: k for k, u in enumerate(found.unknowns)}
    for pair in ("pair1", "pair2"):
        places = [at[name] for name in (f"{pair}_time", f"{pair}_damping") if name in at]
        if len(places) < 2 or (damping := float(found.values[places[1]])) <= 1.0:
            continue
        time_s, root = float(found.values[places[0]]), math.sqrt(damping**2 - 1.0)
        own = (found.identifiability.whole + beside)[np.ix_(places, places)]
        texts = []
        for sign in (1.0, -1.0):
            slope = np.array([damping + sign * root, time_s * (1.0 + sign * damping / root)])
            std = math.sqrt(float(slope @ own @ slope))
            texts.append(f"{rounded(time_s * (damping + sign * root), std)} {width(std)} s")
        yield Note("the poles of {pair} are real, with time constants of {slow} and {fast}", pair=pair, slow=texts[0],
                   fast=texts[1])  # fmt: skip


def _other_forms(choice: StructureChoice) -> tuple[Note, ...]:
    """What is said where other forms are as probable as the chosen one."""
    rivals = tuple(
        f"'{t.structure.name}' {100.0 * share:.0f} %" for t, share in choice.probable if t is not choice.chosen
    )
    if not rivals:
        return ()
    return (Note("intervals hold the choice of the form; also probable are {forms}", forms=rivals),)


def _structure(model: Model) -> Structure | None:
    """The structure that was chosen when the model was identified."""
    name = model.origin.get("structure")
    return next((s for s in model.definition.structures if s.name == name), None)


def _is_free(model: Model, parameter: Parameter) -> bool:
    structure = _structure(model)
    return not parameter.fixed if structure is None else parameter.name in structure.free


def _kept(model: Model) -> dict[str, str]:
    structure = _structure(model)
    return {"structure": structure.name} if structure else {}


def _best_reading(
    model: Model, names: Sequence[str], experiments: Sequence[Experiment], tick: Tick
) -> tuple[Estimate, _Fitting]:
    """Fit with both conventions of when a sample is read, unless the recordings declare it; keep the better."""
    best: tuple[Estimate, _Fitting] | None = None
    declared = {e.drive.read_at for e in experiments if e.reading_known}
    for read_at in sorted(declared) or (0.0, 1.0):
        fitting = _Fitting(model, [e.reading_at(read_at) for e in experiments], tick)
        near = moved(model, all_values(model) if best is None else _merged(model, best[0]))
        found = fitting.fit([unknown_of(near, name) for name in names])
        if best is None:
            found = fitting.restarted(found)
        # Where a dead time can stand in for it, the data do not tell the reading instant: keep the plain one. Nor does
        # what a model of another structure leaves: there a difference counts in units of that.
        excess = 1.0 if best is None else max(1.0, best[0].mean_square)
        if best is None or found.chi2 < best[0].chi2 - CRITERIA.decisive * excess:
            best = found, fitting
    assert best is not None  # noqa: S101
    return best


def _merged(model: Model, found: Estimate) -> dict[str, float]:
    return all_values(model) | found.named


@dataclass(frozen=True, slots=True)
class _Fitting:
    """Fits of a model's parameters to experiments, each with the others held as the model has them.

    `tick` is called before each simulation.
    """

    model: Model
    experiments: Sequence[Experiment]
    tick: Tick

    def fit(self, start: Sequence[Unknown]) -> Estimate:
        """From these values."""
        return estimate(self._residuals(start), start, careful=True)

    def at(self, values: Parameters, names: Sequence[str]) -> Estimate:
        """From other values of the model, at which those that are not named are held."""
        near = replace(self, model=moved(self.model, values))
        return near.fit([unknown_of(near.model, name) for name in names])

    def restarted(self, first: Estimate) -> Estimate:
        """Try other starts while the fit stays far above the noise; a poor start must not pass for physics."""
        best = first
        for factor in EFFORT.restarts:
            if best.mean_square < CRITERIA.misfit:
                break
            start = [
                replace(u, start=float(np.clip(u.start * factor, u.low, u.high))) if u.unit in ("s", "rad/s") else u
                for u in first.unknowns
            ]
            best = min(best, self.fit(start), key=lambda found: found.chi2)
        if not explains_little([e.weight * e.valid_output for e in self.experiments], [best.residuals]):
            return best
        starts = multistart(self._residuals(first.unknowns), first.unknowns)
        return min([best, *map(self.fit, starts)], key=lambda found: found.chi2)

    def _residuals(self, unknowns: Sequence[Unknown]) -> Callable[[Array], Array]:
        """Weighted residuals over the values of the unknowns."""
        names = [u.name for u in unknowns]
        base, active = self.model.values, self.model.active_effects
        of_plant = Residuals(self.model.definition, self.experiments, base, active)

        def residuals(values: Array) -> Array:
            self.tick()
            tried = dict(zip(names, values.tolist(), strict=True))
            parameters = base | {name: value for name, value in tried.items() if "." not in name}
            return of_plant.at(parameters, effects_at(active, tried))

        return residuals


def _noise(
    model: Model, experiments: Sequence[Experiment], errors: Sequence[Array], simulated: Sequence[Array]
) -> Measured:
    """The noise of the output from what the model leaves, a tone that runs through everything apart."""
    floor = rms(np.array([channel_floor(e.valid_output) for e in experiments]))

    def measured(outputs: Sequence[Array], errors: Sequence[Array]) -> Measured:
        outputs_there = [values[e.valid] for e, values in zip(experiments, outputs, strict=True)]
        seen = witnesses(model, experiments, outputs, simulated, floor)
        return measured_noise(outputs_there, seen, errors, experiments[0].interval_s)

    outputs = [e.output for e in experiments]
    is_noise = rms(np.array([rms(error) for error in errors])) < CRITERIA.hum_misfit * floor
    hum_hz = common_line(experiments, errors) if is_noise else None  # a misfit has lines that are no hum
    if hum_hz is None:
        return measured(outputs, errors)
    found = [line_at(e.time_s, error, hum_hz) for e, error in zip(experiments, errors, strict=True)]
    without = [[values - tone for values, (tone, _) in zip(rows, found, strict=True)] for rows in (outputs, errors)]
    own, hum = measured(without[0], without[1]), float(np.median([amplitude for _, amplitude in found]))
    return replace(own, noise=replace(own.noise, hum_hz=hum_hz, hum=hum))


def _with_noise_where_invalid(errors: Array, valid: Mask) -> Array:
    """Errors with white noise of their own size where the output says nothing: zeros would make it look less noisy."""
    if valid.all():
        return errors
    noise = np.random.default_rng(len(errors)).standard_normal(len(errors))
    return np.where(valid, errors, float(np.std(errors[valid])) * noise)


def _covariance(found: Estimate) -> Covariance:
    """The covariance for the model file; a direction that is not identifiable is as uncertain as bounds let it be.

    It is that of repeats: what the model lacks is lacking in them too, and cancels where units are compared.
    """
    return Covariance(tuple(found.named), tuple(map(tuple, found.identifiability.whole.tolist())))


def _unidentifiable(found: Estimate, named: Set[str], slow_hz: float) -> list[Note]:
    """Notes on parameters that are not identifiable or confounded, but for those that are `named` already.

    `slow_hz` as in `_undetermined`.
    """
    shared = [
        u.name
        for u, is_shared in zip(found.unknowns, found.identifiability.is_shared_beyond_noise, strict=True)
        if is_shared and u.name not in named
    ]
    if len(shared) == 1:
        alone = Note("not identifiable: {name}; drive more levels, some of them near where it acts",
                     name=shared[0])  # fmt: skip
        return [alone]
    if slow_hz:
        together = Note("confounded: {names}; samples at {rate_hz:g} Hz or faster may separate them",
                        names=tuple(shared), rate_hz=slow_hz)  # fmt: skip
    else:
        together = Note("confounded: {names}; levels between those driven may separate them",
                        names=tuple(shared))  # fmt: skip
    return [together] if shared else []


def _wider_than_themselves(plant: Plant, values: Parameters, stds: Mapping[str, float]) -> tuple[str, ...]:
    """Parameters whose interval reaches farther to either side than they, and as they usually are, lie from nothing."""
    return tuple(
        p.name
        for p in plant.parameters
        if p.name in stds
        and np.isfinite(stds[p.name])
        and COVERED * stds[p.name] >= max(abs(values[p.name]), abs(p.scale))
    )


def _std_of_noise(found: Estimate) -> Array:
    """Standard uncertainties that the noise alone would leave, had the model left nothing else; shape (k,)."""
    return found.std / math.sqrt(max(found.identifiability.variance, 1.0))


def _undetermined(by_test: Mapping[str, str], by_model: Sequence[str], slow_hz: float) -> list[Note]:
    """Which parameters are not identifiable, and whether the test or the model is to blame.

    Args:
        by_test: units of the parameters that the test does not determine, by name.
        by_model: those that what the model lacks may have moved.
        slow_hz: the rate that would show the dynamics, where samples lie too far apart; else 0.
    """
    notes = [
        Note(
            "parameter '{name}' is not identifiable: its interval would be wider than the value. The samples lie too "
            "far apart for it: record at {rate_hz:g} Hz or faster",
            name=name, rate_hz=slow_hz,
        )
        if slow_hz and unit in _OF_DYNAMICS
        else Note(
            "parameter '{name}' is not identifiable: its interval would be wider than the value. Drive more levels and "
            "faster changes, or record a signal nearer to where it acts",
            name=name,
        )
        for name, unit in by_test.items()
    ]  # fmt: skip
    if by_model:
        notes.append(Note(
            "not identifiable: {names}; what the model lacks may have moved them by more than they are. A better model "
            "would determine them, another test would not",
            names=tuple(by_model),
        ))  # fmt: skip
    return notes


def _result(
    model: Model, plant: Plant, found: Estimate, experiments: Sequence[Experiment], remarks: tuple[Note, ...],
    beside: Systematic,
) -> GreyBoxFit:  # fmt: skip
    names = list(found.named)
    stds = dict(zip(names, np.sqrt(found.std**2 + np.diag(beside.model)).tolist(), strict=True))
    by_calibration = {} if beside.calibration is None else dict(zip(names, beside.calibration.tolist(), strict=True))
    values = _merged(model, found)
    if "dead_time" in stds and responds_within_sample(values):
        stds["dead_time"] = float(np.hypot(stds["dead_time"], dead_time_std_s(experiments)))
    wide = _wider_than_themselves(plant, values, stds)
    stds |= dict.fromkeys(wide, np.inf)
    units = plant.units(experiments[0].input, experiments[0].output_heading)
    parameters = {
        p.name: Value(values[p.name], units[p.name], stds.get(p.name), by_calibration.get(p.name))
        for p in plant.parameters
    }
    effects, active = moved(model, values, stds).effects, effects_at(model.active_effects, values)
    plain = {p.name: values[p.name] for p in plant.parameters}
    fits, errors, answers = {}, [], []
    for e in experiments:
        simulated = e.respond(plant, plain, active)[0]
        answers.append(simulated)
        fits[e.name] = fit_percent(e.output[e.valid], simulated[e.valid])
        floor = channel_floor(e.valid_output)
        slope = start_slope(e, plant, plain, active, floor, plain=simulated)
        error = floor * with_free_start(e.telling((e.output - simulated) / floor), slope)
        errors.append(_with_noise_where_invalid(error, e.valid))
    made = Model(
        model.plant, parameters, effects, experiments[0].input, experiments[0].output_heading,
        experiments[0].drive.read_at,
        None,
        _covariance(found),
        {
            "recordings": [e.name for e in experiments], "fit_percent": fits,
            "intervals_s": sample_intervals_s(experiments), "longest_s": max(e.duration_s for e in experiments),
            "std": {name: std if np.isfinite(std) else None for name, std in stds.items() if name in parameters},
            "resolution": float(np.median([resolution(e.output) for e in experiments])), **_kept(model),
        },
    )  # fmt: skip
    measured = _noise(made, experiments, errors, answers)
    beyond = discrepancy_of(made, experiments, [-error for error in errors], measured)
    made = replace(made, noise=measured.noise, origin={**made.origin, **({"discrepancy": beyond} if beyond else {})})
    driven_out = [found.unknowns[k].name for k in found.fixed_at_bound]
    natural = [u.name for u, v in zip(found.unknowns, found.values.tolist(), strict=True) if u.at_natural_end(v)]
    # a value that is not identifiable may lie anywhere: where it ended is no second thing to be said of it
    ended = [name for name in found.on_bound if name not in natural and np.isfinite(stds[name])]
    notes = [Note("parameter '{name}' ended on a bound: a warning, not physics", name=name) for name in ended]
    notes += [
        Note(
            "parameter '{name}' is not identifiable: the fit would have gone beyond its bound. Drive more levels, some "
            "near where it acts",
            name=name,
        )
        for name in driven_out
        if np.isinf(stds[name])
    ]
    by_noise = _wider_than_themselves(plant, values, dict(zip(names, _std_of_noise(found).tolist(), strict=True)))
    slow_hz = too_slow_hz(made, experiments)
    by_test = {name: units[name] for name in wide if name in by_noise and name not in driven_out}
    by_model = [name for name in wide if name not in by_noise and name not in driven_out]
    notes += _undetermined(by_test, by_model, slow_hz)
    together = _unidentifiable(found, {*driven_out, *by_model}, slow_hz)
    notes += [*([note_of(beyond)] if beyond else []), *together, *beside.notes]
    return GreyBoxFit(made, found.on_bound, fits, (*remarks, *notes, *doubts(made, experiments, fits)))
