"""A device that answers lines of text, as its description says, with a plant behind its terminals."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

from hil.description.text import ENDS, HOLE, TIMES, TextDescription, TextTerminal
from sim_devices._field import Side, nearest_zero
from sim_devices._lines_of_text import TextDevice

_REFUSED = '-222,"Data out of range"'
_UNKNOWN = '-113,"Undefined header"'
_DIGITS = r"[-+]?[0-9.,]+(?:[eE][-+]?[0-9]+)?"


class DescribedText(TextDevice):
    """What a description says: outputs that are told, inputs that are asked, an error query, a watchdog.

    To a line that it does not know it says nothing; where there is an error query, that says so. When its watchdog
    expires, outputs go where the description, the setting at the device or an earlier line says.
    """

    def __init__(self, side: Side, description: TextDescription, settings: Mapping[str, Any]) -> None:
        super().__init__(side)
        self._description, self._whole = description, description.by_name
        self.end = ENDS[description.text.end].encode("ascii")
        self._answer_end = ENDS[description.text.answer_end or description.text.end].encode("ascii")
        self._errors: list[str] = []
        watchdog = description.watchdog
        self._set_s = settings.get("watchdog_s") if watchdog is not None and not watchdog.arm else None
        self._level = settings.get("watchdog_level")
        self._armed_s: float | None = None
        self._safe: dict[str, float] = {}

    def answer(self, request: bytes) -> bytes:
        """The answer to one line, with the end that answers have."""
        answer = super().answer(request)
        return answer.removesuffix(self.end) + self._answer_end if answer else b""

    def answer_to(self, request: str) -> str | None:
        """What the description says comes back."""
        self.heard_s = self.side.clock.now_s
        line, talk = request.strip(), self._description.text
        if talk.hello and line == talk.hello:
            return self._whole_line(talk.identity)
        if talk.errors and line == talk.errors:
            return self._errors.pop(0) if self._errors else self._whole_line(talk.no_error, 0.0)
        try:
            answer = self.known(line)
        except ValueError:
            self._errors.append(_REFUSED)
            return None
        if answer is None:
            self._errors.append(_UNKNOWN)
        return answer or None

    def known(self, line: str) -> str | None:
        """The answer to a line of the description, empty for none; None to any other line.

        Raises:
            ValueError: a value that the output does not take.
        """
        if line in self._description.text.setup:
            return ""
        return next(
            (answer for known in (self._armed, self._set, self._asked) if (answer := known(line)) is not None), None
        )

    def restart(self) -> None:
        """Outputs at zero or as near as they come; nothing armed."""
        self._armed_s, self._errors = None, []
        self._safe.clear()
        for name, terminal in self._outputs():
            self.side.drive({name: nearest_zero(*terminal.range)})

    def tick(self) -> None:
        """Outputs go where the watchdog puts them when nothing came for its time."""
        time_s = self._set_s if self._set_s is not None else self._armed_s
        if time_s is not None and self.side.clock.now_s - self.heard_s > time_s:
            for name, terminal in self._outputs():
                at = self._safe_level(name, terminal)
                if self.side.standing(name) != at:
                    self.side.drive({name: at})

    def _outputs(self) -> Iterator[tuple[str, TextTerminal]]:
        return ((name, terminal) for name, terminal in self._whole.items() if terminal.direction == "out")

    def _safe_level(self, name: str, terminal: TextTerminal) -> float:
        if self._level is not None:
            return float(self._level)
        expires_to = self._description.watchdog.expires_to if self._description.watchdog else None
        return self._safe.get(name, nearest_zero(*terminal.range) if expires_to is None else expires_to)

    def _armed(self, line: str) -> str | None:
        """A line of the watchdog; None when it is none of them."""
        watchdog = self._description.watchdog
        for template in watchdog.arm if watchdog else ():
            if (found := self._found(template, line)) is None:
                continue
            for name, number in found:
                if name in TIMES:
                    self._armed_s = number / TIMES[name] or None
                elif name.startswith("safe:"):
                    self._safe[name[5:]] = self._whole[name[5:]].value_at(number)
            return self._whole_line(watchdog.reply) if watchdog else None
        return None

    def _set(self, line: str) -> str | None:
        for name, terminal in self._outputs():
            if (found := self._found(terminal.tell, line)) is None:
                continue
            value = terminal.value_at(dict(found)["value"])
            low, high = terminal.range
            if not low - 1e-9 <= value <= high + 1e-9:
                raise ValueError(f"{value} is beyond its range")
            self.side.drive({name: value})
            return self._whole_line(terminal.reply)
        return None

    def _asked(self, line: str) -> str | None:
        sharing = [(name, terminal) for name, terminal in self._whole.items() if terminal.ask and terminal.ask == line]
        if not sharing:
            return None
        parts = {terminal.field or 0: self._answer_part(name, terminal) for name, terminal in sharing}
        return self._description.text.separator.join(parts.get(i, "0") for i in range(max(parts) + 1))

    def _answer_part(self, name: str, terminal: TextTerminal) -> str:
        readings = {} if terminal.direction == "out" else self.side.read()
        value = self.side.standing(name) if terminal.direction == "out" else readings.get(name, 0.0)
        return self._whole_line(terminal.answer, terminal.raw_at(value))

    def _whole_line(self, template: str, value: float = 0.0) -> str:
        """A template with its holes filled."""
        return HOLE.sub(lambda hole: self._number(value, hole[2]) if hole[1] == "value" else "x", template)

    def _number(self, value: float, form: str | None) -> str:
        talk = self._description.text
        if math.isnan(value):
            return talk.no_measurement[0] if talk.no_measurement else "9.91E37"
        return format(value, form or ".9g").replace(".", talk.decimal)

    def _found(self, template: str, line: str) -> list[tuple[str, float]] | None:
        """The numbers of a line, by hole; None when it is another line."""
        holes = [hole[1] for hole in HOLE.finditer(template)]
        pattern, at = "", 0
        for hole in HOLE.finditer(template):
            number = "([0-9A-Fa-f]+)" if (hole[2] or "")[-1:] in ("x", "X") else f"({_DIGITS})"
            pattern += re.escape(template[at : hole.start()]) + number
            at = hole.end()
        found = re.fullmatch(pattern + re.escape(template[at:]), line)
        if found is None:
            return None
        try:
            return [(name, float(text.replace(self._description.text.decimal, "."))) for name, text in
                    zip(holes, found.groups(), strict=True)]  # fmt: skip
        except ValueError:
            return None
