"""A device that answers lines of text, in words: what is told and asked for each terminal, and what comes back."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Literal, Self

from pydantic import Field, FiniteFloat, field_validator

from hil.bench.lines import Place
from hil.description.terminal import DescribedDevice, ScaledTerminal
from hil.strict import Strict

End = Literal["LF", "CRLF", "CR"]
ENDS: Mapping[str, str] = {"LF": "\n", "CRLF": "\r\n", "CR": "\r"}
TIMES: Mapping[str, float] = {"tenths": 10.0, "seconds": 1.0, "ms": 1000.0}
HOLE = re.compile(r"\{(value|any|n|tenths|seconds|ms|safe:[^}:]+)(?::([^}]*))?\}")
"""A place in a template: `{value:.3f}`, `{any}`, `{n}`, `{tenths:04d}`, `{safe:TERMINAL:.3f}`."""
_REAL = re.compile(r"[+ -]?0?\d*(\.\d+)?[feEgG]|")
_WHOLE = re.compile(r"0?\d*[dxX]|")


class TextTerminal(ScaledTerminal):
    """A terminal: value = slope · number + offset.

    Attributes:
        tell: what sets an output, with `{value:.3f}` (a form of Python's `format`).
        reply: what the device says to that, `{any}` for what may be anything; it says nothing if not given.
        ask: what asks for an input, or where an output stands; without, an output is not read back.
        answer: what comes back, with `{value}`: `{value} bar`, `>{value:+07.3f}`. A form with a width is demanded.
        field: which number of an answer, from 0, that several terminals share, parted by the file's `separator`.
    """

    tell: str = ""
    reply: str = ""
    ask: str = ""
    answer: str = "{value}"
    field: int | None = Field(None, ge=0)

    @property
    def is_read_back(self) -> bool:
        """Whether it says what asks for it."""
        return bool(self.ask)

    def of_row(self, i: int) -> Self:
        """The terminal `i` of a row, from 0, by itself: its number in the place of `{n}`."""

        def filled(text: str) -> str:
            return HOLE.sub(lambda hole: format(self.first + i, hole[2] or "d") if hole[1] == "n" else hole[0], text)

        lines = {key: filled(getattr(self, key)) for key in ("tell", "reply", "ask", "answer")}
        return super().of_row(i).model_copy(update=lines)

    @field_validator("tell", "answer")
    @classmethod
    def _with_a_value(cls, given: str) -> str:
        if given and len([hole for hole in HOLE.finditer(given) if hole[1] == "value"]) != 1:
            raise ValueError("has {value} in it, once, such as {value:.3f}")
        return given


class Talk(Strict):
    """How the device is spoken to.

    Attributes:
        end: of what is sent; `answer_end` of what comes, as what is sent if not given.
        decimal: its decimal point.
        separator: of the numbers in one answer.
        hello: asked when it is opened; `identity` is what it must answer, `{any}` for what may be anything.
        setup: told when it is opened with outputs, in this order.
        errors: asked after what was told; `no_error` is the answer when all is well, a {value} in it being 0.
        no_measurement: words and numbers that are none, beside SCPI's 9.9E37, 9.91E37 and `OL`.
        pause_s, echo: as in the bench file, for every device of this kind.
    """

    end: End = "LF"
    answer_end: End | None = None
    decimal: Literal[".", ","] = "."
    separator: str = Field(",", min_length=1)
    hello: str = ""
    identity: str = "{any}"
    setup: tuple[str, ...] = ()
    errors: str = ""
    no_error: str = "{value},{any}"
    no_measurement: tuple[str, ...] = ()
    pause_s: float = Field(0.0, ge=0.0, le=1.0)
    echo: bool = False


class TextWatchdog(Strict):
    """What makes the outputs safe when nothing is said any more.

    Attributes:
        arm: told in this order, with `{tenths:04d}`, `{seconds}` or `{ms}` (its time), `{safe:TERMINAL:.3f}`; empty
            where it is set at the device itself.
        reply: what the device says to each; nothing if not given.
        expires_to: where outputs go then, if it is always the same.
    """

    arm: tuple[str, ...] = ()
    reply: str = ""
    expires_to: FiniteFloat | None = None


class TextDescription(DescribedDevice[TextTerminal]):
    """A device that is told and asked in lines of text."""

    protocol: Literal["text", "scpi"]
    text: Talk = Field(default_factory=lambda: Talk.model_validate({}))
    watchdog: TextWatchdog | None = None


def text_faults(description: TextDescription) -> Iterator[tuple[Place, str]]:
    """Every fault with its place in the file; the text says what is allowed."""
    for name, terminal in description.terminals.items():
        for key, text in _terminal(description, terminal):
            yield ("terminals", name, key), text
    for i, line in enumerate(description.watchdog.arm if description.watchdog else ()):
        for text in (*_form_faults(line), *_safe_faults(line, description.outputs)):
            yield ("watchdog", "arm", i), text
    yield from description.needless()


def _terminal(description: TextDescription, terminal: TextTerminal) -> Iterator[tuple[str, str]]:
    if terminal.direction == "out" and not terminal.tell:
        yield "tell", "is missing: what sets this output, such as 'VOLT {value:.3f}'"
    if terminal.direction == "in":
        if not terminal.ask:
            yield "ask", "is missing: what asks for this input, such as 'MEAS:VOLT?'"
        for key in ("tell", "reply", "close"):
            if getattr(terminal, key):
                yield key, "belongs to an output; take this away"
    if description.protocol == "scpi" and terminal.reply:
        yield "reply", "a SCPI instrument says nothing to what it is told; take this away"
    for key in ("tell", "reply", "ask", "answer"):
        text = getattr(terminal, key)
        yield from ((key, fault) for fault in _form_faults(text))
        if not text.isascii():
            yield key, f"'{text}': a line is ASCII"


def _form_faults(text: str) -> Iterator[str]:
    for hole in HOLE.finditer(text):
        form, is_real = hole[2] or "", hole[1] == "value" or hole[1].startswith("safe:")
        if hole[1] == "any" and form:
            yield "{any} has no form"
        elif not (_REAL if is_real else _WHOLE).fullmatch(form):
            yield f"'{hole[0]}': {'a form such as .3f, +07.3f, .5E' if is_real else 'a form such as d, 04d, 02X'}"
    if "{" in HOLE.sub("", text):
        yield f"'{text}': in braces there are value, any, n, tenths, seconds, ms and safe:TERMINAL"


def _safe_faults(line: str, outputs: list[str]) -> Iterator[str]:
    for hole in HOLE.finditer(line):
        name = hole[1].removeprefix("safe:")
        if hole[1].startswith("safe:") and name not in outputs:
            yield f"no output '{name}'; there are: {', '.join(outputs) or 'none'}"
