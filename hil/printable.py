r"""Text that others wrote, on its way to a terminal: what would command the terminal is shown instead.

A serial number, a column or a file's name can hold an escape sequence that sets a title, hides a line or answers for
the user. The streams of a command show such characters as `\x1b`; new lines and tabs stay.
"""

from __future__ import annotations

import codecs
import json
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from typing import IO, Any

# Controls of ASCII and of Latin-1, and marks that turn the direction of writing; "\r\n" ends a row of CSV.
_COMMANDS = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]|\r(?!\n)")


def printable(text: str) -> str:
    """A text with what would command a terminal shown as escapes."""
    return _COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def _escaped(error: UnicodeError) -> tuple[str, int]:
    """What a stream's encoding does not have, as JSON escapes it: words stay readable, and JSON stays JSON."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return json.dumps(error.object[error.start : error.end])[1:-1], error.end


codecs.register_error("hil.escaped", _escaped)


class Printable:
    """A stream on which texts are shown, and nothing commands the terminal. All else is the stream's own.

    Attributes:
        raw: the stream, for what draws on the terminal by itself.
    """

    def __init__(self, raw: IO[str]) -> None:
        self.raw = raw

    def write(self, text: str) -> int:
        """Write a text as it can be shown."""
        with self._named():
            self.raw.write(printable(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        """Write texts as they can be shown."""
        with self._named():
            self.raw.writelines(map(printable, lines))

    def flush(self) -> None:
        """Hand on what is kept back."""
        with self._named():
            self.raw.flush()

    @contextmanager
    def _named(self) -> Iterator[None]:
        """An error of the system names the stream."""
        try:
            yield
        except OSError as error:
            error.filename = error.filename or self.raw.name
            raise

    def __iter__(self) -> Iterator[str]:
        return iter(self.raw)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.raw, name)


@contextmanager
def printable_streams() -> Iterator[None]:
    """What is printed while this lasts commands no terminal."""
    before = sys.stdout, sys.stderr
    for stream in before:
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="hil.escaped")
    sys.stdout, sys.stderr = (Printable(stream) if stream else stream for stream in before)  # type: ignore[assignment]
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def raw(stream: IO[str]) -> IO[str]:
    """The stream itself."""
    return stream.raw if isinstance(stream, Printable) else stream
