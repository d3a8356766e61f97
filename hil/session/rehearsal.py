"""A rehearsal: the procedure on the simulated valve, before the real one moves."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.bench.open import open_rig
from hil.bench.read import BenchFile
from hil.bench.rehearsal import twin_of
from hil.errors import HardwareError, RangeError, RehearsalError, StorageError
from hil.language.note import Note
from hil.language.words import _, languages, marked, speaking
from hil.record.folder import read
from hil.record.recording import Recording
from hil.record.run_folder.progress import Progress, quiet
from hil.session.procedure import Procedure


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What a rehearsal that went through has shown.

    Attributes:
        bench_s: how long the procedure will need the bench.
        indications: what interlocks said that do not end a run.
    """

    bench_s: float
    indications: tuple[str, ...]

    @property
    def notes(self) -> list[Note]:
        """What it has shown, in words."""
        return [Note(_REHEARSED, time_s=self.bench_s), *(Note(_INDICATED, text=text) for text in self.indications)]


_REHEARSED = marked("rehearsed on the simulated valve: {time_s:.1f} s, within all limits")
_INDICATED = marked("indication in the rehearsal: {text}")


def is_of_rehearsal(line: str) -> bool:
    """Whether a line that was printed is one of a rehearsal's notes, in any language."""
    for language in languages():
        with speaking(language):
            if line.startswith(tuple(_(code).partition("{")[0] for code in (_REHEARSED, _INDICATED))):
                return True
    return False


def rehearse(
    procedure: Procedure,
    bench: BenchFile,
    settings: Mapping[str, Any],
    progress: Progress = quiet,
    earlier: Recording | None = None,
    keep: Path | None = None,
) -> Rehearsal:
    """Play a procedure on the twin of a bench, in virtual time, behind the same limits and interlocks.

    Args:
        procedure: what to run.
        bench: whose twin.
        settings: by name, as values.
        progress: called with how far the rehearsal is.
        earlier: a run that is to be resumed.
        keep: the run folder to make of it, for somebody who looks at what would be driven; else it is forgotten, as
            one that is refused is in any case.

    Raises:
        RehearsalError: a sample would leave the envelope, or an interlock would stop or trip the run.
        SettingError: the bench has no twin, or a setting is not allowed.
    """
    twin = twin_of(bench)
    with TemporaryDirectory(prefix="hil-rehearsal-") as folder:
        run = keep or Path(folder) / "run"
        try:
            with open_rig(twin, run, {}, lambda done, text: progress(done, f"rehearsal: {text}"),
                          earlier=earlier) as rig:  # fmt: skip
                procedure.run(rig, **settings)
        except StorageError:
            raise
        except (RangeError, HardwareError) as error:
            reason = _reason(run, error)
            if keep is not None:
                shutil.rmtree(keep, ignore_errors=True)  # a folder with samples would be taken for a run
            raise RehearsalError(
                f"refused: in the rehearsal on the simulated {twin.bench.valve.name}, {reason}; nothing was driven"
            ) from error
        return _rehearsal_of(run, earlier)


def _rehearsal_of(run: Path, earlier: Recording | None) -> Rehearsal:
    recording = read(run)
    before_s = earlier.duration_s if earlier else 0.0
    indicated = [event["details"] for event in recording.meta["events"] if event["event"] == "indicate"]
    return Rehearsal(
        recording.duration_s - before_s, tuple(dict.fromkeys(str(details["text"]) for details in indicated))
    )


def _reason(run: Path, error: Exception) -> str:
    """What the guard wrote down as it acted, without the remedy for a real bench."""
    if not isinstance(error, HardwareError):
        return str(error)
    events = read(run).meta["events"]
    acted = [event["details"]["text"] for event in events if event["event"] in ("trip", "stop")]
    return str(acted[-1]) if acted else str(error)
