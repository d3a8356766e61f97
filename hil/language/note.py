"""Notes: sentences kept as a code and values. Printed and stored they are English; a page has them in its language."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from string import Formatter
from typing import Any

from hil.language.figures import localised
from hil.language.words import ENGLISH, _, place_words, spoken

OF = "{recording}: {note}"
_AT = "{place!l}: {note}"
_PLACE = re.compile(r"\{(\w+)(?:![cl])?(?::(?:[+]?\.?\d?[a-z]?|[;,] |[%?]))?\}")


class Note(str):
    """A sentence with values in it; as text it is English.

    The code is the English template, as everywhere in the catalogues: `Note("Coil at {was_c:.3g} °C.", was_c=21.0)`.
    Numbers are written by the format in their place. A text stands as it is, with `!l` as a label whose numbers get the
    decimal sign, with `!c` with a large first letter. A note among the values is translated too; a tuple is a list,
    separated as its place says, `{names:; }`.

    Attributes:
        code: the template.
        values: by the names of their places.
    """

    code: str
    values: Mapping[str, Any]

    def __new__(cls, code: str, **values: Any) -> Note:  # noqa: D102
        made = super().__new__(cls, _TEXT.vformat(code, (), values) if values else code)
        made.code, made.values = code, {name: _plain(value) for name, value in values.items()}
        return made

    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]:
        return (self.code,), dict(self.values)

    def at(self, place: str) -> Note:
        """The same, after the place that it is about: `0 → 80 %: noise alone …`."""
        return Note(_AT, place=place, note=self)

    def of(self, recording: str) -> Note:
        """The same, after the name of the recording that it is about, which stays as it is."""
        return Note(OF, recording=recording, note=self)

    @property
    def stopped(self) -> Note:
        """The same with a full stop."""
        return Note("{note}.", note=self)

    def changed(self, change: Callable[[str], str]) -> Note:
        """The same with every text among its values changed."""
        return Note(self.code, **{name: _changed(value, change) for name, value in self.values.items()})

    @property
    def translated(self) -> str:
        """In the language that is spoken."""
        if spoken() == ENGLISH:
            return str(self)
        return _PAGE.vformat(_(self.code), (), self.values) if self.values else _(self.code)

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return {"code": self.code, "values": {name: _as_json(value) for name, value in self.values.items()}}


def changed(text: str, change: Callable[[str], str]) -> str:
    """A text, and all texts among the values of a note, changed: a label that gets another name."""
    return text.changed(change) if isinstance(text, Note) else change(text)


def translated(text: str) -> str:
    """A note in the language that is spoken; any other text, a stranger's procedure has it, as it is."""
    return text.translated if isinstance(text, Note) else text


def error_text(error: BaseException) -> str:
    """What an error says, in the language that is spoken."""
    first = error.args[0] if error.args else None
    return first.translated if isinstance(first, Note) else str(error)


def codes_of(texts: Iterable[str]) -> dict[str, Any]:
    """What notes among texts are made of, by their text: stored beside the texts."""
    return {str(text): text.as_dict() for text in texts if isinstance(text, Note)}


def revived(texts: Iterable[str], codes: Any) -> tuple[str, ...]:
    """Texts that were stored, as notes again where `codes` say what they are made of."""
    known = codes if isinstance(codes, Mapping) else {}
    return tuple(_revived(text, known.get(text)) for text in texts)


def _revived(text: str, made_of: Any) -> str:
    """The note, if it says what the text says: a file is not believed."""
    try:
        note = _note(made_of)
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError):
        return text
    return note if note == text else text


def _note(made_of: Any) -> Note:
    code, values = made_of["code"], made_of["values"]
    if re.search(r"[{}]", _PLACE.sub("", code)):
        raise ValueError(code)
    return Note(code, **{name: _value(value) for name, value in values.items()})


def _value(stored: Any) -> Any:
    if isinstance(stored, list):
        return tuple(map(_value, stored))
    return _note(stored) if isinstance(stored, Mapping) else stored


def _changed(value: Any, change: Callable[[str], str]) -> Any:
    if isinstance(value, tuple):
        return tuple(_changed(one, change) for one in value)
    return changed(value, change) if isinstance(value, str) else value


def _plain(value: Any) -> Any:
    """A number of numpy as one of Python."""
    return value.item() if hasattr(value, "item") else value


def _as_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(map(_as_json, value))
    return value.as_dict() if isinstance(value, Note) else value


class _Put(Formatter):
    """Puts values into a template, in English or in the language that is spoken."""

    def __init__(self, *, is_page: bool) -> None:
        self._is_page = is_page

    def get_field(self, field_name: str, _args: Any, kwargs: Any) -> Any:
        value = kwargs[field_name]
        is_place = self._is_page and field_name == "place" and isinstance(value, str)
        return place_words(value) if is_place else value, field_name

    def convert_field(self, value: Any, conversion: Any) -> Any:
        if conversion is None:
            return value
        text = self.format_field(value, "")
        return text[:1].upper() + text[1:] if conversion == "c" else localised(text) if self._is_page else text

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, tuple):
            return (format_spec or ", ").join(self.format_field(one, "") for one in value)
        if isinstance(value, Note):
            return value.translated if self._is_page else str(value)
        text = format(value, format_spec)
        return localised(text) if self._is_page and not isinstance(value, str) else text


_TEXT, _PAGE = _Put(is_page=False), _Put(is_page=True)
