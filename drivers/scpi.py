"""SCPI instruments on a serial line or socket: sources and meters; every command is acknowledged by the error queue.

Common commands and the error queue are those of IEEE 488.2 and SCPI; what an instrument is told and asked says its
description.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal

from pydantic import ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._edge import edge
from drivers._line import Line, answering
from drivers._meeting import OnALine
from drivers._templates import Numbers, filled, matched, remedy
from hil.daq.channel import Terminal, Wiring
from hil.description.named import Described, description_faults, description_of, ports_of
from hil.description.text import ENDS, TextTerminal
from hil.errors import LinkError

_RESOLUTION = 1e-3  # of what is set, in its unit; coarser instruments say `step`
_UNIT = re.compile(r'(?:"(?:[^"]|"")*"|[^;"])+')  # up to a semicolon that no text has in it
_ERROR = re.compile(r'\s*([+-]?\d+)\s*,\s*"(.*)"\s*')
PROBES = "scpi"


class Settings(Described):
    """What `[devices.NAME]` may say.

    Attributes:
        model, description: which instrument, see `hil.description.named`.
        address: a serial port, `socket://host:port`, or `rfc2217://host:port`.
        baud: of a serial port.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure nothing is asked for so long, so that a late answer passes.
        end: of what is sent: `LF`, `CRLF` or `CR`; answers may end with CR LF where LF is said.
        step: in which outputs are set, in their unit, where the instrument has no finer ones.
        echo: what is sent comes back before the answer.
        pause_s: so long nothing is asked after an answer.
        startup_s: at opening the device is waited for so long, where it answers only after a start-up of its own.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str
    baud: PositiveInt = 115200
    timeout_s: PositiveFloat = 0.5
    longest_reply_s: PositiveFloat = 2.0
    end: Literal["LF", "CRLF", "CR"] = "LF"
    step: float = Field(default=0.0, ge=0.0)
    echo: bool = False
    pause_s: float = Field(default=0.0, ge=0.0, le=1.0)
    startup_s: float = Field(default=0.0, ge=0.0, le=300.0)


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from description_faults(settings, "scpi")
    if settings.longest_reply_s < settings.timeout_s:
        yield ("longest_reply_s",), f"must not be shorter than timeout_s = {settings.timeout_s:g}"


def probe() -> Any:
    """Who is on such a line (see `hil.daq.probe`)."""
    from drivers import _probe_scpi

    return _probe_scpi


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Those of the description; none while it has faults."""
    return ports_of(settings, "scpi")


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("serial",)


def not_read_back(settings: Settings) -> set[str]:
    """Outputs that cannot be asked where they stand."""
    return description_of(settings, "scpi").not_read_back


def open_link(settings: Settings, wiring: Wiring) -> ScpiLink:
    """The instrument, identified, its error queue empty."""
    return ScpiLink(settings, wiring)


@edge
class ScpiLink(OnALine):
    """An instrument that speaks SCPI (see `hil.daq.link.Link`). It has no watchdog.

    Every message ends with `SYST:ERR?`, so that each has an answer, and one that says whether it was understood.

    Attributes:
        identity: maker, model, serial number and version as `*IDN?` tells them.

    Raises:
        LinkError: what answers is no SCPI instrument.
    """

    _line: Line

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        self._settings, description = settings, description_of(settings, "scpi")
        self._talk = description.text
        self._written = Numbers(description.text.decimal, description.text.no_measurement)
        self._outputs = {c.terminal: description.whole[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: description.whole[c.terminal] for c in wiring.inputs.values()}
        self._why_moved = f"{self._why_moved}, or it sets in steps: then say step (now {settings.step:g})"
        super().__init__(wiring, close=dict.fromkeys(self._outputs, max(_RESOLUTION, settings.step)))
        self._open()

    def standing(self) -> dict[str, float]:
        """Where the outputs stand, as the instrument tells."""
        stands = self._numbers({name: output for name, output in self._outputs.items() if output.ask})
        if not all(map(math.isfinite, stands.values())):
            raise self._line.failed(f"no number in where outputs stand: {list(stands.values())}")
        return stands

    def close(self) -> None:
        """Close the line."""
        self._line.close()

    def _identified(self) -> str:
        end = ENDS[self._settings.end]
        self._line = answering(self._settings, self._wiring, self._talk, "*CLS;*IDN?", end, driver="scpi")
        return self.identity

    def _recognise(self, identity: str) -> None:
        if not identity and self._wiring.only_safe:
            return
        if identity.count(",") != 3:
            raise LinkError(f"'{identity}' is not the identity of a SCPI instrument (maker,model,serial,version)")
        if matched(self._talk.identity, identity, self._written) is None:
            raise LinkError(f"it says that it is '{identity}', not '{self._talk.identity}'")

    def _make_ready(self) -> None:
        if self._talk.setup:
            self._asked(list(self._talk.setup))

    def _tell_blindly(self, values: Mapping[str, float]) -> None:
        self._line.tell(";:".join(self._lines_of(values)))

    def _put(self, values: Mapping[str, float]) -> Iterable[tuple[str, float]]:
        """In one message; the instrument says whether it has taken it."""
        self._asked(self._lines_of(values))
        return values.items()

    def _measured(self) -> dict[str, float]:
        """In one message; an overload is infinite."""
        readings = self._numbers(self._inputs)
        self.unmeasured = {name: f"the instrument answers {self._answers[self._inputs[name].ask]}"
                           for name, value in readings.items() if math.isnan(value)}  # fmt: skip
        return readings

    def _lines_of(self, values: Mapping[str, float]) -> list[str]:
        places = ((self._outputs[name], value) for name, value in values.items())
        return [filled(o.tell, self._written, value=(value - o.offset) / o.slope) for o, value in places]

    def _numbers(self, places: Mapping[str, TextTerminal]) -> dict[str, float]:
        """The values of terminals, asked in one message; those that share a question ask it once."""
        queries = list(dict.fromkeys(place.ask for place in places.values()))
        texts = self._asked(queries)
        if len(texts) != len(queries):
            raise self._line.failed(f"{len(texts)} answers to {len(queries)} questions: {';'.join(texts)}")
        answers = self._answers = dict(zip(queries, texts, strict=True))
        numbers = {name: self._number_in(answers[place.ask], place) for name, place in places.items()}
        for name, number in numbers.items():
            if number is None:
                text, place = answers[places[name].ask], places[name]
                hint = remedy(text, self._written)
                raise self._line.failed(f"{text!r} is no answer to {place.ask}; it should be '{place.answer}'{hint}")
        return {name: places[name].slope * number + places[name].offset
                for name, number in numbers.items() if number is not None}  # fmt: skip

    def _number_in(self, text: str, place: TextTerminal) -> float | None:
        fields = [text] if place.field is None else text.split(",")
        at = place.field or 0
        return matched(place.answer, fields[at], self._written) if at < len(fields) else None

    def _asked(self, messages: list[str]) -> list[str]:
        """The answers to messages that are sent together; an error of the instrument is raised."""
        answer = self._line.ask(";:".join([*messages, "SYST:ERR?"]))
        *texts, error = _UNIT.findall(answer) or [""]
        found = _ERROR.fullmatch(error)
        if found is None:
            raise self._line.failed(f"{error!r} is not an entry of the error queue")
        if int(found[1]) != 0:
            self._line.tell("*CLS")
            raise LinkError(f"the instrument refused {';'.join(messages)}: {found[1]} {found[2]}")
        return texts
