"""Settings of a procedure: from `name=text` on a command line to a value of the declared type."""

from __future__ import annotations

import json
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, get_args, get_origin

from hil.errors import SettingError


@dataclass(frozen=True, slots=True)
class Setting:
    """An argument of a procedure: its declared type, its default, and what it means."""

    name: str
    type: Any
    default: Any
    meaning: str = ""

    def parsed(self, given: Any) -> Any:
        """A value of the declared type, from text (`5,10,20`, `yes`, `[[0, 1], [2, 3]]`) or from a value.

        Raises:
            SettingError: it is not one; says what was expected and what was found.
        """
        from pydantic import TypeAdapter, ValidationError

        adapter: TypeAdapter[Any] = TypeAdapter(self.type)
        try:
            return adapter.validate_python(_from_text(given, self.type) if isinstance(given, str) else given)
        except ValidationError as error:
            first = error.errors()[0]
            place = "".join(f"[{key}]" for key in first["loc"] if isinstance(key, int))
            raise SettingError(f"setting {self.name}{place}: {first['msg']}, found {first['input']!r:.40}") from None

    def described(self) -> str:
        """`name: type = default   meaning`."""
        head = f"{self.name}: {type_text(self.type)} = {value_text(self.default)}"
        return f"{head}\n    {self.meaning}" if self.meaning else head


def parse_settings(known: Mapping[str, Setting], given: Mapping[str, Any]) -> dict[str, Any]:
    """Values for every setting: those given, parsed, and the defaults.

    Raises:
        SettingError: one that is not known, or whose value is not allowed; lists the settings.
    """
    try:
        for name in given:
            if name not in known:
                close = get_close_matches(name, known, n=1, cutoff=0.5)
                hint = f"; the nearest is '{close[0]}'" if close else ""
                raise SettingError(f"no setting '{name}'{hint}")
        return {name: s.parsed(given[name]) if name in given else s.default for name, s in known.items()}
    except SettingError as error:
        have = "; ".join(f"{s.name}: {type_text(s.type)} = {value_text(s.default)}" for s in known.values())
        raise SettingError(f"{error}. Settings: {have or 'none'}") from None


def split_assignments(texts: Iterable[str]) -> dict[str, str]:
    """`["amplitudes=5,10", …]` as a mapping.

    Raises:
        SettingError: a text without `=`, or a name given twice.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().replace("-", "_")
        if not equals or not name:
            raise SettingError(f"'{text}' is not NAME=VALUE")
        if name in found:
            raise SettingError(f"setting '{name}' is given twice")
        found[name] = value.strip()
    return found


def type_text(kind: Any) -> str:
    """A type as an operator reads it: `float, …`, `one of raw | normalised`."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is typing.Annotated:
        return type_text(arguments[0])
    if origin is typing.Literal:
        return " | ".join(str(value) for value in arguments)
    if origin in (tuple, list):
        return ", ".join("…" if part is Ellipsis else type_text(part) for part in arguments)
    if arguments:
        return " | ".join(type_text(part) for part in arguments)
    return "none" if kind is type(None) else getattr(kind, "__name__", str(kind))


def value_text(value: Any) -> str:
    """A value as it would be given on the command line."""
    if isinstance(value, tuple | list):
        return ",".join(value_text(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)


def _from_text(text: str, kind: Any) -> Any:
    """Text as pydantic takes it for a type: split at commas for a sequence, JSON where it is nested."""
    if get_origin(kind) is typing.Annotated:
        return _from_text(text, get_args(kind)[0])
    if text.startswith(("[", "{")):
        try:
            return json.loads(text)
        except json.JSONDecodeError:
            return text
    options = get_args(kind) if get_origin(kind) not in (tuple, list) else (kind,)
    if type(None) in options and text.lower() in ("none", ""):
        return None
    if any(get_origin(option) in (tuple, list) for option in options):
        return [part.strip() for part in text.split(",") if part.strip()]
    return text
