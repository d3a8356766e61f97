"""Resuming: a run that was broken off goes on where it stopped, in a new folder that begins with its samples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hil.bench.read import BenchFile
from hil.errors import FileError, SettingError
from hil.record.folder import read
from hil.record.recording import Recording
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
    told = earlier.meta
    if told.get("procedure") != procedure.name:
        raise SettingError(f"{folder}: a run of '{told.get('procedure')}', not of '{procedure.name}'")
    if told.get("bench_file") != bench.text:
        raise SettingError(
            f"{folder}: recorded with another bench file than {bench.path}; its copy stands in run.json, bench_file"
        )
    if told.get("outcome") == "completed":
        raise FileError(f"{folder}: this run was completed; there is nothing to resume")
    return earlier


def settings_of(earlier: Recording) -> dict[str, Any]:
    """The settings with which a run began."""
    return dict(earlier.meta["settings"])
