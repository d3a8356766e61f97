"""SCPI instruments on a serial line, socket or VISA: sources and meters; the error queue acknowledges every command.

Common commands and the error queue are those of IEEE 488.2 and SCPI; what an instrument is told and asked says its
description.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import Field, PositiveFloat, PositiveInt

from drivers._described import ByDescription
from drivers._edge import edge
from drivers._line import SerialSettings, answering, needed_for
from drivers._templates import matched
from drivers._text_link import SpokenLink
from hil.daq.channel import Wiring
from hil.description.text import ENDS, End, TextTerminal
from hil.errors import LinkError

_RESOLUTION = 1e-3  # of what is set, in its unit; coarser instruments say `step`
_UNIT = re.compile(r'(?:"(?:[^"]|"")*"|[^;"])+')  # up to a semicolon that no text has in it
_ERROR = re.compile(r'\s*([+-]?\d+)\s*,\s*"(.*)"\s*')
PROBES = "scpi"
DEVICES = ByDescription("scpi")
faults, terminals, not_read_back = DEVICES.faults, DEVICES.terminals, DEVICES.not_read_back


class Settings(SerialSettings):
    """What `[devices.NAME]` may say.

    Attributes:
        end: of what is sent: `LF`, `CRLF` or `CR`; answers may end with CR LF where LF is said.
        step: in which outputs are set, in their unit, where the instrument has no finer ones.
        startup_s: at opening the device is waited for so long, where it answers only after a start-up of its own.
    """

    baud: PositiveInt = 115200
    longest_reply_s: PositiveFloat = 2.0
    end: End = "LF"
    step: float = Field(default=0.0, ge=0.0)
    startup_s: float = Field(default=0.0, ge=0.0, le=300.0)


def probe() -> Any:
    """Who is on such a line (see `hil.daq.probe`)."""
    from drivers import _probe_scpi

    return _probe_scpi


def needs(settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return needed_for(settings)


def open_link(settings: Settings, wiring: Wiring) -> ScpiLink:
    """The instrument, identified, its error queue empty."""
    return ScpiLink(settings, wiring)


@edge
class ScpiLink(SpokenLink):
    """An instrument that speaks SCPI (see `hil.daq.link.Link`). It has no watchdog.

    Every message ends with `SYST:ERR?`, so that each has an answer, and one that says whether it was understood.

    Attributes:
        identity: maker, model, serial number and version as `*IDN?` tells them.

    Raises:
        LinkError: what answers is no SCPI instrument.
    """

    devices = DEVICES
    _settings: Settings

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        self._why_moved = f"{self._why_moved}, or it sets in steps: then say step (now {settings.step:g})"
        super().__init__(settings, wiring, close=max(_RESOLUTION, settings.step))

    def _identified(self) -> str:
        end = ENDS[self._settings.end]
        self.line = answering(self._settings, self._wiring, self._talk, "*CLS;*IDN?", end, driver="scpi")
        return self.identity

    def _recognise(self, identity: str) -> None:
        if not identity and self._wiring.only_safe:
            return
        if identity.count(",") != 3:
            raise LinkError(f"'{identity}' is not the identity of a SCPI instrument (maker,model,serial,version)")
        if matched(self._talk.identity, identity, self._numbers) is None:
            raise LinkError(f"it says that it is '{identity}', not '{self._talk.identity}'")

    def _make_ready(self) -> None:
        if self._talk.setup:
            self._done(list(self._talk.setup))

    def _tell_blindly(self, values: Mapping[str, float]) -> None:
        self.line.tell(";:".join(self._lines_of(values)))

    def _put(self, values: Mapping[str, float]) -> Iterable[tuple[str, float]]:
        """In one message; the instrument says whether it has taken it."""
        self._done(self._lines_of(values))
        return values.items()

    def _measured(self) -> dict[str, float]:
        """In one message; an overload is infinite."""
        readings = self._asked(self._inputs)
        self.invalid_reasons = {name: f"the instrument answers {self._answers[self._inputs[name].ask]}"
                           for name, value in readings.items() if math.isnan(value)}  # fmt: skip
        return readings

    def _lines_of(self, values: Mapping[str, float]) -> list[str]:
        return [self._line_of(name, value) for name, value in values.items()]

    def _asked(self, terminals: Mapping[str, TextTerminal]) -> dict[str, float]:
        """In one message."""
        queries = list(dict.fromkeys(terminal.ask for terminal in terminals.values()))
        texts = self._done(queries)
        if len(texts) != len(queries):
            raise self.line.failed(f"{len(texts)} answers to {len(queries)} questions: {';'.join(texts)}")
        return self._values(terminals, dict(zip(queries, texts, strict=True)).__getitem__)

    def _done(self, messages: list[str]) -> list[str]:
        """The answers to messages that are sent together; an error of the instrument is raised."""
        answer = self.line.ask(";:".join([*messages, "SYST:ERR?"]))
        *texts, error = _UNIT.findall(answer) or [""]
        found = _ERROR.fullmatch(error)
        if found is None:
            raise self.line.failed(f"{error!r} is not an entry of the error queue")
        if int(found[1]) != 0:
            self.line.tell("*CLS")
            raise LinkError(f"the instrument refused {';'.join(messages)}: {found[1]} {found[2]}")
        return texts
