"""Settings of a procedure: from `name=text` on a command line to a value of the declared type."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, get_args, get_origin

from annotated_types import Unit

from hil.errors import FileError, SettingError
from hil.session.allowed import Allowed, declared, numbers_in
from hil.session.quantity import number_in
from hil.untrusted import parse_json

_ENDINGS = {"_rad_s": "rad/s", "_s": "s", "_hz": "Hz", "_mm": "mm", "_a": "A", "_v": "V", "_lpm": "l/min"}


@dataclass(frozen=True, slots=True)
class Setting:
    """An argument of a procedure: its declared type, its default, and what it means."""

    name: str
    type: Any
    default: Any
    meaning: str = ""

    @property
    def unit(self) -> str:
        """Of its numbers, as its type (`Annotated[float, Unit("Hz")]`) or its name (`cycle_s`) says; else empty."""
        if not _has_numbers(self.type):
            return ""
        if (stated := declared(self.type, Unit)) is not None:
            return stated.unit
        return next((unit for ending, unit in _ENDINGS.items() if self.name.endswith(ending)), "")

    def parsed(self, given: Any) -> Any:
        """A value of the declared type, from text (`5,10,20`, `yes`, `[[0, 1], [2, 3]]`) or from a value.

        Raises:
            SettingError: it is not one; says what was expected and what was found.
        """
        from pydantic import TypeAdapter, ValidationError

        adapter: TypeAdapter[Any] = TypeAdapter(self.type)
        try:
            value = adapter.validate_python(self._from_text(given) if isinstance(given, str) else given)
        except ValidationError as error:
            first = error.errors()[0]
            place = "".join(f"[{key}]" for key in first["loc"] if isinstance(key, int))
            raise SettingError(f"setting {self.name}{place}: {first['input']!r:.40}: {self._wanted(first)}") from None
        return self._within(value)

    @property
    def allowed(self) -> str:
        """The range of its numbers, as a reader has it (`≥ 1`); empty where any is taken."""
        allowed = declared(self.type, Allowed)
        return allowed.text if allowed else ""

    def _within(self, value: Any) -> Any:
        """The value again, when each of its numbers is allowed."""
        allowed = declared(self.type, Allowed)
        for number in numbers_in(value) if allowed else ():
            if allowed and (fault := allowed.fault(number)):
                raise SettingError(f"setting {self.name}: {number:g}{self.unit and ' '}{self.unit}; {fault}")
        return value

    def _wanted(self, error: Mapping[str, Any]) -> str:
        """What was expected, in the words of this program where it has some."""
        own = {
            "float_parsing": f"a number{f' in {self.unit}' if self.unit else ''} was expected",
            "int_parsing": "a whole number was expected",
            "bool_parsing": "yes or no was expected",
            "literal_error": f"expected is one of {type_text(self.type)}",
        }
        return own.get(str(error["type"]), str(error["msg"]))

    def described(self) -> str:
        """`name [unit]: type (range) = default   meaning`."""
        unit = f" [{self.unit}]" if self.unit else ""
        within = f" ({self.allowed})" if self.allowed else ""
        head = f"{self.name}{unit}: {type_text(self.type)}{within} = {value_text(self.default)}"
        return f"{head}\n    {self.meaning}" if self.meaning else head

    def echoed(self, value: Any) -> str:
        """`name = value unit`, as it was understood."""
        return f"{self.name} = {value_text(value)}{f' {self.unit}' if self.unit and value is not None else ''}"

    def _from_text(self, text: str) -> Any:
        """Text as pydantic takes it, numbers with a unit brought to the declared one."""
        found = _from_text(text, self.type)
        if not _has_numbers(self.type):
            return found
        if isinstance(found, list) and all(isinstance(part, str) for part in found):
            return [self._number(part) for part in found]
        return self._number(found) if isinstance(found, str) else found

    def _number(self, text: str) -> Any:
        """A number in the declared unit where the text says one; everything else is pydantic's to judge."""
        if not text[:1].isdigit() and text[:1] not in "+-.":
            return text
        bare = text.strip().lstrip("+-").replace(".", "").replace("e", "").replace("-", "").isdigit()
        return text if bare else number_in(text, self.unit, f"setting {self.name}")


def parse_settings(known: Mapping[str, Setting], given: Mapping[str, Any]) -> dict[str, Any]:
    """Values for every setting: those given, parsed, and the defaults.

    Raises:
        SettingError: one that is not known, which lists the others, or whose value is not allowed.
    """
    for name in given:
        if name not in known:
            close = get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"; the nearest is '{close[0]}'" if close else ""
            raise SettingError(f"no setting '{name}'{hint}; there are: {', '.join(known) or 'none'}")
    return {name: s.parsed(given[name]) if name in given else s.default for name, s in known.items()}


def _has_numbers(kind: Any) -> bool:
    """Whether a type holds floating-point numbers, alone or in a sequence."""
    return kind is float or any(_has_numbers(part) for part in get_args(kind) if part is not Ellipsis)


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
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)


def _from_text(text: str, kind: Any) -> Any:
    """Text as pydantic takes it for a type: split at commas for a sequence, JSON where it is nested."""
    if get_origin(kind) is typing.Annotated:
        return _from_text(text, get_args(kind)[0])
    if text.startswith(("[", "{")):
        try:
            return parse_json(text, "")
        except FileError:
            return text
    options = get_args(kind) if get_origin(kind) not in (tuple, list) else (kind,)
    if type(None) in options and text.lower() in ("none", ""):
        return None
    if any(get_origin(option) in (tuple, list) for option in options):
        return [part.strip() for part in text.split(",") if part.strip()]
    return text
