"""SCPI instruments on a serial line or socket: sources and meters; every command is acknowledged by the error queue.

Common commands and the error queue are those of IEEE 488.2 and SCPI. **The two models are our choice**, of no maker:
headers as instruments of their kind commonly have them; which channels they have, how these are numbered and what
ranges they have is ours. For a real instrument, put what its manual says in their place.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._edge import edge
from drivers._line import Line
from hil.daq.channel import Terminal, Wiring
from hil.daq.polled import PolledDaq
from hil.errors import LinkError

_CHECK_S = 0.5  # how often outputs are asked where they stand
_RESOLUTION = 1e-3  # of what is set, in its unit; coarser instruments say `step`
_NO_NUMBER, _BEYOND = 9.91e37, 9.9e37  # not a number, and infinity, as SCPI writes them
_WORDS = {"NAN": math.nan, "OL": math.inf, "OVLD": math.inf, "OVERLOAD": math.inf, "INF": math.inf}
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")  # NR1, NR2 and NR3
_UNIT = re.compile(r'(?:"(?:[^"]|"")*"|[^;"])+')  # up to a semicolon that no text has in it
_ERROR = re.compile(r'\s*([+-]?\d+)\s*,\s*"(.*)"\s*')
PROBES = "scpi"


@dataclass(frozen=True, slots=True)
class Output:
    """A terminal that is set: how, and how it is asked where it stands."""

    terminal: Terminal
    tell: str
    ask: str


@dataclass(frozen=True, slots=True)
class Input:
    """A terminal that is read."""

    terminal: Terminal
    ask: str


@dataclass(frozen=True, slots=True)
class Model:
    """A kind of instrument."""

    outputs: Mapping[str, Output]
    inputs: Mapping[str, Input]


MODELS: Mapping[str, Model] = {
    # A scanner main frame with a module of two outputs, ±12 V, and a multiplexer of twenty inputs, ±10 V.
    "scanner": Model(
        {
            f"dac{n}": Output(
                Terminal("out", "voltage", "V", -12.0, 12.0),
                f"SOUR:VOLT {{value:.5f}},(@20{n})", f"SOUR:VOLT? (@20{n})",
            )
            for n in (4, 5)
        },
        {f"in{n}": Input(Terminal("in", "voltage", "V", -10.0, 10.0), f"MEAS:VOLT:DC? (@{100 + n})")
         for n in range(1, 21)},
    ),
    # A direct-current source for a coil: set current, measured current and voltage.
    "dc-source": Model(
        {"current": Output(Terminal("out", "current", "A", 0.0, 3.0), "SOUR:CURR {value:.5f}", "SOUR:CURR?")},
        {
            "coil current": Input(Terminal("in", "current", "A", 0.0, 3.2), "MEAS:CURR?"),
            "coil voltage": Input(Terminal("in", "voltage", "V", 0.0, 36.0), "MEAS:VOLT?"),
        },
    ),
}  # fmt: skip


class Settings(BaseModel):
    """What `[devices.NAME]` may say.

    Attributes:
        model: which instrument.
        address: a serial port, `socket://host:port`, or `rfc2217://host:port`.
        baud: of a serial port.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure nothing is asked for so long, so that a late answer passes.
        end: of what is sent: `LF`, `CRLF` or `CR`; answers may end with CR LF where LF is said.
        step: in which outputs are set, in their unit, where the instrument has no finer ones.
        echo: what is sent comes back before the answer.
        pause_s: so long nothing is asked after an answer.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    model: Literal["scanner", "dc-source"]
    address: str
    baud: PositiveInt = 115200
    timeout_s: PositiveFloat = 0.5
    longest_reply_s: PositiveFloat = 2.0
    end: Literal["LF", "CRLF", "CR"] = "LF"
    step: float = Field(default=0.0, ge=0.0)
    echo: bool = False
    pause_s: float = Field(default=0.0, ge=0.0, le=1.0)


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    if settings.longest_reply_s < settings.timeout_s:
        yield ("longest_reply_s",), f"must not be shorter than timeout_s = {settings.timeout_s:g}"


