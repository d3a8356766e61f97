"""The seal of a run folder: the SHA-256 of every file in it, and the limits by which it was judged.

`end.json` seals what the run recorded, `seal.json` everything else, `end.json` among it. It is written last, when a run
was evaluated, and again whenever it is evaluated once more. Who can write the folder can also seal it anew: what the
seal was stands in the audit trail (`hil.bench.audit`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Literal

from pydantic import Field

from hil.errors import FileError, storing
from hil.record.durable import sync_folder, write_whole
from hil.record.measurement import FINDINGS_FILE, RESULTS_FILE, Limit
from hil.record.moment import Moment
from hil.record.run_folder.header import END_FILE, HEADER_FILE, check_unchanged, read_end, read_stated, sha256_of
from hil.record.run_folder.samples import ROWS_FILE
from hil.strict import Strict
from hil.version import PROGRAM

SEAL_FILE = "seal.json"
# What other programs are told while a run goes on, and the seal itself.
_NEVER = (SEAL_FILE, "control.json", "progress.json", "watchdog-so-far.json")


class Seal(Strict):
    """How a folder was sealed: `limits` by which the run was judged, the `program` that judged it, `sha256` by name."""

    format: Literal["hil-run-seal"] = "hil-run-seal"
    version: Literal[1] = 1
    program: str = PROGRAM
    sealed_utc: Moment = Field(default_factory=lambda: datetime.now(UTC))
    limits: dict[str, Limit]
    sha256: dict[str, str]


def files_of(folder: Path) -> Iterator[tuple[str, Path]]:
    """Every file of a run folder that stays, by its name in the folder; no links."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if name not in _NEVER and path.suffix != ".part" and not path.is_symlink() and path.is_file():
            yield name, path


def seal_folder(folder: Path, limits: Mapping[str, Limit]) -> None:
    """Seal a folder as it stands.

    Raises:
        StorageError: the seal cannot be written.
    """
    end = read_end(folder)
    recorded = {} if end is None else end.sha256
    seal = Seal(
        limits=dict(limits), sha256={name: sha256_of(path) for name, path in files_of(folder) if name not in recorded}
    )
    with storing(folder / SEAL_FILE, kept="; the samples are kept"):
        write_whole(folder / SEAL_FILE, seal.model_dump_json(indent=1) + "\n")
        sync_folder(folder)


def read_seal(folder: Path) -> Seal | None:
    """The seal of a folder; None where it was never evaluated, or by a version that did not seal.

    Raises:
        FileError: it is not what this program writes, or seals what lies outside the folder.
    """
    path = folder / SEAL_FILE
    seal = read_stated(path, Seal) if path.exists() else None
    for name in () if seal is None else seal.sha256:
        if PurePosixPath(name).is_absolute() or not name or ".." in name.split("/"):
            raise FileError(f"{path}: seals '{name}', which is no file of the run folder")
    return seal


def check_seal(folder: Path, only: str = "") -> Seal | None:
    """The seal of a folder in which every file is the one that was sealed; None where nothing but `end.json` seals it.

    Args:
        folder: of the run.
        only: one file is looked at, and no other.

    Raises:
        FileError: a file is another, or is gone; names it.
    """
    seal, end = read_seal(folder), read_end(folder)
    recorded = {} if end is None else end.sha256
    evaluated = any((folder / name).is_file() for name in (RESULTS_FILE, FINDINGS_FILE))
    if seal is None and not only and ROWS_FILE in recorded and evaluated:
        raise FileError(
            f"{folder / SEAL_FILE}: is gone, or was never written; `hil report {folder}` evaluates and seals"
        )
    for name, expected in {**recorded, **({} if seal is None else seal.sha256)}.items():
        if only in ("", name):
            evaluated_again = (
                "" if name in recorded or name == END_FILE else f"; `hil report {folder}` evaluates the run again"
            )
            check_unchanged(folder / name, expected, "sealed", evaluated_again)
    return seal


def marks_of(folder: Path) -> dict[str, str]:
    """The SHA-256 of the three files that stand for all of them, as the audit trail keeps them."""
    return {name: sha256_of(folder / name) for name in (HEADER_FILE, END_FILE, SEAL_FILE) if (folder / name).is_file()}
