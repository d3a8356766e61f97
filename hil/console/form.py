"""The form of a procedure, made of its signature: a field for each setting, with unit, default and meaning."""

from __future__ import annotations

import re
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_origin

from hil.errors import SettingError
from hil.language.words import marked
from hil.session.procedure import Procedure
from hil.session.setting import Setting, value_text

NOTES = (("order", marked("Order number")), ("oil", marked("Oil")))  # of `hil run --note`, by name
_NAMED = re.compile(r"\bsetting '?(\w+)|^(\w+)[ :]")


@dataclass(frozen=True, slots=True)
class Field:
    """A setting as a page asks for it.

    Attributes:
        name, unit, meaning: of the setting.
        kind: `choice`, `switch`, `number`, `list` or `text`.
        options: of a choice.
        default: as it would be typed.
        allowed: the range of its numbers, empty where any is taken.
    """

    name: str
    unit: str
    meaning: str
    kind: str
    options: tuple[str, ...]
    default: str
    allowed: str


def fields_of(procedure: Procedure) -> list[Field]:
    """A field for every setting, in the order of the signature."""
    return [_field(setting) for setting in procedure.settings.values()]


def given_of(procedure: Procedure, form: Mapping[str, str]) -> dict[str, str]:
    """What was typed and differs from the default, by name of the setting; fields of other names are none."""
    fields = {field.name: field for field in fields_of(procedure)}
    typed = {name: form[f"set.{name}"].strip() for name in fields if f"set.{name}" in form}
    return {name: text for name, text in typed.items() if text != fields[name].default}


def faults_of(procedure: Procedure, given: Mapping[str, str]) -> dict[str, str]:
    """What is wrong with each setting that was typed, in words; empty where all can be taken."""
    found = {}
    for name, text in given.items():
        try:
            procedure.settings[name].parsed(text)
        except SettingError as error:
            found[name] = str(error).removeprefix(f"setting {name}").lstrip(": ")
    return found


def setting_named_in(procedure: Procedure, message: str) -> str:
    """The setting of which an error speaks; empty where it names none."""
    names = [one or other for one, other in _NAMED.findall(message)]
    return next((name for name in names if name in procedure.settings), "")


def _field(setting: Setting) -> Field:
    kind, options = _kind(setting.type)
    default = "none" if setting.default is None else value_text(setting.default)
    return Field(setting.name, setting.unit, setting.meaning, kind, options, default, setting.allowed)


def _kind(declared: Any) -> tuple[str, tuple[str, ...]]:
    origin, arguments = get_origin(declared), get_args(declared)
    if origin is typing.Annotated:
        return _kind(arguments[0])
    if origin is typing.Literal:
        return "choice", tuple(str(value) for value in arguments)
    if declared is bool:
        return "choice", ("true", "false")
    if set(arguments) == {bool, type(None)}:
        return "choice", ("none", "true", "false")
    if declared in (int, float):
        return "number", ()
    if any(get_origin(part) in (tuple, list) for part in (declared, *arguments)):
        return "list", ()
    return "text", ()
