"""A device that answers lines of text as a link: lines for each output, questions for each input, read-back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import ClassVar

from pydantic import Field, FiniteFloat, PositiveFloat

from drivers._described import ByDescription
from drivers._edge import edge
from drivers._line import Line, SerialSettings, answering
from drivers._meeting import OnALine
from drivers._templates import Numbers, filled, matched, names_safe, remedy
from hil.daq.channel import Wiring
from hil.description.text import ENDS, TextDescription, TextTerminal
from hil.errors import LinkError

_RESOLUTION = 1e-6  # of a number that comes back; coarser devices say `close`


class Settings(SerialSettings):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        startup_s: at opening the device is waited for so long, where it answers only after a start-up of its own.
        watchdog_s: the device makes its outputs safe when it hears nothing for so long.
        watchdog_level: where it was set to put them, where the description does not arm it.
    """

    startup_s: float = Field(default=0.0, ge=0.0, le=300.0)
    watchdog_s: PositiveFloat | None = None
    watchdog_level: FiniteFloat | None = None


DEVICES = ByDescription("text")


class SpokenLink(OnALine):
    """A device on its line that is told and asked as its description says.

    Args:
        settings: how it is reached, and which it is.
        wiring: the channels in use.
        close: as in `DeviceLink`; by the description if not given.
        watchdog_s, expires_to: as in `DeviceLink`.
    """

    devices: ClassVar[ByDescription]
    _description: TextDescription
    line: Line

    def __init__(
        self, settings: SerialSettings, wiring: Wiring, *, close: float | None = None, watchdog_s: float | None = None,
        expires_to: float | None = None,
    ) -> None:  # fmt: skip
        self._settings, self._description = settings, self.devices.described(settings)
        whole, self._talk = self._description.by_name, self._description.text
        self._numbers = Numbers(self._talk.decimal, self._talk.no_measurement)
        self._outputs = {c.terminal: whole[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: whole[c.terminal] for c in wiring.inputs.values()}
        self._answers: dict[str, str] = {}
        by_file = {n: max(t.close or 0.0, _RESOLUTION * max(map(abs, t.range))) for n, t in self._outputs.items()}
        tolerances = by_file if close is None else dict.fromkeys(self._outputs, close)
        super().__init__(wiring, watchdog_s, expires_to=expires_to, close=tolerances)
        self._open()

    def standing(self) -> dict[str, float]:
        """Where outputs stand, of those that can be asked."""
        stands = self._asked({name: terminal for name, terminal in self._outputs.items() if terminal.ask})
        if unknown := [name for name, value in stands.items() if not math.isfinite(value)]:
            raise self.line.failed(f"no number in where {', '.join(unknown)} stands")
        return stands

    def _asked(self, terminals: Mapping[str, TextTerminal]) -> dict[str, float]:
        """The values of terminals."""
        raise NotImplementedError

    def _line_of(self, name: str, value: float) -> str:
        return filled(self._outputs[name].tell, self._numbers, value=self._outputs[name].raw_at(value))

    def _values(self, terminals: Mapping[str, TextTerminal], ask: Callable[[str], str]) -> dict[str, float]:
        """The values of terminals; those that share a question have it asked once.

        Raises:
            LinkError: an answer is none to its question. Nothing is asked after it.
        """
        answers = self._answers = {}
        found: dict[str, float] = {}
        for name, terminal in terminals.items():
            if terminal.ask not in answers:
                answers[terminal.ask] = ask(terminal.ask)
            part = self._part_of(answers[terminal.ask], terminal)
            number = matched(terminal.answer, part, self._numbers) if part else None
            if number is None:
                raise self.line.failed(
                    f"'{answers[terminal.ask]}' is no answer to {terminal.ask}; it should be '{terminal.answer}'"
                    f"{remedy(part, self._numbers)}"
                )
            found[name] = terminal.value_at(number)
        return found

    def _part_of(self, answer: str, terminal: TextTerminal) -> str:
        """What of an answer is this terminal's; empty where there is no such field."""
        fields = [answer] if terminal.field is None else answer.split(self._talk.separator)
        return fields[at] if (at := terminal.field or 0) < len(fields) else ""


@edge
class TextLink(SpokenLink):
    """A device on its line (see `hil.daq.link.Link`).

    Attributes:
        identity: what it says of itself, where its description asks for that.

    Raises:
        LinkError: it says that it is something else.
        SettingError: a watchdog that would put an output elsewhere than at its safe value.
    """

    devices = DEVICES
    _settings: Settings

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        super().__init__(settings, wiring, watchdog_s=settings.watchdog_s, expires_to=DEVICES.level(settings))

    def _identified(self) -> str:
        talk = self._talk
        self.line = answering(self._settings, self._wiring, talk, talk.hello, ENDS[talk.end], driver="text")
        return self.identity

    def _recognise(self, identity: str) -> None:
        if not identity and (not self._talk.hello or self._wiring.only_safe):
            return
        self._watchdog.heard()
        if matched(self._talk.identity, identity, self._numbers) is None:
            raise LinkError(f"to {self._talk.hello} it says '{identity}', not '{self._talk.identity}'")

    def _make_ready(self) -> None:
        for line in self._talk.setup:
            self._tell(line, "")
        numbers = {name: self._outputs[name].raw_at(value) for name, value in self._safe.items()}
        armed = self._description.watchdog if self.watchdog_s is not None else None
        for line in armed.arm if armed is not None else ():
            if armed is not None and all(name in numbers for name in names_safe(line)):
                self._tell(filled(line, self._numbers, self.watchdog_s or 0.0, numbers), armed.reply)
        self._no_error(self._talk.setup)

    def _tell_blindly(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.line.tell(self._line_of(name, value))

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """One after the other; where the device replies, it must."""
        lines = {name: self._line_of(name, value) for name, value in values.items()}
        for name, line in lines.items():
            self._tell(line, self._outputs[name].reply)
        self._no_error(lines.values())
        for name, line in lines.items():
            terminal = self._outputs[name]
            sent = matched(terminal.tell, line, self._numbers)  # as it was rounded
            yield name, values[name] if sent is None else terminal.value_at(sent)

    def _measured(self) -> dict[str, float]:
        readings = self._asked(self._inputs)
        answers = {name: self._answers[terminal.ask] for name, terminal in self._inputs.items()}
        return {name: self._none(name, f"the device answers {answers[name]!r}") if math.isnan(value) else value
                for name, value in readings.items()}  # fmt: skip

    def _tell(self, line: str, reply: str) -> None:
        if not reply:
            self.line.tell(line)
            return
        answer = self.line.ask(line)
        if matched(reply, answer, self._numbers) is None:
            raise self.line.failed(f"'{answer}' is no answer to {line}; it should be '{reply}'")
        self._watchdog.heard()

    def _no_error(self, errors: object) -> None:
        if not self._talk.errors:
            return
        answer = self._heard(self._talk.errors)
        if matched(self._talk.no_error, answer, self._numbers) != 0.0:
            raise LinkError(f"the device refused {', '.join(errors)}: {answer.strip()}")  # type: ignore[arg-type, call-overload]

    def _asked(self, terminals: Mapping[str, TextTerminal]) -> dict[str, float]:
        return self._values(terminals, self._heard)

    def _heard(self, question: str) -> str:
        answer = self.line.ask(question)
        self._watchdog.heard()
        return answer
