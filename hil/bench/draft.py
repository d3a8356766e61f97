"""The sound entries of a bench file, and the faults of the others; so that all faults are found at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, get_args, get_origin

from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from hil.bench.fault import Fault
from hil.bench.file import (
    AcceptanceLimit,
    Bench,
    ChannelEntry,
    Device,
    InstrumentEntry,
    InterlockEntry,
    ProtectionEntry,
    Valve,
)
from hil.bench.lines import Place
from hil.bench.wording import described, misread


@dataclass(slots=True)
class Draft:
    """What of a bench file stands; keys with faults are left out, or whole entries when they need them."""

    sample_rate_hz: float | None = None
    protection: ProtectionEntry = field(default_factory=ProtectionEntry)
    valve: Valve | None = None
    devices: dict[str, Device] = field(default_factory=dict)
    channels: dict[str, ChannelEntry] = field(default_factory=dict)
    interlocks: dict[str, InterlockEntry] = field(default_factory=dict)
    instruments: tuple[InstrumentEntry, ...] = ()
    acceptance: dict[str, dict[str, AcceptanceLimit]] = field(default_factory=dict)
    presets: dict[str, dict[str, dict[str, Any]]] = field(default_factory=dict)
    simulation: dict[str, Any] = field(default_factory=dict)
    faulty: set[Place] = field(default_factory=set)


def draft_of(content: Mapping[str, Any]) -> tuple[Draft, list[Fault]]:
    """Everything in the file that can be used, and what is wrong with the rest."""
    draft, faults = Draft(), _unknown_keys(content)
    for name, info in Bench.model_fields.items():
        if name not in content:
            if info.is_required():
                faults.append(Fault((name,), "is missing; every bench file says it"))
            continue
        value, found = _section(name, info, content[name])
        faults += found
        if hasattr(draft, name) and value is not None:
            setattr(draft, name, value)
    draft.faulty = {fault.place[:2] for fault in faults}
    return draft, faults


def sound_part(kind: Any, content: Any, place: Place) -> tuple[Any, list[Fault]]:
    """A value of type `kind`, and the faults of its text; keys with faults are left out where they may be.

    None when nothing can be made of it.
    """
    try:
        value = TypeAdapter(kind).validate_python(content)
        faults = list(misread(content, value, place))
        if not faults:
            return value, []
        bad = {key for fault in faults for key in fault.place[len(place) :][:1]}
    except ValidationError as error:
        faults = described(error, kind, place)
        bad = {found["loc"][0] for found in error.errors() if found["loc"]}
    if not isinstance(content, dict) or not bad or not bad <= set(content):
        return None, faults
    value, more = sound_part(kind, {key: value for key, value in content.items() if key not in bad}, place)
    return value, faults + [fault for fault in more if fault.place[len(place) :][:1] not in {(key,) for key in bad}]


def _section(name: str, info: FieldInfo, content: Any) -> tuple[Any, list[Fault]]:
    if get_origin(info.annotation) is not dict or not isinstance(content, dict):
        kind = Annotated[(info.annotation, *info.metadata)] if info.metadata else info.annotation
        return sound_part(kind, content, (name,))
    parts = {key: sound_part(get_args(info.annotation)[1], entry, (name, key)) for key, entry in content.items()}
    sound = {key: value for key, (value, _) in parts.items() if value is not None}
    return sound, [fault for _, found in parts.values() for fault in found]


def _unknown_keys(content: Mapping[str, Any]) -> list[Fault]:
    known = ", ".join(Bench.model_fields)
    return [Fault((key,), f"is not known here; there are: {known}") for key in content if key not in Bench.model_fields]
