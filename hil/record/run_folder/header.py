"""What a run folder says about itself: at its start (`run.json`) and at its end (`end.json`)."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from io import FileIO
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from typing_extensions import TypedDict

from hil.errors import FileError, first_fault, reading
from hil.record.durable import sync_file, sync_folder, write_at
from hil.record.moment import Moment
from hil.record.plain import plain
from hil.strict import Strict
from hil.system import system
from hil.untrusted import ANY_SIZE, open_untrusted, read_untrusted_json
from hil.version import PROGRAM, is_newer, made_by

HEADER_FILE, END_FILE = "run.json", "end.json"
_VERSION = 1
_KEPT_BYTES, _MOST_BYTES = 16384, 1 << 22  # of one file: every page and every list reads them
_SAMPLES = ("samples.f8", "samples.log")
_FIGURES, _WORDS = ("slope", "offset", "uncertainty", "lag_s"), ("date", "due", "source", "unit", "raw_unit")
NEEDED = "; a run folder needs it"
_NO_BRACKET = r"^[^\[\]\r\n]+$"


class Column(Strict):
    """One recorded quantity: values in `unit`, with the calibration that was already applied to them.

    Neither name nor unit holds a bracket, so that `name [unit]` stays readable as a heading.
    """

    name: str = Field(pattern=_NO_BRACKET)
    unit: str = Field(pattern=_NO_BRACKET)
    source: str = ""
    calibration: dict[str, Any] = Field(default_factory=dict)

    @field_validator("calibration")
    @classmethod
    def _calibration(cls, stated: dict[str, Any]) -> dict[str, Any]:
        if wrong := [key for key in _FIGURES if not isinstance(stated.get(key, 0.0), int | float | None)]:
            raise ValueError(f"'{wrong[0]}' of a calibration is a number")
        if wrong := [key for key in _WORDS if not isinstance(stated.get(key, ""), str | None)]:
            raise ValueError(f"'{wrong[0]}' of a calibration is a text")
        return stated


class Table(Strict):
    """How the samples lie in their file: rows of little-endian float64, one value per column."""

    file: Literal["samples.f8"] = "samples.f8"
    type: Literal["<f8"] = "<f8"
    columns: tuple[Column, ...] = Field(min_length=2)


class StatedValve(TypedDict, total=False):
    """The valve that was tested, as its bench file says it."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    name: str
    plant: str
    serial: str
    settling_s: float
    limits: dict[str, Any] | None
    operating_point: float | None
    integrates: bool
    amplifier: str


class StatedConditions(TypedDict, total=False):
    """Conditions of the test, as the bench file says them."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    fluid: str
    viscosity_class: str
    cleanliness: str
    fluid_temperature_c: float | None
    ambient_temperature_c: float | None
    supply_pressure_bar: float | None
    return_pressure_bar: float | None
    pressure_drop_bar: float | None
    notes: str
    ranges: dict[str, tuple[float, float]]


class Sampling(TypedDict, total=False):
    """How the inputs were read (see `hil.daq.contract.Promises.sampling`)."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    timing: str
    rate_hz: float
    delay_s: dict[str, float]
    delay_channels: dict[str, str] | None


