"""What is known of a unit at one date: from a passport, a run folder, or a folder with recordings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hil.archive.entry import run_folders
from hil.errors import FileError
from hil.passport.attached import MODEL_FILE, RUNS, TYPE_MODEL_FILE
from hil.passport.contents import lay_out
from hil.passport.verify import opened
from hil.physics.model import Model, load_model
from hil.record.read import formats, read_recording
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.run_folder.header import HEADER_FILE, stated


@dataclass(frozen=True, slots=True)
class Dated:
    """Recordings of one date, with the models that came with them."""

    name: str
    recordings: tuple[Recording, ...]
    kind: Model | None = None
    unit: Model | None = None

    @property
    def serials(self) -> set[str]:
        """Of the units that the recordings name."""
        return {stated(one.meta, "valve", "serial") for one in self.recordings} - {""}


def read_dated(path: Path, place: Path, reading: Reading | None = None) -> Dated:
    """Read one date.

    Args:
        path: passport, run folder, recording or folder with recordings.
        place: an empty folder, in which a passport is laid out.
        reading: how recordings are read; those of a passport are as they were.

    Raises:
        FileError: none of these, or a passport that was changed.
    """
    if path.is_file() and path.suffix.lower() == ".pdf":
        content, verified = opened(path)
        lay_out(content, place, verified.most_bytes)
        kind, unit = (_model(place / name) for name in (TYPE_MODEL_FILE, MODEL_FILE))
        return Dated(path.name, _read(run_folders(place / RUNS)), kind, unit)
    if path.is_file() or (path / HEADER_FILE).is_file():
        return Dated(path.name, _read([path], reading))
    if not path.is_dir():
        raise FileError(f"{path}: no such file or folder; a passport, a run folder or a folder with recordings")
    ends = tuple(formats())
    found = [*run_folders(path), *(one for one in sorted(path.iterdir()) if one.name.lower().endswith(ends))]
    if not found:
        raise FileError(f"{path}: holds no recordings")
    return Dated(path.name, _read(found, reading))


def _read(paths: Iterable[Path], reading: Reading | None = None) -> tuple[Recording, ...]:
    return tuple(read_recording(path, reading) for path in paths)


def _model(path: Path) -> Model | None:
    return load_model(path) if path.is_file() else None
