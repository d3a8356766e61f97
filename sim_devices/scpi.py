"""SCPI instruments with an error queue and a plant behind their terminals; the twin of the driver."""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from hil.description.named import description_of
from hil.description.text import TextDescription
from sim_devices._described_text import DescribedText
from sim_devices._field import Side
from sim_devices._lines_of_text import TextDevice, serve_text
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer
from sim_devices._twin import Twin, TwinSettings, named_in, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]

_QUEUE = 20
_TEXTS = {
    -102: "Syntax error", -108: "Parameter not allowed", -109: "Missing parameter", -113: "Undefined header",
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


class Instrument(TextDevice):
    """What every instrument understands: the common commands of IEEE 488.2, the error queue. Subclasses add their own.

    The queue keeps the oldest errors; one too many takes the place of the last as −350. `*CLS` empties it, `*RST`
    does not. Every command is done before the next one is looked at, so that there is nothing to wait for.
    """

    model = ""

    def __init__(self, side: Side) -> None:
        super().__init__(side)
        self.errors: deque[int] = deque()
        self._events, self._enabled, self._requested = _POWER_ON, 0, 0

    def commands(self) -> Mapping[str, Callable[[str], str | None]]:
        """By header in its long form, the short one in capitals: what is done with the parameters."""
        return {}

    def answer_to(self, request: str) -> str | None:
        """All answers of a message, in one line; None when there is none."""
        answers: list[str] = []
        for unit in request.strip().split(";"):
            try:
                answer = self._done(unit.strip())
            except _Wrong as wrong:
                self._queue(wrong.code)
            else:
                answers += [] if answer is None else [answer]
        return ";".join(answers) or None

    def restart(self) -> None:
        """After power-on: outputs zero, no errors."""
        self.errors.clear()
        self._events, self._enabled, self._requested = _POWER_ON, 0, 0
        self.reset()

    def reset(self) -> None:
        """As `*RST`."""

    def _done(self, unit: str) -> str | None:
        if not unit:
            return None
        header, _, parameters = unit.lstrip(":").partition(" ")
        done_with = {**self._common(), **self.commands()}
        for pattern, done in done_with.items():
            if _is(header, pattern):
                return done(parameters.strip())
        raise _Wrong(-113)

    def _common(self) -> Mapping[str, Callable[[str], str | None]]:
        """What every instrument has to understand, by IEEE 488.2 and SCPI."""
        return {
            "*IDN?": _bare(lambda: f"valve-hil,{self.model},0,1.0"), "*CLS": _bare(self._clear),
            "*RST": _bare(self.reset), "*TST?": _bare(lambda: "0"), "*WAI": _bare(lambda: None),
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

    def measured(self, terminal: str) -> str:
        """A reading as SCPI writes it."""
        value = self.side.read().get(terminal, 0.0)
        return "9.91E37" if math.isnan(value) else f"{value:+.8E}"


class Scanner(Instrument):
    """Two outputs of ±12 V in slot 2, twenty inputs in slot 1."""

    model = "scanner"

    def commands(self) -> Mapping[str, Callable[[str], str | None]]:
        """Set and ask outputs, measure inputs."""
        return {"SOURce:VOLTage": self._set, "SOURce:VOLTage?": self._stands, "MEASure:VOLTage:DC?": self._measure}

    def reset(self) -> None:
        """Outputs zero."""
        self.side.drive({"dac4": 0.0, "dac5": 0.0})

    def _set(self, parameters: str) -> None:
        value, comma, channels = parameters.partition(",")
        if not comma:
            raise _Wrong(-109)
        volts = _number(value, -12.0, 12.0)
        self.side.drive({f"dac{n - 200}": volts for n in _channels(channels, range(204, 206))})

    def _stands(self, parameters: str) -> str:
        stands = [self.side.standing(f"dac{n - 200}") for n in _channels(parameters, range(204, 206))]
        return ",".join(f"{value:+.8E}" for value in stands)

    def _measure(self, parameters: str) -> str:
        return ",".join(self.measured(f"in{n - 100}") for n in _channels(parameters, range(101, 121)))


class Described(Instrument):
    """What a description says beside the common commands; headers in the form that stands there, long or short."""

    def __init__(self, side: Side, description: TextDescription) -> None:
        super().__init__(side)
        self._text = DescribedText(side, description, {})
        self._description = description

    def answer_to(self, request: str) -> str | None:
        """Message units one by one: those of the description, else the common commands."""
        answers = [self._one(unit.strip().lstrip(":")) for unit in request.strip().split(";")]
        return ";".join(answer for answer in answers if answer is not None) or None

    def reset(self) -> None:
        """Outputs as near zero as they come."""
        self._text.restart()

    def _one(self, unit: str) -> str | None:
        if unit == "*IDN?":
            given = self._description.text.identity
            return "valve-hil,described,0,1.0" if given == "{any}" else given.replace("{any}", "x")
        try:
            found = self._text.known(unit)
        except ValueError:
            self._queue(-222)
            return None
        return super().answer_to(unit) if found is None else found or None


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> StreamServer:
    """Serve the instrument where the driver will look for it."""
    if settings.get("model") == "scanner":
        return serve_text(Scanner, settings, side, behave)
    described = description_of(named_in(settings), "scpi")
    return serve_text(lambda terminals: Described(terminals, described), settings, side, behave)


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


def _channels(text: str, allowed: range) -> list[int]:
    found = re.fullmatch(r"\(@(\d{3}(?:,\d{3})*)\)", text.strip())
    if found is None:
        raise _Wrong(-109 if not text else -102)
    numbers = [int(number) for number in found[1].split(",")]
    if not all(number in allowed for number in numbers):
        raise _Wrong(-222)
    return numbers


_twin = Twin("scpi", serve, example="socket://127.0.0.1:5025", free="socket://127.0.0.1:0")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
