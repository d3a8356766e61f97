"""Texts of pages in the language that is spoken: English as written in the code, others from gettext catalogues.

A text is marked where it is said: `_("Verdict")`. In a table that is made at import it is marked with `marked` and
said with `_` later. What is put into a text stands in it by name, `_("{n} more").format(n=3)`, since another language
has another order. Every `.mo` file of a language is read: a room that says much has a catalogue of its own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from gettext import GNUTranslations
from importlib.resources import files
from typing import TYPE_CHECKING, TypeVar

from hil.errors import SettingError

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

ENGLISH = "en"
_LEADING = re.compile(r"^[^\W\d_]+(?: [^\W\d_]+)*(?=$| \W?\d)")
_Text = TypeVar("_Text", bound=str)
_spoken: ContextVar[str] = ContextVar("language", default=ENGLISH)


def _(text: str) -> str:
    """The text in the language that is spoken; as it is, where its catalogues do not have it."""
    if _spoken.get() == ENGLISH or not text:
        return text
    return _found(_spoken.get(), text) or text


def plural(one: str, many: str, count: int) -> str:
    """The form of a text that goes with a number."""
    if _spoken.get() != ENGLISH:
        for catalogue in _catalogues(_spoken.get()):
            message = catalogue.ngettext(one, many, count)
            if message not in (one, many):
                return message
    return one if count == 1 else many


def marked(text: _Text) -> _Text:
    """The text itself, for the catalogues; `_` says it in the language of a page."""
    return text


def place_words(place: str) -> str:
    """`Versorgung 50 bar` from `supply 50 bar`: words before numbers are translated; numbers and units stay."""
    return ", ".join(_LEADING.sub(lambda found: _(found[0]), part) for part in place.split(", "))


def spoken() -> str:
    """The language that is spoken, as `de`."""
    return _spoken.get()


@contextmanager
def speaking(language: str) -> Iterator[None]:
    """Speak a language while the context lasts, in this thread or task alone.

    Raises:
        SettingError: there are no catalogues of it.
    """
    if language not in languages():
        raise SettingError(f"language '{language}': {', '.join(languages())} are spoken")
    before = _spoken.set(language)
    try:
        yield
    finally:
        _spoken.reset(before)


@cache
def languages() -> tuple[str, ...]:
    """Languages that are spoken: English, and those that have catalogues."""
    return (ENGLISH, *sorted(entry.name for entry in _rooms().iterdir() if entry.is_dir()))


def _found(language: str, text: str) -> str:
    found = (catalogue.gettext(text) for catalogue in _catalogues(language))
    return next((message for message in found if message != text), "")


@cache
def _catalogues(language: str) -> tuple[GNUTranslations, ...]:
    folder = _rooms() / language / "LC_MESSAGES"
    return tuple(_read(entry) for entry in sorted(folder.iterdir(), key=lambda e: e.name) if entry.name.endswith(".mo"))


def _read(entry: Traversable) -> GNUTranslations:
    with entry.open("rb") as file:
        return GNUTranslations(file)  # type: ignore[arg-type]


def _rooms() -> Traversable:
    return files("hil.language").joinpath("catalogues")