class Meta(TypedDict, total=False):
    """What the bench and the procedure say of a run; who reads one relies on these, and anything more may be said."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    procedure: str
    settings: dict[str, Any]
    limits: dict[str, Any]
    bench: str
    bench_path: str
    bench_file: str
    simulated: bool
    operator: str
    plant: str
    roles: dict[str, str]
    valve: StatedValve
    conditions: StatedConditions
    instruments: list[dict[str, str | None]]
    deviations: list[Any]
    codes: dict[str, Any]
    sampling: Sampling
    driven: dict[str, dict[str, Any]]
    read: dict[str, dict[str, Any]]
    notes: dict[str, Any]
    outputs: dict[str, dict[str, Any]]


class Header(Strict):
    """What is known when a run starts. Written once, never touched again.

    `meta` holds what the bench and the procedure say, as JSON values.
    """

    format: Literal["hil-run"] = "hil-run"
    version: Literal[1] = 1
    program: str = PROGRAM
    started_utc: Moment = Field(default_factory=lambda: system.utc())
    samples: Table
    meta: Meta = Field(default_factory=Meta)


class End(Strict):
    """What is known when a run stops. Its presence means that the run was closed in order.

    `rows` and `crc32` (over all rows) say how far the samples go; `sha256` seals every file that was recorded, by name.
    `outputs` is what was known of each output then, by name; it stands in `meta` too, where earlier versions had it
    alone.
    """

    format: Literal["hil-run-end"] = "hil-run-end"
    version: Literal[1] = 1
    outcome: str
    stopped_utc: Moment = Field(default_factory=lambda: system.utc())
    rows: int = Field(ge=0)
    crc32: str = Field(pattern="^[0-9a-f]{8}$")
    sha256: dict[str, str]
    outputs: dict[str, dict[str, Any]] = Field(default_factory=dict)
    meta: Meta = Field(default_factory=Meta)


def new_header(channels: Sequence[tuple[str, str] | Column], meta: Mapping[str, Any]) -> Header:
    """The header of a run that starts now, with `time [s]` as the first column.

    Raises:
        ValueError: a channel name occurs twice, is `time` or holds a bracket, or there is no channel.
    """
    columns = [c if isinstance(c, Column) else Column(name=c[0], unit=c[1]) for c in channels]
    names = ["time", *(column.name for column in columns)]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"channel names must differ from each other and from 'time': {', '.join(sorted(twice))}")
    return Header(samples=Table(columns=(Column(name="time", unit="s"), *columns)), meta=plain(meta))


def write_header(folder: Path, header: Header) -> None:
    """Write `run.json`, and keep room on the disk so that `end.json` can be written when it is full."""
    (folder / HEADER_FILE).write_text(header.model_dump_json(indent=1) + "\n", encoding="utf-8")
    (folder / f"{END_FILE}.part").write_bytes(b" " * _KEPT_BYTES)


def open_end(folder: Path) -> FileIO:
    """The room that is kept for `end.json`, open: it can be written when no file can be opened any more."""
    return FileIO(folder / f"{END_FILE}.part", "r+")


def write_end(folder: Path, room: FileIO, end: End) -> None:
    """Write `end.json`, whole or not at all, in the room that was kept for it."""
    text = end.model_dump_json(indent=1).encode() + b"\n"
    write_at(room, 0, text)
    room.truncate(len(text))
    sync_file(room.fileno())
    (folder / f"{END_FILE}.part").replace(folder / END_FILE)
    sync_folder(folder)


def read_header(folder: Path) -> Header:
    """The header of a run folder.

    Raises:
        FileError: there is none, or it is not what this program writes; names the field.
    """
    return read_stated(folder / HEADER_FILE, Header)


def read_end(folder: Path) -> End | None:
    """How the run ended; None while it is being written, and when its program was killed."""
    path = folder / END_FILE
    return read_stated(path, End) if path.exists() else None


def meta_of(folder: Path) -> dict[str, Any]:
    """What a run says of itself, without its samples: its header's words and, where it was closed, those of its end.

    Raises:
        FileError: not a run folder.
    """
    header, end = read_header(folder), read_end(folder)
    meta = header.meta if end is None else {**header.meta, **end.meta, "outcome": end.outcome}
    return {**meta, "program": header.program, "started_utc": header.started_utc.isoformat()}


def check_sealed(folder: Path, end: End) -> None:
    """Raise `FileError` when a file is no longer the one that was sealed at the end of the run.

    Samples have a checksum of their own, which also tells how far they go when they are cut off.
    """
    for name, expected in end.sha256.items():
        if Path(name).name != name:
            raise FileError(f"{folder / END_FILE}: seals '{name}', which is no file of the run folder")
        if name not in _SAMPLES:
            check_unchanged(folder / name, expected, "closed")


def check_unchanged(path: Path, expected: str, since: str, remedy: str = "") -> None:
    """Raise `FileError` unless a file of a run has this SHA-256, as when the run was `since` closed or sealed."""
    found = sha256_of(path)
    if found != expected:
        raise FileError(
            f"{path}: changed after the run was {since}: SHA-256 {found[:12]}…, expected {expected[:12]}…{remedy}"
        )


def sha256_of(path: Path) -> str:
    """SHA-256 of a file.

    Raises:
        FileError: it cannot be read.
    """
    with reading(path, remedy=NEEDED), open_untrusted(path.parent, path.name, ANY_SIZE) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


_Model = TypeVar("_Model", bound=BaseModel)


def read_stated(path: Path, model: type[_Model]) -> _Model:
    """A file in which a run folder says something about itself.

    Raises:
        FileError: there is none, or it is not what this program writes; names the field.
    """
    if path.parent.is_file():
        raise FileError(f"{path.parent}: a file, where a run folder is needed; `hil run` makes one")
    with reading(path, remedy=NEEDED):
        content = read_untrusted_json(path.parent, path.name, _MOST_BYTES)
    name = model.model_fields["format"].default
    if not isinstance(content, dict) or content.get("format") != name:
        raise FileError(f"{path}: field 'format' must be '{name}'; this is not a run folder of this program")
    if content.get("version") != _VERSION:
        newer = f": {made_by(content['program'])}" if content.get("program") else ""
        raise FileError(f"{path}: version {content.get('version')!r:.20}; this program reads version {_VERSION}{newer}")
    try:
        return model.model_validate(content)
    except ValidationError as error:
        maker = str(content.get("program") or "")
        newer = f"; {made_by(maker)}" if is_newer(maker.removeprefix("valve-hil ")) else ""
        raise FileError(f"{path}: {first_fault(error)}{newer}") from None


def stated(about: Any, *path: str) -> str:
    """What a header states, as text: `stated(meta, "valve", "serial")`; empty where it says nothing of that."""
    for name in path:
        about = about.get(name) if isinstance(about, Mapping) else None
    return str(about or "")
