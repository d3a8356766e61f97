"""Models from recordings, and recordings against models. What a calculation needs is imported when it is called."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from hil.api.callbacks import Notes, unsaid
from hil.api.models import model_of
from hil.errors import options_of
from hil.record.run_folder.progress import Progress, quiet
from hil.session.several import at_least_one, several

if TYPE_CHECKING:
    from hil.diagnosis.diagnose import Diagnosed
    from hil.identification.frequency.table_fit import TableComparison
    from hil.identification.grey_box.compare import Comparison
    from hil.identification.papers.linearise import Linearised
    from hil.identification.papers.step_models import StepModels
    from hil.physics.model import Model
    from hil.record.reading import Reading
    from hil.record.recording import Recording
    from hil.session.class_analysis import ClassAnalysis
    from hil.session.flow_analysis import FlowAnalysis
    from hil.session.identification import Identified
    from hil.session.sine_analysis import SineAnalysis
    from hil.session.sources import Source


@options_of("python")
def identify(
    recordings: Source | Iterable[Source],
    plant: str | Path,
    *,
    free: str | Iterable[str] = (),
    inputs: str | Iterable[str] = (),
    output: str = "",
    poles: int | None = None,
    zeros: int | None = None,
    dead_time: bool | None = None,
    weights: str = "",
    reading: Reading | None = None,
    part: str = "",
    page: str | Path = "",
    notes: Notes = unsaid,
    progress: Progress = quiet,
) -> Identified:
    """Fit a plant's parameters to recordings together (`hil identify`).

    Args:
        recordings: one or several: samples in time, or tables of a frequency response, or their paths; also a pandas
            DataFrame, or arrays by their headings, `{"time [s]": t, "command [%]": u, "flow [l/min]": y}`. Of a run
            that measured frequency responses, given by its path, the plant `transfer-function` is fitted to those.
        plant: name of a plant, or the path of a model file to start from.
        free: parameters that are held fixed otherwise.
        inputs: names of the input channels, where they are not the plant's own.
        output: name of the output channel, likewise.
        poles: of a transfer function; by evidence where not given. In samples in time an integrator is one too.
        zeros: likewise.
        dead_time: whether it has one; likewise.
        weights: of its lines, "relative" (of their size), "uniform" (all alike) or "covariance".
        reading: how paths are read.
        part: of a run that measured several frequency responses, this one.
        page: file for a page with the model beside what it was fitted to; none where not given.
        notes: called with what was assumed of the recordings.
        progress: called with how far it is, where that takes long.

    Returns:
        `model`, the fit in words as `text`, and the `experiments` that were fitted.
    """
    from hil.identification.frequency.table_fit import orders_of
    from hil.session.identification import identified, read_for
    from hil.session.sources import notes_on

    read = read_for(str(plant), at_least_one(recordings), reading, part, several(inputs), output)
    for note in notes_on(read):
        notes(note)
    orders = orders_of(poles, zeros, dead_time, weights)
    found = identified(str(plant), read, several(free), several(inputs), output, orders, notes, progress)
    if page:
        found.write_page(Path(page))
    return found


@options_of("python")
def compare(
    model: Model | str | Path,
    recordings: Source | Iterable[Source],
    *,
    inputs: str | Iterable[str] = (),
    output: str = "",
    reading: Reading | None = None,
    page: str | Path = "",
    notes: Notes = unsaid,
    progress: Progress = quiet,
) -> list[Comparison | TableComparison]:
    """How well a model fits each recording or frequency response, and where it fails (`hil compare`).

    Args:
        model: or the path of its file.
        recordings: or their paths.
        inputs: names of the input channels, where they are not the model's own.
        output: name of the output channel, likewise.
        reading: how paths are read.
        page: file for a page with the model beside the measurements; none where not given.
        notes: called with what was assumed of the recordings.
        progress: called with how far it is, where that takes long.
    """
    from hil.session.comparison import compared_with

    drawn = Path(page) if page else None
    return compared_with(
        model_of(model), at_least_one(recordings), several(inputs), output, reading, notes, drawn, progress
    )


@options_of("python")
def simulate(
    model: Model | str | Path,
    recording: Source,
    *,
    inputs: str | Iterable[str] = (),
    output: str = "",
    reading: Reading | None = None,
    notes: Notes = unsaid,
) -> Recording:
    """The model's output on a recording's input, at the same stamps (`hil simulate`).

    Of the recording's output only the first sample is used, to set the initial state. Where the rest of it looks as if
    a sign, a unit or a column were mistaken, a note says so.

    Args:
        model: or the path of its file.
        recording: or its path.
        inputs: names of the input channels, where they are not the model's own.
        output: name of the output channel, likewise.
        reading: how a path is read.
        notes: called with what was assumed of the recording.
    """
    from hil.identification.preparation.experiment import for_model
    from hil.identification.preparation.plausibility.look import implausible_metadata
    from hil.record.recording import recording as make
    from hil.session.sources import notes_on, samples_of

    simulated, read = model_of(model), samples_of(recording, reading)
    bound = for_model(simulated, read, several(inputs), output, output_needed=False)
    for note in (*notes_on([read], [bound]), *implausible_metadata(simulated, bound)):
        notes(note)
    response = bound.simulated(simulated)[0]
    return make(f"{read.name}, simulated", bound.time_s, {simulated.output: response})


@options_of("python")
def diagnose(
    model: Model | str | Path,
    recordings: Source | Iterable[Source],
    *,
    inputs: str | Iterable[str] = (),
    output: str = "",
    out: str | Path | None = None,
    bench: str | Path = "",
    bench_budget_s: float = 60.0,
    budget_s: float = math.inf,
    question: str = "",
    before: Source | Iterable[Source] = (),
    reading: Reading | None = None,
    notes: Notes = unsaid,
    progress: Progress = quiet,
) -> Diagnosed:
    """Locate a mismatch, name the physics that was left out, and correct the model (`hil diagnose`).

    Args:
        model: the nominal model, or the path of its file.
        recordings: of the unit, or their paths.
        inputs: names of the input channels, where they are not the model's own.
        output: name of the output channel, likewise.
        out: folder for diagnosis.json, corrected.json and report.html; nothing is written when not given.
        bench: run the tests that are still needed on this bench, into `out`, and conclude.
        bench_budget_s: bench time that those tests may take.
        budget_s: after so many times 10 million simulated samples no further search is begun; a warning says so.
        question: "changed" since identification or "left_out" of the model, where not the one that the recordings ask.
        before: recordings of the same unit at the date of identification, or their paths.
        reading: how paths are read.
        notes: called with what was assumed of the recordings.
        progress: called with how far it is.

    Returns:
        `diagnosis` and the `corrected` model.
    """
    from hil.report.origins import origin_at, origin_of
    from hil.session.diagnosis import bound_to, diagnosed
    from hil.session.sources import all_samples, notes_on

    nominal, read = model_of(model), all_samples(at_least_one(recordings), reading)
    experiments, left_out = bound_to(nominal, read, several(inputs), output, budget_s)
    for note in (*notes_on(read, experiments), *left_out):
        notes(note)
    origins = [*([origin_at(model)] if isinstance(model, str | Path) else []), *map(origin_of, read)]
    folder = None if out is None else Path(out)
    earlier = all_samples(before, reading)
    then = bound_to(nominal, earlier, several(inputs), output, budget_s)[0] if earlier else []
    return diagnosed(
        nominal, experiments, folder, str(bench), bench_budget_s, progress, budget_s, origins, question, then
    )


@options_of("python")
def linearise(
    model: Model | str | Path,
    at: float,
    *,
    step: float | None = None,
    window_s: float = 1.0,
    poles: int | None = None,
    zeros: int | None = None,
    load_pressure_bar: float = 0.0,
) -> Linearised:
    """A plant about an operating point as a transfer function, with K_q and K_c where it has them (`hil linearise`).

    Args:
        model: with its effects, or the path of its file.
        at: the command, in the plant's unit.
        step: of the command; 1 % of full scale when not given.
        window_s: time in which the answer settles.
        poles: beside an integrator; by evidence where not given.
        zeros: likewise.
        load_pressure_bar: P_L, at which K_q and K_c are taken.
    """
    from hil.identification.papers.linearise import linearised

    return linearised(
        model_of(model), at, step=step, window_s=window_s, poles=poles, zeros=zeros, load_pressure_bar=load_pressure_bar
    )


@options_of("python")
def step_models(
    recording: Source | None = None,
    *,
    rise_s: float | None = None,
    settling_s: float | None = None,
    input: str = "",
    output: str = "",
    beside: Source | None = None,
    band: float = 0.02,
    reading: Reading | None = None,
) -> list[StepModels]:
    """Two first-order models and a second-order one for every step of a recording (`hil analyse step`).

    Args:
        recording: with steps of the command; not given, the two times are taken.
        rise_s: instead of a recording: from 10 to 90 % of the change.
        settling_s: likewise: until within `band`.
        input: name of the command, where the recording does not say it.
        output: name of the response, likewise.
        beside: measured frequency response to hold the models against.
        band: share of the change within which a response counts as settled.
        reading: how a path is read.

    Raises:
        SettingError: neither a recording nor both times.
    """
    from hil.session.analyses import models_of_steps, models_of_times
    from hil.session.sources import samples_of, tables_of

    table = None if beside is None else tables_of([beside])[0]
    if recording is None:
        return [models_of_times(rise_s, settling_s, table, band)]
    return models_of_steps(samples_of(recording, reading), input, output, table, band)


@options_of("python")
def frequency_response(
    recordings: Source | Iterable[Source], *, input: str = "", output: str = "", reading: Reading | None = None
) -> SineAnalysis:
    """Magnitude and phase of the sines that recordings hold, with uncertainty (`hil analyse sines`).

    Args:
        recordings: one of stepped sines, or one for each frequency.
        input: name of the command, where the recording does not say it.
        output: name of the response, likewise.
        reading: how a path is read.

    Returns:
        `responses`, one for each amplitude and bias, with `bandwidths`, and as `tables` that `identify` takes.

    Raises:
        InputError: no sine in one of them.
    """
    from hil.session.sine_analysis import sine_analysis
    from hil.session.sources import all_samples

    return sine_analysis(all_samples(at_least_one(recordings), reading), input, output)


@options_of("python")
def flow_curve(
    recordings: Source | Iterable[Source],
    *,
    input: str = "",
    output: str = "",
    degree: int = 9,
    neutral: float = 0.0,
    reading: Reading | None = None,
) -> FlowAnalysis:
    """Response over command of slow sweeps: dead band, hysteresis, gains, polynomial, spline (`hil analyse flow`).

    Args:
        recordings: one or several of one valve; sweeps at two speeds tell lag from hysteresis.
        input: name of the command, where the recording does not say it.
        output: name of the response, likewise.
        degree: of the polynomial.
        neutral: command from which both sides go.
        reading: how a path is read.

    Returns:
        `figures`, the branches, `polynomial` and `spline` at levels of the command; `write` makes a CSV of them.

    Raises:
        InputError: no sweep up and down, or no response beyond the noise.
    """
    from hil.session.flow_analysis import flow_analysis
    from hil.session.sources import all_samples

    return flow_analysis(all_samples(at_least_one(recordings), reading), input, output, degree, neutral)


@options_of("python")
def learn_classes(
    good: Source | Iterable[Source],
    bad: Iterable[Source] = (),
    others: Iterable[Source] = (),
    *,
    output: str = "",
    names: tuple[str, str] = ("good", "bad"),
    reading: Reading | None = None,
) -> ClassAnalysis:
    """Classes learnt from good and bad valves, and how often they err (`hil analyse classes`).

    Args:
        good: a recording of one test for each good valve; or the path of a CSV with a row for each valve.
        bad: likewise of each bad valve; not with a CSV.
        others: valves whose class is asked.
        output: channel that is compared, where the recordings do not say it.
        names: of the classes.
        reading: how paths are read.

    Raises:
        InputError: fewer than five valves of a class.
    """
    from hil.session.analyses import channels_of
    from hil.session.class_analysis import classes_of_recordings, classes_of_table
    from hil.session.sources import all_samples

    if isinstance(good, str | Path):
        return classes_of_table(Path(good))
    read = [all_samples(group, reading) for group in (good, bad, others)]
    compared = output or channels_of(read[0][0])[1] if read[0] else output
    return classes_of_recordings((names[0], read[0]), (names[1], read[1]), compared, read[2])


@options_of("python")
def compose(curve: str | Path, dynamics: Model | str | Path) -> Model:
    """A measured flow curve and a transfer function as one model (`hil analyse compose`).

    Args:
        curve: run of `flow_curve`, or CSV with command and flow.
        dynamics: a model of the plant `transfer-function`, whose gain at rest is left out; or of `cummins-efc` or
            `brevini-hpv41`, whose orifice the curve replaces.
    """
    from hil.session.analyses import composed

    return composed(Path(curve), model_of(dynamics))
