"""Where what a diagnosis was made of came from: unit, bench, date and checksum of each recording, and of the model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.errors import FileError
from hil.language.words import _
from hil.record.recording import Recording
from hil.record.run_folder.header import HEADER_FILE, read_header, sha256_of, stated
from hil.record.run_folder.samples import ROWS_FILE
from hil.report.local_time import stated_text


@dataclass(frozen=True, slots=True)
class Origin:
    """A recording or a model file by what tells it from any other.

    Attributes:
        name: its path. `sealed`: the file that `sha256` is of; both empty where there is none.
        about: the header of its run, where it has one.
    """

    name: str
    about: Mapping[str, Any]
    sealed: str = ""
    sha256: str = ""


def origin_of(recording: Recording) -> Origin:
    """Of a recording that was read: its header, and the checksum of its file where it is one."""
    return Origin(recording.name, recording.meta, *_seal(Path(recording.name)))


def origin_at(path: str | Path) -> Origin:
    """Of a file or run folder by its path, whether it is there or not."""
    folder = Path(path)
    return Origin(str(path), _header(folder), *_seal(folder))


def all_origins(known: Iterable[Origin], names: Iterable[str]) -> list[Origin]:
    """Those known, and those of recordings that were made since."""
    have = list(known)
    missing = [name for name in names if not any(name == one.name or name.startswith(f"{one.name},") for one in have)]
    return [*have, *(origin_at(name) for name in missing)]


def origin_facts(origins: Sequence[Origin]) -> list[tuple[str, str]]:
    """For the page: (name, what is known of it)."""
    return [(one.name, _text(one)) for one in origins]


def _text(one: Origin) -> str:
    serial, bench = stated(one.about, "valve", "serial"), stated(one.about, "bench")
    facts = list(filter(None, (serial, bench, stated_text(one.about.get("started_utc")))))
    if one.sha256:
        facts.append(_("SHA-256 of {file}").format(file=one.sealed) + f" {one.sha256}")
    return "; ".join(facts) or _("nothing is known of it")


def _header(folder: Path) -> Mapping[str, Any]:
    if not (folder / HEADER_FILE).is_file():
        return {}
    header = read_header(folder)
    return {**header.meta, "started_utc": header.started_utc.isoformat()}


def _seal(path: Path) -> tuple[str, str]:
    file = path / ROWS_FILE if path.is_dir() else path
    try:
        return (file.name, sha256_of(file)) if file.is_file() else ("", "")
    except FileError:
        return "", ""
