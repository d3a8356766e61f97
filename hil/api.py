"""The public interface for Python: what the commands do, as functions on values.

    import hil

    recording = hil.read("response.csv", units={"flow": "l/min"})
    found = hil.identify([recording], "brevini-hpv41")
    later = hil.read("later.csv")
    for comparison in hil.compare(found.model, [later]):
        print(comparison.as_text())
    told = hil.diagnose(found.model, [later])
    print(told.diagnosis.as_text())
    hil.simulate(told.corrected, later).plot()

Errors are `hil.errors.HilError`, one sentence each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from hil.findings.results import Results
from hil.physics.model import Model, load_model, save_model, typical_model
from hil.record.reading import Reading
from hil.record.recording import Recording

if TYPE_CHECKING:
    from hil.archive.entry import Entry
    from hil.bench.rig import BenchRig
    from hil.diagnosis.diagnose import Diagnosed
    from hil.identification.compare import Comparison
    from hil.identification.linearise import Linearised
    from hil.identification.step_models import StepModels
    from hil.record.response_table import ResponseTable
    from hil.session.identification import Identified
    from hil.session.outcome import Outcome

Progress = Callable[[float, str], None]
_NOTHING: Mapping[str, Any] = MappingProxyType({})

__all__ = [
    "Model", "Recording", "Results", "average", "compare", "compose", "diagnose", "find_runs", "identify",
    "linearise", "load_model", "open_bench", "read", "results", "run", "save_model", "simulate", "step_models",
    "typical_model", "write",
]  # fmt: skip


def _quiet(_done: float, _text: str) -> None:
    """Say nothing of how far it is."""


def read(
    path: str | Path,
    *,
    time: str = "",
    interval_s: float = 0.0,
    units: Mapping[str, str] = _NOTHING,
    renamed: Mapping[str, str] = _NOTHING,
    columns: Sequence[str] = (),
    gaps: bool = False,
) -> Recording | ResponseTable:
    """A recording, a run folder, or a table of a frequency response; `hil convert` and all that read do the same.

    Args:
        path: file or run folder.
        time: name of the column that holds the time.
        interval_s: the samples lie so far apart, whatever the file says.
        units: of channels by name, whatever the file says.
        renamed: new names of channels by their old ones.
        columns: names of the columns in their order, for files without headings; `-` leaves one out.
        gaps: whether an empty field, or a line that is cut off, is a sample that was not taken.

    Raises:
        FileError: it cannot be read as a recording; names line, column and the option that helps.
    """
    from hil.record.read import read_any

    return read_any(Path(path), Reading(time, interval_s, dict(units), dict(renamed), tuple(columns), gaps))


def write(recording: Recording, path: str | Path) -> None:
    """Write a recording; the ending of the name says the format, none makes a run folder.

    Raises:
        FileError: an ending that is not known, or a run folder that exists.
    """
    from hil.record.read import write_recording

    write_recording(recording, Path(path))


def identify(
    recordings: Sequence[Recording] | Sequence[ResponseTable],
    plant: str,
    *,
    free: Sequence[str] = (),
    inputs: Sequence[str] = (),
    output: str = "",
    poles: int | None = None,
    zeros: int | None = None,
    dead_time: bool | None = None,
    weights: str = "",
) -> Identified:
    """Fit a plant's parameters to recordings together (`hil identify`).

    Args:
        recordings: samples in time, or tables of a frequency response.
        plant: name of a plant, or the path of a model file to start from.
        free: parameters that are held fixed otherwise.
        inputs: names of the input channels, where they are not the plant's own.
        output: name of the output channel, likewise.
        poles: of the transfer function of a frequency response; by evidence where not given.
        zeros: likewise.
        dead_time: whether it has one; likewise.
        weights: of its lines, "relative" (of their size), "uniform" (all alike) or "covariance".

    Returns:
        `model`, the fit in words as `text`, and the `experiments` that were fitted.
    """
    from hil.identification.table_fit import orders_of
    from hil.session.identification import identified

    return identified(plant, recordings, free, inputs, output, orders_of(poles, zeros, dead_time, weights))


def average(responses: Sequence[ResponseTable], *, normalised: bool = False) -> ResponseTable:
    """The mean of frequency responses on the same frequencies: mean dB and mean phase (`hil average`).

    Args:
        responses: tables, as `read` gives them.
        normalised: take each over its gain at the lowest frequency first.
    """
    from hil.identification.table_fit import averaged

    return averaged(responses, normalised=normalised)


def step_models(
    recording: Recording, *, input: str = "", output: str = "", beside: ResponseTable | None = None, band: float = 0.02
) -> list[StepModels]:
    """Two first-order models and a second-order one for every step of a recording (`hil analyse step`).

    Args:
        recording: with steps of the command.
        input: name of the command, where the recording does not say it.
        output: name of the response, likewise.
        beside: measured frequency response to hold the models against.
        band: share of the change within which a response counts as settled.
    """
    from hil.session.analyses import channels_of, models_of_steps

    return models_of_steps(recording, *channels_of(recording, input, output), beside, band)


def compose(curve: str | Path, dynamics: Model) -> Model:
    """A measured flow curve and a transfer function as one model (`hil analyse compose`).

    Args:
        curve: run of `flow_curve`, or CSV with command and flow.
        dynamics: a model of the plant `transfer-function`; its gain at rest is left out.
    """
    from hil.identification.curve_model import curve_model
    from hil.session.analyses import flow_curve_of, linear_of

    found = flow_curve_of(Path(curve))
    return curve_model(found.command, found.flow, linear_of(dynamics, "dynamics"), found.input, found.output)


def linearise(model: Model, at: float, *, poles: int | None = None, zeros: int | None = None) -> Linearised:
    """A plant about an operating point as a transfer function, with K_q and K_c where it has them (`hil linearise`).

    Args:
        model: with its effects.
        at: the command, in the plant's unit.
        poles: beside an integrator; by evidence where not given.
        zeros: likewise.
    """
    from hil.identification.linearise import linearised

    return linearised(model, at, poles=poles, zeros=zeros)


def compare(
    model: Model, recordings: Iterable[Recording], *, inputs: Sequence[str] = (), output: str = ""
) -> list[Comparison]:
    """How well a model fits each recording, and where it fails (`hil compare`)."""
    from hil.identification.compare import compare as compared
    from hil.identification.experiment import for_model

    return [compared(model, for_model(model, one, inputs, output)) for one in recordings]


def simulate(model: Model, recording: Recording, *, inputs: Sequence[str] = (), output: str = "") -> Recording:
    """The model's output on a recording's input, at the same stamps (`hil simulate`).

    Of the recording's output only the first sample is used, to set the initial state.
    """
    from hil.identification.experiment import for_model
    from hil.record.recording import recording as make

    bound = for_model(model, recording, inputs, output, output_needed=False)
    simulated = bound.respond(model.definition, model.values, model.active_effects)[0]
    return make(f"{recording.name}, simulated", bound.time_s, {model.output: simulated})


def diagnose(
    model: Model,
    recordings: Iterable[Recording],
    *,
    inputs: Sequence[str] = (),
    output: str = "",
    out: str | Path | None = None,
    progress: Progress = _quiet,
) -> Diagnosed:
    """Locate a mismatch, name the physics that was left out, and correct the model (`hil diagnose`).

    Args:
        model: the nominal model.
        recordings: of the unit.
        inputs: names of the input channels, where they are not the model's own.
        output: name of the output channel, likewise.
        out: folder for diagnosis.json, corrected.json and report.html; nothing is written when not given.
        progress: told how far it is: the share done and what is going on.

    Returns:
        `diagnosis` and the `corrected` model.
    """
    from hil.diagnosis.diagnose import diagnose as diagnosed
    from hil.identification.experiment import for_model
    from hil.session.diagnosis import write_diagnosis

    found = diagnosed(model, [for_model(model, one, inputs, output) for one in recordings], progress)
    if out is not None:
        write_diagnosis(found, Path(out))
    return found


def run(
    procedure: str,
    bench: str | Path,
    out: str | Path,
    *,
    limits: Iterable[str] = (),
    progress: Progress = _quiet,
    **settings: Any,
) -> Outcome:
    """Run a procedure on a bench and evaluate it (`hil run`); outputs are safe before this returns.

    Args:
        procedure: its name.
        bench: bench file, or the name of an installed one.
        out: run folder to make.
        limits: `NAME=LOW..HIGH`, as on the command line.
        progress: told how far it is.
        settings: as values, or as text as on the command line.

    Returns:
        The `findings`, the `folder`, the path of the `report`.
    """
    from hil.bench.find import find_bench
    from hil.bench.read import read_bench
    from hil.session.limit import split_limits
    from hil.session.procedure import load_procedure
    from hil.session.run import run_procedure

    file = read_bench(find_bench(str(bench)))
    judged_by = split_limits(limits)
    return run_procedure(load_procedure(procedure), file, settings, Path(out), progress, limits=judged_by)


@contextmanager
def open_bench(bench: str | Path, out: str | Path, *, progress: Progress = _quiet) -> Iterator[BenchRig]:
    """A bench to drive by hand, through its guard and into a run folder; outputs are safe before and after.

    Args:
        bench: bench file, or the name of an installed one.
        out: run folder to make.
        progress: told how far it is, where the code inside says so.
    """
    from hil.bench.find import find_bench
    from hil.bench.open import open_rig
    from hil.bench.read import read_bench

    with open_rig(read_bench(find_bench(str(bench))), Path(out), {}, progress) as rig:
        yield rig


def results(run: str | Path) -> Results:
    """Every value, curve and transfer function of a run (`hil results`)."""
    from hil.session.results import results_of_run

    return results_of_run(Path(run))


def find_runs(
    *,
    serial: str = "",
    procedure: str = "",
    since: datetime | None = None,
    verdict: str = "",
    archive: str | Path = "",
) -> list[Entry]:
    """Runs of the archive with their values, the oldest first (`hil runs`).

    Args:
        serial: of one unit.
        procedure: of one procedure.
        since: from this time on.
        verdict: with this verdict.
        archive: folder or URL; else `HIL_ARCHIVE`, else `./runs`.
    """
    from hil.archive.archive import Search
    from hil.archive.archive import find_runs as found
    from hil.archive.place import archive_place

    return found(archive_place(str(archive)), Search(serial, procedure, since, verdict), values=True)
