"""Settings of a procedure: from `name=text` on a command line to a value of the declared type."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, get_args, get_origin

from annotated_types import Ge, Gt, Interval, Le, Lt, Unit

from hil.errors import FileError, SettingError
from hil.session.quantity import number_in
from hil.units import split_unit
from hil.untrusted import parse_json

_OUTSIDE = ("finite_number", "greater_than", "greater_than_equal", "less_than", "less_than_equal")


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
        if (stated := _declared(self.type, (Unit,))) is not None:
            return stated.unit
        return split_unit(self.name)[1]

    def parsed(self, given: Any) -> Any:
        """A value of the declared type, from text (`5,10,20`, `yes`, `[[0, 1], [2, 3]]`) or from a value; all finite.

        Raises:
            SettingError: it is not one; says what was expected and what was found.
        """
        from pydantic import ConfigDict, TypeAdapter, ValidationError

        finite = ConfigDict(allow_inf_nan=False) if _has_numbers(self.type) else None  # a table has its own
        adapter: TypeAdapter[Any] = TypeAdapter(self.type, config=finite)
        try:
            return adapter.validate_python(self._from_text(given) if isinstance(given, str) else given)
        except ValidationError as error:
            first = error.errors()[0]
            if first["type"] in _OUTSIDE:
                number = f"{float(first['input']):g}{self.unit and ' '}{self.unit}"
                raise SettingError(f"setting {self.name}: {number}; {self._demand}") from None
            place = "".join(f"[{key}]" for key in first["loc"] if isinstance(key, int))
            raise SettingError(f"setting {self.name}{place}: {first['input']!r:.40}: {self._expected(first)}") from None

    @property
    def allowed(self) -> str:
        """The range of its numbers, as a reader has it (`≥ 1`, `> 0, < 50`, `1 … 5`); empty where any is taken."""
        ends = self._ends
        if ends.keys() == {"ge", "le"}:
            return "{ge} … {le}".format(**ends)
        signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
        return ", ".join(f"{signs[key]} {end}" for key, end in ends.items())

    @property
    def _demand(self) -> str:
        """What its numbers must be, in words."""
        ends = self._ends
        if ends.keys() == {"ge", "le"}:
            return "allowed are {ge} to {le}".format(**ends)
        words = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
        return f"it must be {' and '.join(f'{words[key]} {end}' for key, end in ends.items()) or 'finite'}"

    @property
    def _ends(self) -> dict[str, str]:
        """Of the range that its type declares (`Annotated[int, Interval(ge=1)]`), the lower first."""
        stated = _declared(self.type, (Interval, Ge, Gt, Le, Lt))
        ends = {key: getattr(stated, key, None) for key in ("ge", "gt", "le", "lt")}
        return {key: f"{end:g}" for key, end in ends.items() if end is not None}

    def _expected(self, error: Mapping[str, Any]) -> str:
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


def _declared(kind: Any, what: tuple[type, ...]) -> Any:
    """What a type declares of its numbers, alone, in a union or of each item of a sequence; None for nothing."""
    arguments = get_args(kind)
    if get_origin(kind) is typing.Annotated:
        own = next((part for part in arguments[1:] if isinstance(part, what)), None)
        return own or _declared(arguments[0], what)
    return next((found for part in arguments if (found := _declared(part, what)) is not None), None)


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
