r"""Text that others wrote, on its way to a terminal: what would command the terminal is shown instead.

A serial number, a column or a file's name can hold an escape sequence that sets a title, hides a line or answers for
the user. The streams of a command show such characters as `\x1b`; new lines and tabs stay.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

# Controls of ASCII and of Latin-1, and marks that turn the direction of writing; "\r\n" ends a row of CSV.
_COMMANDS = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]|\r(?!\n)")


def printable(text: str) -> str:
    """A text with what would command a terminal shown as escapes."""
    return _COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


class Printable:
    """A stream on which texts are shown, and nothing commands the terminal. All else is the stream's own.

    Attributes:
        raw: the stream, for what draws on the terminal by itself.
    """

    def __init__(self, raw: IO[str]) -> None:
        self.raw = raw

    def write(self, text: str) -> int:
        """Write a text as it can be shown."""
        self.raw.write(printable(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        """Write texts as they can be shown."""
        self.raw.writelines(map(printable, lines))

    def __iter__(self) -> Iterator[str]:
        return iter(self.raw)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.raw, name)


@contextmanager
def printable_streams() -> Iterator[None]:
    """What is printed while this lasts commands no terminal."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (Printable(stream) if stream else stream for stream in before)  # type: ignore[assignment]
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def raw(stream: IO[str]) -> IO[str]:
    """The stream itself."""
    return stream.raw if isinstance(stream, Printable) else stream
