"""Sentences that other rooms say in English, with values in them, in the language that is spoken."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import cache

from hil.language.figures import localised
from hil.language.words import ENGLISH, _, spoken


def reworded(
    sentence: str, templates: Iterable[str], put: Callable[[str, str], str] = lambda _place, text: localised(text)
) -> str:
    """A sentence in the language that is spoken; as it is where neither a template nor a catalogue has it.

    Args:
        sentence: in English, `stale: nothing new for 13.1 s`.
        templates: what it may have been made of, marked for the catalogues: `stale: nothing new for {time}`. The first
            that fits is taken; what stands in its places is handed on, numbers with the decimal sign.
        put: what to hand on of a place, by its name, and of what stands there.
    """
    if spoken() == ENGLISH:
        return sentence
    for template in templates:
        if found := _pattern(template).fullmatch(sentence):
            return _(template).format(**{name: put(name, text) for name, text in found.groupdict().items()})
    return _(sentence)


@cache
def _pattern(template: str) -> re.Pattern[str]:
    parts = re.split(r"\{(\w+)\}", template)
    return re.compile("".join(f"(?P<{part}>.+?)" if i % 2 else re.escape(part) for i, part in enumerate(parts)))
