"""What pydantic found, in words for somebody at a bench."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from hil.bench.fault import Fault
from hil.bench.lines import Place

_SHAPES = {
    "dict_type": "a table", "model_type": "a table", "tuple_type": "a list", "list_type": "a list",
}  # fmt: skip


def described(error: ValidationError, kind: Any, above: Place = ()) -> list[Fault]:
    """Every error as a fault, for a value of type `kind` at the place `above`."""
    return [Fault((*above, *found["loc"]), _sentence(dict(found), kind)) for found in error.errors()]


def _sentence(found: dict[str, Any], kind: Any) -> str:
    if found["type"] == "missing":
        return "is missing"
    if found["type"] == "extra_forbidden":
        return _unknown(str(found["loc"][-1]), _fields(kind, found["loc"][:-1]))
    if shape := _SHAPES.get(found["type"]):
        return _found(shape, found["input"])
    text = found["msg"].removeprefix("Value error, ")
    shown = "" if found["type"] == "value_error" else f"; found {found['input']!r:.40}"
    return f"{text[0].lower()}{text[1:]}{shown}"


def _found(wanted: str, content: Any) -> str:
    return f"input should be {wanted}; found {content!r:.40}"


def misread(content: Any, value: Any, place: Place) -> Iterator[Fault]:
    """Where a value of a file was read as something else: true as 1, a number as a date, or a number that is none.

    Args:
        content: what the file says.
        value: what pydantic made of it.
        place: of it.
    """
    for key, part, made in _parts(content, value):
        yield from misread(part, made, (*place, key))
    if isinstance(value, float) and not math.isfinite(value):
        yield Fault(place, _found("a finite number", content))
    elif isinstance(content, bool) and isinstance(value, int | float) and not isinstance(value, bool):
        yield Fault(place, _found("a number", content))
    elif isinstance(content, int | float) and isinstance(value, dt.date):
        yield Fault(place, _found("a date, such as 2026-03-02", content))


def _parts(content: Any, value: Any) -> Iterable[tuple[int | str, Any, Any]]:
    if isinstance(content, Mapping):
        made = value if isinstance(value, Mapping) else {key: getattr(value, key, None) for key in content}
        return ((key, part, made.get(key)) for key, part in content.items())
    if isinstance(content, list | tuple) and isinstance(value, list | tuple):
        return ((i, part, made) for i, (part, made) in enumerate(zip(content, value, strict=False)))
    return ()


def _unknown(key: str, known: list[str]) -> str:
    close = get_close_matches(key, known, n=1)
    hint = f"; did you mean '{close[0]}'?" if close else ""
    return f"is not known here{hint or ';'} there are: {', '.join(known)}"


def _fields(kind: Any, place: tuple[int | str, ...]) -> list[str]:
    """Names of the fields of the model that stands at a place below a type."""
    models = _models(kind)
    for key in place:
        below = [model.model_fields[str(key)].annotation for model in models if str(key) in model.model_fields]
        models = [found for annotation in below for found in _models(annotation)] or models
    return [name for model in models for name in model.model_fields]


def _models(kind: Any) -> list[type[BaseModel]]:
    """The models in an annotation: itself, or what an optional, a list or a table holds."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [model for argument in get_args(kind) for model in _models(argument)]
