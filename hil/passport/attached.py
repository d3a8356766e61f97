"""What a passport carries beside its pages: names, purposes, and where they lie while it is made."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from hil.errors import FileError, StorageError
from hil.findings.results import read_results, write_results
from hil.passport.unit import Unit, UnitRun
from hil.record.folder import write
from hil.record.measurement import RESULTS_FILE
from hil.record.recording import Recording
from hil.record.run_folder.header import sha256_of
from hil.record.run_folder.seal import seal_folder
from hil.session.outcome import REPORT_FILE
from hil.session.results import write_evaluation

Relation = Literal["source", "data", "supplement"]
RUNS = "runs"
MODEL_FILE, TYPE_MODEL_FILE, DIAGNOSIS_FILE = "model.json", "type-model.json", "diagnosis.json"
DCC_FILE, POWER_FILE = "certificate.xml", "power.json"
CONTENT_FILE = "passport.json"
_TYPES = {".json": "application/json", ".jsonl": "application/x-ndjson", ".csv": "text/csv", ".html": "text/html",
          ".xml": "application/xml", ".toml": "application/toml"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Attached:
    """A file inside the passport. `relation` is its AFRelationship."""

    name: str
    path: Path
    relation: Relation
    about: str

    @property
    def media_type(self) -> str:
        """As PDF/A asks for it."""
        return _TYPES.get(self.path.suffix, "application/octet-stream")

    def as_dict(self) -> dict[str, Any]:
        """For the page: with size and checksum."""
        return {
            "name": self.name, "relation": self.relation, "about": self.about, "type": self.media_type,
            "bytes": self.path.stat().st_size, "sha256": sha256_of(self.path),
        }  # fmt: skip


def attached_runs(unit: Unit) -> list[Attached]:
    """Every file of every run folder, under `runs/NAME/`."""
    return [one for name, run in _named(unit) for one in _files(run, name)]


def without_names(unit: Unit, place: Path) -> Unit:
    """The same runs without their operator, written into new folders that are sealed anew; reports are left out."""
    return replace(unit, runs=tuple(_without_name(run, place / name) for name, run in _named(unit)))


def evaluated_copies(unit: Unit, place: Path) -> Unit:
    """The same runs; of those of which an evaluation now finds something else a copy, with that in it and sealed."""
    return replace(unit, runs=tuple(_evaluated_copy(run, place / name) for name, run in _named(unit)))


def _evaluated_copy(run: UnitRun, folder: Path) -> UnitRun:
    if not run.moved:
        return run
    try:
        shutil.copytree(run.folder, folder, symlinks=True)
    except OSError as error:
        raise StorageError(f"{run.folder}: cannot be copied, to be evaluated anew: {error}") from error
    kept = run.findings  # looked up in the archive, or found with time: as true as it was
    write_evaluation(run.recording, replace(run.findings_anew, since=kept.since, cause=kept.cause), folder)
    return replace(run, folder=folder, results=read_results(folder / RESULTS_FILE))


def _without_name(run: UnitRun, folder: Path) -> UnitRun:
    meta: Mapping[str, Any] = {key: value for key, value in run.recording.meta.items() if key != "operator"}
    recording = Recording(str(folder), run.recording.time_s, run.recording.channels, meta)
    results = run.results.model_copy(update={"operator": None})
    folder.parent.mkdir(parents=True, exist_ok=True)
    write(recording, folder)
    write_results(results, folder)
    seal_folder(folder, run.limits)
    return replace(run, folder=folder, recording=recording, results=results)


def _named(unit: Unit) -> Iterator[tuple[str, UnitRun]]:
    """Runs under the names of their folders, numbered where two have the same."""
    taken: set[str] = set()
    for run in unit.runs:
        name = stem = run.folder.resolve().name
        count = 1
        while name in taken:
            count += 1
            name = f"{stem}-{count}"
        taken.add(name)
        yield name, run


def _files(run: UnitRun, name: str) -> Iterator[Attached]:
    for path in sorted(run.folder.rglob("*")):
        if path.is_symlink():
            raise FileError(f"{path}: is a link; a passport holds files of the run folder only")
        if path.is_file() and path.suffix != ".part":
            inside = path.relative_to(run.folder).as_posix()
            yield Attached(f"{RUNS}/{name}/{inside}", path, "source", _about(inside))


def _about(inside: str) -> str:
    known = {REPORT_FILE: "report of the run", "results.json": "what the run found", "samples.f8": "the samples"}
    return known.get(inside, "file of the run folder")
