"""Names of the code as words of a page, and words as identifiers."""

from __future__ import annotations

import re
from collections.abc import Iterable

from hil.language.words import ENGLISH, _, spoken
from hil.report.number import label_text, unit_text
from hil.units import split_unit


def words(name: str) -> str:
    """`fluid temperature [°C]` from `fluid_temperature_c`."""
    text, unit = split_unit(name)
    return f"{text} [{unit_text(unit)}]" if unit else text


def quantity_words(name: str) -> str:
    """`bandwidth 3 dB` from `bandwidth_3db`, `ISO 10770-1` from `iso_10770_1`."""
    text = re.sub(r"\biso (\d+) (\d+)\b", r"ISO \1-\2", name.replace("_", " "))
    for ending, unit in (("db", " dB"), ("deg", "°"), ("hz", " Hz")):
        text = re.sub(rf"(?<=\d){ending}\b", unit, text)
    return re.sub(r"\b(thd|efc)\b", lambda found: found[0].upper(), text)


def value_words(name: str) -> str:
    """`dead time, 0 → 80 %` from `dead_time, 0 → 80 %`, in the language that is spoken."""
    quantity, comma, place = name.partition(", ")
    return f"{_(quantity_words(quantity))}{comma}{label_text(place)}"


def picture_name(*texts: str) -> str:
    """A name for a picture that an identifier may hold."""
    return re.sub(r"[^A-Za-z0-9]+", "-", "-".join(texts)).strip("-").lower() or "picture"


def short_name(path: str) -> str:
    """The last part of a path."""
    return path.replace("\\", "/").rstrip("/").rsplit("/", 1)[-1] or path


def short_names(paths: Iterable[str]) -> dict[str, str]:
    """Paths by their last part, as long as that tells them apart."""
    paths = list(paths)
    last = [short_name(path) for path in paths]
    return dict(zip(paths, last if len(set(last)) == len(set(paths)) else paths, strict=True))


def within(label: str) -> str:
    """A label as it stands within a sentence: small in English; in other languages as its catalogue has it."""
    return label.lower() if spoken() == ENGLISH else label


def capital(text: str) -> str:
    """The text with its first letter large, the others as they are."""
    return text[:1].upper() + text[1:]
