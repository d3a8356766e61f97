"""A diagnosis with a bench at hand: run the tests that it asks for, and conclude; write down what came out."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hil.bench.find import find_bench
from hil.bench.protection import envelopes_of
from hil.bench.read import BenchFile, read_bench
from hil.diagnosis.answer.next_test import Span, span_within
from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.diagnosis.diagnosis import NextTest
from hil.diagnosis.skeleton.table import library_of
from hil.errors import SettingError, StorageError
from hil.identification.preparation.experiment import Experiment, for_model
from hil.identification.preparation.informative_segments import experiments_of
from hil.physics.model import Model, save_model
from hil.physics.other_plant import other_plants
from hil.record.durable import write_named
from hil.record.plain import plain
from hil.record.read import read_recording
from hil.record.recording import Recording, split_heading
from hil.record.run_folder.progress import Progress, quiet
from hil.record.simulated import is_simulated
from hil.report.diagnosis_page import write_diagnosis_report
from hil.report.origins import Origin, all_origins
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure

DIAGNOSIS_FILE, CORRECTED_FILE, REPORT_FILE = "diagnosis.json", "corrected.json", "report.html"

# Settling times that a test takes beside its command, until one has shown it: to its start, to neutral, and two ramps.
_WAYS = 4.0


def bound_to(
    model: Model,
    recordings: Sequence[Recording],
    inputs: Sequence[str],
    output: str,
    computing_s: float = math.inf,
) -> tuple[list[Experiment], tuple[str, ...]]:
    """Recordings bound to a model, in their most informative segments where they are too long; and notes.

    In words: first which of them is of another plant than the model.

    Too long are those that nobody diagnoses within the budget `computing_s`, where it has an end.
    """
    command = inputs[0] if inputs and inputs[0] else split_heading(model.input)[0]

    bound, warnings = experiments_of(
        model, recordings, lambda _: command, lambda one: for_model(model, one, inputs, output), computing_s
    )
    return bound, (*other_plants(model.plant, ((one.name, one.meta) for one in recordings)), *warnings)


def diagnosed(
    model: Model,
    experiments: Sequence[Experiment],
    out: Path | None,
    bench: str = "",
    budget_s: float = 0.0,
    progress: Progress = quiet,
    computing_s: float = math.inf,
    origins: Sequence[Origin] = (),
    question: str = "",
    before: Sequence[Experiment] = (),
) -> Diagnosed:
    """Diagnose, on a bench where one is named, and write down what came out where a folder is.

    Raises:
        SettingError: a bench without a folder for what is recorded there.
    """
    if bench and out is None:
        raise SettingError("tests on a bench leave run folders: name a folder for them, `out`")
    if bench and out is not None:
        found = conclude(
            model, experiments, read_bench(find_bench(bench)), budget_s, out, progress, computing_s, question
        )
    else:
        earlier = before or _kept_in_model(model, experiments)
        found = diagnose(model, experiments, progress, budget_s=computing_s, question=question, before=earlier)
    found = of_origins(_warned(found, origins), origins)
    if out is not None:
        write_diagnosis(found, out, origins)
    return found


def _warned(found: Diagnosed, origins: Sequence[Origin]) -> Diagnosed:
    """The diagnosis with a warning, before all others, of a model of another plant."""
    warnings = other_plants(found.diagnosis.plant, ((one.name, one.about) for one in origins))
    return replace(found, diagnosis=replace(found.diagnosis, warnings=(*warnings, *found.diagnosis.warnings)))


def of_origins(found: Diagnosed, origins: Sequence[Origin] = ()) -> Diagnosed:
    """The diagnosis that knows whether it rests on a simulated valve."""
    known = all_origins(origins, found.diagnosis.recordings)
    simulated = found.diagnosis.simulated or any(is_simulated(one.about) for one in known)
    return replace(found, diagnosis=replace(found.diagnosis, simulated=simulated))


def _kept_in_model(model: Model, experiments: Sequence[Experiment]) -> list[Experiment]:
    """The recordings of identification, where the library has changed since and all of them are still there."""
    kept, paths = model.skeleton, dict(model.origin.get("paths") or {})
    if kept is None or kept.get("library") == library_of(model) or not all(Path(p).exists() for p in paths.values()):
        return []
    names = experiments[0].input.rpartition(" [")[0], experiments[0].output_heading.rpartition(" [")[0]
    return bound_to(model, [read_recording(Path(p)) for p in paths.values()], names[:1], names[1])[0] if paths else []


def conclude(
    model: Model,
    experiments: Sequence[Experiment],
    bench: BenchFile,
    budget_s: float,
    out: Path,
    progress: Progress = quiet,
    computing_s: float = math.inf,
    question: str = "",
) -> Diagnosed:
    """Diagnose, run the next test on the bench, diagnose again, until nothing is left to separate or the time is spent.

    A test is not run twice.

    Args:
        model: the nominal model.
        experiments: recordings at hand.
        bench: where tests run, through the same guard as any procedure.
        budget_s: bench time that all tests together may take, the ways there and back included.
        out: run folders `test-1`, `test-2`, … are made in it.
        progress: called with how far it is.
        computing_s: budget of each diagnosis, after which no further search is begun.
        question: what is asked, where not what the recordings ask.

    Raises:
        HardwareError: the bench failed; outputs are safe, recordings made so far are kept.
        FileError: `out` holds tests of an earlier diagnosis.
    """
    known, left_s, span = list(experiments), budget_s, _span(bench)
    beside_s = _WAYS * bench.bench.valve.settling_s  # of a test: there, back, and settling
    done: list[tuple[str, Mapping[str, Any]]] = []
    while True:
        found = diagnose(model, known, progress, span, computing_s, question)
        asked = found.diagnosis.next_test
        if asked is None or asked.bench_s + beside_s > left_s or (asked.procedure, asked.settings) in done:
            return found
        done.append((asked.procedure, asked.settings))
        known.append(_tested(model, asked, bench, out / f"test-{len(done)}", progress))
        took_s = known[-1].duration_s
        left_s, beside_s = left_s - took_s, max(beside_s, took_s - asked.bench_s)


def _span(bench: BenchFile) -> Span | None:
    """How far the bench lets the command go."""
    command = bench.bench.roles["command"]
    limits = envelopes_of(bench.bench).get(command)
    return None if limits is None else span_within(limits.low, limits.high, bench.bench.channels[command].safe or 0.0)


def _tested(model: Model, asked: NextTest, bench: BenchFile, folder: Path, progress: Progress) -> Experiment:
    progress(0.0, f"{asked.procedure} on {bench.bench.name}")
    run_procedure(load_procedure(asked.procedure), bench, asked.settings, folder, progress)
    return for_model(model, read_recording(folder))


def write_diagnosis(found: Diagnosed, out: Path, origins: Sequence[Origin] = ()) -> Path:
    """Write `diagnosis.json`, `corrected.json` and `report.html`; returns the path of the report.

    Args:
        found: what is written.
        out: the folder.
        origins: of the model and the recordings, where they are known; those left out are looked for by their names.

    Raises:
        StorageError: something cannot be written.
    """
    found, whence = of_origins(found, origins), all_origins(origins, found.diagnosis.recordings)
    other = other_plants(found.diagnosis.plant, ((one.name, one.about) for one in whence))
    content = json.dumps(plain({**found.diagnosis.as_dict(), "other_plant": other}), indent=1, ensure_ascii=False)
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_named(out / DIAGNOSIS_FILE, content + "\n")
        save_model(found.corrected, out / CORRECTED_FILE)
    except OSError as error:
        raise StorageError(f"{out}: the diagnosis cannot be written: {error.strerror}") from error
    write_diagnosis_report(found.diagnosis, out / REPORT_FILE, whence)
    return out / REPORT_FILE
