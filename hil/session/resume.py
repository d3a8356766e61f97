"""Resuming: a run that was broken off goes on where it stopped, in a new folder that begins with its samples."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.bench.read import BenchFile
from hil.errors import FileError, SettingError
from hil.record.folder import read
from hil.record.recording import Recording
from hil.record.run_folder.header import read_header, stated
from hil.session.labels import Labels
from hil.session.procedure import Procedure


def broken_off(folder: Path, procedure: Procedure, bench: BenchFile) -> Recording:
    """A run that this procedure can resume on this bench.

    Raises:
        FileError: not a run folder, or nothing of it can be resumed.
        SettingError: another procedure, another bench, or a procedure that cannot be resumed.
    """
    if not procedure.resumable:
        raise SettingError(f"procedure '{procedure.name}' cannot be resumed; run it again")
    earlier = read(folder)
    meta = earlier.meta
    if meta.get("procedure") != procedure.name:
        raise SettingError(f"{folder}: a run of '{meta.get('procedure')}', not of '{procedure.name}'")
    if meta.get("bench_file") != bench.text:
        raise SettingError(
            f"{folder}: recorded with another bench file than {bench.path}; its copy stands in run.json, bench_file"
        )
    if meta.get("outcome") == "completed":
        raise FileError(f"{folder}: this run was completed; there is nothing to resume")
    return earlier


@dataclass(frozen=True, slots=True)
class BrokenOff:
    """What a run that is to be resumed says of itself: procedure, bench file, labels."""

    procedure: str
    bench: str
    labels: Labels


def broken_off_command(folder: Path) -> BrokenOff:
    """What is needed to resume a run, from its header.

    Raises:
        FileError: not a run folder, or one that names no procedure.
    """
    meta = read_header(folder).meta
    if not meta.get("procedure"):
        raise FileError(f"{folder}: names no procedure; a run of `hil run` was expected")
    labels = Labels(stated(meta, "valve", "serial"), stated(meta, "operator"), dict(meta.get("notes") or {}))
    return BrokenOff(str(meta["procedure"]), stated(meta, "bench_path"), labels)


def settings_of(earlier: Recording) -> dict[str, Any]:
    """The settings with which a run began."""
    return dict(earlier.meta["settings"])