def probe() -> Any:
    """Who is on such a line (see `hil.daq.probe`)."""
    from drivers import _probe_scpi

    return _probe_scpi


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Those of the model."""
    model = MODELS[settings.model]
    return {name: output.terminal for name, output in model.outputs.items()} | {
        name: place.terminal for name, place in model.inputs.items()
    }


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("serial",)


def open_link(settings: Settings, wiring: Wiring) -> ScpiLink:
    """The instrument, identified, its error queue empty."""
    return ScpiLink(settings, wiring)


def open_daq(settings: Settings, wiring: Wiring) -> PolledDaq:
    """The instrument alone as a DAQ."""
    return PolledDaq({settings.model: open_link(settings, wiring)}, {settings.model: wiring})


@edge
class ScpiLink:
    """An instrument that speaks SCPI (see `hil.daq.polled.Link`). It has no watchdog.

    Every message ends with `SYST:ERR?`, so that each has an answer, and one that says whether it was understood.

    Attributes:
        identity: maker, model, serial number and version as `*IDN?` tells them.

    Raises:
        LinkError: what answers is no SCPI instrument.
    """

    watchdog_s: float | None = None
    keep_alive_s: float | None = None

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        model = MODELS[settings.model]
        self._step = settings.step
        self._line = Line(
            settings.address, settings.baud, _ENDS[settings.end], settings.timeout_s, settings.longest_reply_s,
            driver="scpi", echo=settings.echo, pause_s=settings.pause_s,
        )  # fmt: skip
        self._outputs = {c.terminal: model.outputs[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: model.inputs[c.terminal] for c in wiring.inputs.values()}
        self._driven: dict[str, float] = {}
        self._checked_s = time.monotonic()
        try:
            self.identity = self._line.ask_first("*CLS;*IDN?").strip()
            if self.identity.count(",") != 3:
                raise LinkError(
                    f"'{self.identity}' is not the identity of a SCPI instrument (maker,model,serial,version)"
                )
        except BaseException:
            self.close()
            raise

    def standing(self) -> dict[str, float]:
        """Where the outputs stand, as the instrument tells."""
        values = self._numbers([output.ask for output in self._outputs.values()])
        if not all(map(math.isfinite, values)):
            raise self._line.failed(f"no number in where outputs stand: {values}")
        return dict(zip(self._outputs, values, strict=True))

    def drive(self, values: Mapping[str, float]) -> None:
        """Set the outputs in one message, and see that the instrument has taken it."""
        told = [self._outputs[terminal].tell.format(value=value) for terminal, value in values.items()]
        if not self._line.is_clean:  # a safe value shall not wait: sent at once, and once more with an answer
            self._line.tell(";:".join(told))
        self._asked(told)
        self._driven.update(values)

    def read(self) -> dict[str, float]:
        """Measure every input, in one message, and now and then see that outputs stand where they were driven.

        A reading without a measurement is NaN, an overload infinite.
        """
        if self._driven and time.monotonic() - self._checked_s > _CHECK_S:
            self._outputs_stand()
        values = self._numbers([place.ask for place in self._inputs.values()])
        return dict(zip(self._inputs, values, strict=True))

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

    def _numbers(self, queries: list[str]) -> list[float]:
        texts = self._asked(queries)
        if len(texts) != len(queries):
            raise self._line.failed(f"{len(texts)} answers to {len(queries)} questions: {';'.join(texts)}")
        values = [_number(text.strip()) for text in texts]
        if None in values:
            raise self._line.failed(f"no number in the answer {';'.join(texts)}")
        return [value for value in values if value is not None]

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


_ENDS = {"LF": "\n", "CRLF": "\r\n", "CR": "\r"}


def _number(text: str) -> float | None:
    """A number as SCPI writes it, NaN or infinite where it says so; None when it is none."""
    word = text.lstrip("+-").upper()
    if word in _WORDS:
        return -_WORDS[word] if text.startswith("-") else _WORDS[word]
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    if abs(value) >= _NO_NUMBER:
        return math.nan
    return math.copysign(math.inf, value) if abs(value) >= _BEYOND else value
