"""SCPI instruments with an error queue and a plant behind their terminals; the twin of the driver."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping

from hil.description.text import TextDescription
from sim_devices._described_text import DescribedText
from sim_devices._field import Side
from sim_devices._lines_of_text import serve_lines
from sim_devices._twin import described_in, offered

_QUEUE = 20
_TEXTS = {
    -108: "Parameter not allowed", -109: "Missing parameter", -113: "Undefined header",
    -121: "Invalid character in number", -222: "Data out of range", -350: "Queue overflow",
}  # fmt: skip


_EVENTS = {
    1: 1 << 5,
    2: 1 << 4,
    3: 1 << 3,
    4: 1 << 2,
}  # by the hundred of an error: of command, execution, device, query
_COMPLETE, _POWER_ON = 1 << 0, 1 << 7
_SUMMARY, _AVAILABLE = 1 << 5, 1 << 2  # of the status byte: an event that is enabled; an entry in the error queue


class _Wrong(Exception):
    """What goes into the error queue."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Instrument(DescribedText):
    """What its description says, and what every instrument understands: common commands of IEEE 488.2, the error queue.

    The queue keeps the oldest errors; one too many takes the place of the last as −350. `*CLS` empties it, `*RST`
    does not. Every command is done before the next one is looked at, so that there is nothing to wait for. Headers of
    the description are known in the form that stands there, long or short.
    """

    def __init__(self, side: Side, description: TextDescription) -> None:
        super().__init__(side, description, {})
        self.errors: deque[int] = deque()
        self._events, self._enabled, self._requested = _POWER_ON, 0, 0
        given = description.text.identity
        self._identity = "valve-hil,described,0,1.0" if given == "{any}" else given.replace("{any}", "x")

    def answer_to(self, request: str) -> str | None:
        """All answers of a message, in one line; None when there is none."""
        answers: list[str] = []
        for unit in request.strip().split(";"):
            try:
                answer = self._done(unit.strip().lstrip(":"))
            except _Wrong as wrong:
                self._queue(wrong.code)
            else:
                answers += [answer] if answer else []
        return ";".join(answers) or None

    def restart(self) -> None:
        """After power-on: outputs as near zero as they come, no errors."""
        self.errors.clear()
        self._events, self._enabled, self._requested = _POWER_ON, 0, 0
        super().restart()

    def _done(self, unit: str) -> str | None:
        if not unit:
            return None
        try:
            if (answer := self.known(unit)) is not None:
                return answer
        except ValueError:
            raise _Wrong(-222) from None
        header, _, parameters = unit.partition(" ")
        for pattern, done in self._common().items():
            if _is(header, pattern):
                return done(parameters.strip())
        raise _Wrong(-113)

    def _common(self) -> Mapping[str, Callable[[str], str | None]]:
        """What every instrument has to understand, by IEEE 488.2 and SCPI."""
        return {
            "*IDN?": _bare(lambda: self._identity), "*CLS": _bare(self._clear),
            "*RST": _bare(super().restart), "*TST?": _bare(lambda: "0"), "*WAI": _bare(lambda: None),
            "*OPC?": _bare(lambda: "1"), "*OPC": _bare(lambda: self._event(_COMPLETE)),
            "*ESR?": _bare(self._events_read), "*STB?": _bare(self._status),
            "*ESE": lambda text: setattr(self, "_enabled", _byte(text)), "*ESE?": _bare(lambda: str(self._enabled)),
            "*SRE": lambda text: setattr(self, "_requested", _byte(text)), "*SRE?": _bare(lambda: str(self._requested)),
            "SYSTem:ERRor?": _bare(self._next_error), "SYSTem:ERRor:NEXT?": _bare(self._next_error),
            "SYSTem:VERSion?": _bare(lambda: "1999.0"),
        }  # fmt: skip

    def _clear(self) -> None:
        self.errors.clear()
        self._events = 0

    def _event(self, event: int) -> None:
        self._events |= event

    def _events_read(self) -> str:
        """The event register, which is empty afterwards."""
        events, self._events = self._events, 0
        return str(events)

    def _status(self) -> str:
        status = (_SUMMARY if self._events & self._enabled else 0) | (_AVAILABLE if self.errors else 0)
        return str(status | (0x40 if status & self._requested else 0))

    def _next_error(self) -> str:
        code = self.errors.popleft() if self.errors else 0
        return f'{code:+d},"{_TEXTS[code]}"' if code else '+0,"No error"'

    def _queue(self, code: int) -> None:
        self._event(_EVENTS.get(-code // 100, 0))
        if len(self.errors) < _QUEUE:
            self.errors.append(code)
        else:
            self.errors[-1] = -350


def _bare(done: Callable[[], str | None]) -> Callable[[str], str | None]:
    """A command that takes no parameters."""

    def without(parameters: str) -> str | None:
        if parameters:
            raise _Wrong(-108)
        return done()

    return without


def _byte(text: str) -> int:
    return round(_number(text, 0.0, 255.0))


def _is(header: str, pattern: str) -> bool:
    """Whether a header is a pattern's, each word in its long or its short form."""
    words, forms = header.split(":"), pattern.split(":")
    return len(words) == len(forms) and all(
        word.upper() in (form.upper(), re.sub("[a-z]", "", form)) for word, form in zip(words, forms, strict=True)
    )


def _number(text: str, low: float, high: float) -> float:
    if not text.strip():
        raise _Wrong(-109)
    if not re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?\s*", text):
        raise _Wrong(-121)
    value = float(text)
    if not low <= value <= high:
        raise _Wrong(-222)
    return value


Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "scpi", serve_lines, lambda settings, side: Instrument(side, described_in(settings, "scpi")), "socket://127.0.0.1:0"
)
