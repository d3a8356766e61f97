"""Lines that somebody types, taken without waiting for them: outputs are held meanwhile."""

from __future__ import annotations

import os
import select
import sys

from hil.errors import SettingError


class Typed:
    """Standard input, line by line."""

    def __init__(self) -> None:
        self._left = b""

    def line(self) -> str | None:
        """The next line without its end, None while nobody has typed it.

        Raises:
            SettingError: there are no more: the input ended.
        """
        while b"\n" not in self._left:
            try:
                place = sys.stdin.fileno()
                if not select.select([place], [], [], 0.0)[0]:
                    return None
                more = os.read(place, 4096)
            except (AttributeError, OSError, ValueError):  # no file of the system: what is there is there at once
                more = (sys.stdin.readline() if sys.stdin else "").encode()
            if not more:
                raise SettingError("the input ended before every question was answered; nothing was written")
            self._left += more
        line, _, self._left = self._left.partition(b"\n")
        return line.decode(errors="replace").strip()

    def waited(self) -> str:
        """The next line, waited for."""
        while (line := self.line()) is None:
            select.select([sys.stdin], [], [])
        return line
