"""SCPI instruments on a serial line or socket: sources and meters; every command is acknowledged by the error queue.

Common commands and the error queue are those of IEEE 488.2 and SCPI; what an instrument is told and asked says its
description.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._edge import edge
from drivers._line import Line, answering
from drivers._meeting import OnALine
from drivers._read_back import ReadBackTimes
from drivers._templates import Numbers, filled, matched, remedy
from hil.daq.channel import Terminal, Wiring
from hil.daq.polled import PolledDaq
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


def open_daq(settings: Settings, wiring: Wiring) -> PolledDaq:
    """The instrument alone as a DAQ."""
    name = Path(settings.model).stem or "instrument"
    return PolledDaq({name: open_link(settings, wiring)}, {name: wiring})


@edge
class ScpiLink(OnALine):
    """An instrument that speaks SCPI (see `hil.daq.link.Link`). It has no watchdog.

    Every message ends with `SYST:ERR?`, so that each has an answer, and one that says whether it was understood.

    Attributes:
        identity: maker, model, serial number and version as `*IDN?` tells them.

    Raises:
        LinkError: what answers is no SCPI instrument.
    """

    watchdog_s: float | None = None
    keep_alive_s: float | None = None

    _line: Line

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        told = description_of(settings, "scpi")
        self._step, self._setup = settings.step, told.text.setup
        self._written = Numbers(told.text.decimal, told.text.no_measurement)
        self._line = answering(
            lambda: Line(
                settings.address, settings.baud, ENDS[settings.end], settings.timeout_s, settings.longest_reply_s,
                driver="scpi", echo=settings.echo or told.text.echo, pause_s=max(settings.pause_s, told.text.pause_s),
            ), "*CLS;*IDN?", settings.startup_s, wiring,
        )  # fmt: skip
        self._outputs = {c.terminal: told.whole[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: told.whole[c.terminal] for c in wiring.inputs.values()}
        self.unmeasured: dict[str, str] = {}
        self._driven: dict[str, float] = {}
        self._checked_s = time.monotonic()
        self._read_back_times = ReadBackTimes()
        try:
            if self.identity or not wiring.only_safe:
                self._recognise(told.text.identity)
            wiring.refuse_another(self.identity)
            with wiring.forgiving():
                self._make_ready()
        except BaseException:
            self.close()
            raise

    def _make_ready(self) -> None:
        if self._outputs and self._setup:
            self._asked(list(self._setup))

    def _recognise(self, wanted: str) -> None:
        if self.identity.count(",") != 3:
            raise LinkError(f"'{self.identity}' is not the identity of a SCPI instrument (maker,model,serial,version)")
        if matched(wanted, self.identity, self._written) is None:
            raise LinkError(f"it says that it is '{self.identity}', not '{wanted}'")

    def standing(self) -> dict[str, float]:
        """Where the outputs stand, as the instrument tells."""
        stands = self._numbers({name: output for name, output in self._outputs.items() if output.ask})
        if not all(map(math.isfinite, stands.values())):
            raise self._line.failed(f"no number in where outputs stand: {list(stands.values())}")
        return stands

    def drive(self, values: Mapping[str, float]) -> None:
        """Set the outputs in one message, and see that the instrument has taken it."""
        told = [self._line_of(self._outputs[terminal], value) for terminal, value in values.items()]
        if not self._line.is_clean:  # a safe value shall not wait: sent at once, and once more with an answer
            self._line.tell(";:".join(told))
        self._asked(told)
        self._driven.update(values)

    def read(self) -> dict[str, float]:
        """Measure every input, in one message, and now and then see that outputs stand where they were driven.

        A reading without a measurement is NaN, an overload infinite.
        """
        begun_s = time.monotonic()
        readings = self._numbers(self._inputs)
        self._read_back_times.took(time.monotonic() - begun_s)
        self.unmeasured = {name: f"the instrument answers {self._said[self._inputs[name].ask]}"
                           for name, value in readings.items() if math.isnan(value)}  # fmt: skip
        if self._driven and self._read_back_times.is_due(self._checked_s):
            self._outputs_stand()
        return readings

    def close(self) -> None:
        """Close the line."""
        self._line.close()

    def _outputs_stand(self) -> None:
        self._checked_s = time.monotonic()
        for name, stands in self.standing().items():
            driven = self._driven.get(name, stands)
            if abs(stands - driven) > max(_RESOLUTION, self._step):
                raise LinkError(
                    f"{name} stands at {stands:.4g}, not at {driven:.4g} as it was driven: the instrument restarted, "
                    f"somebody else uses it, or it sets in steps: then say step (now {self._step:g})"
                )

    def _line_of(self, output: TextTerminal, value: float) -> str:
        return filled(output.tell, self._written, value=(value - output.offset) / output.slope)

    def _numbers(self, places: Mapping[str, TextTerminal]) -> dict[str, float]:
        """The values of terminals, asked in one message; those that share a question ask it once."""
        queries = list(dict.fromkeys(place.ask for place in places.values()))
        texts = self._asked(queries)
        if len(texts) != len(queries):
            raise self._line.failed(f"{len(texts)} answers to {len(queries)} questions: {';'.join(texts)}")
        said = self._said = dict(zip(queries, texts, strict=True))
        numbers = {name: self._number_in(said[place.ask], place) for name, place in places.items()}
        for name, number in numbers.items():
            if number is None:
                text, place = said[places[name].ask], places[name]
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
