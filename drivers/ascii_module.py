"""ASCII I/O modules in the ADAM-4000 style on RS-485: `#AA` reads, `#AACn` sets, with the module's watchdog.

Commands are those of the ADAM-4000 Series User's Manual, the 4024's on its pages 6-20 and 6-21. Its editions differ in
how a 4024 is told the time of its watchdog: `$AAXnnnn`, as the other modules and as here, or `$AAX0nnnn`; a module
that does not take this cannot be opened with `watchdog_s`. The last value that it was sent (`$AA6Cn`) is all that a
4024 tells of an output: where its own watchdog has put it is not to be seen there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from pydantic import Field, PositiveFloat

from drivers._described import ByDescription
from drivers._edge import edge
from drivers._line import Line, SerialSettings
from drivers._meeting import OnALine
from hil.daq.channel import Wiring
from hil.description.ascii_module import ModuleDescription
from hil.errors import LinkError

_VALUE = re.compile(r"[+-]\d\d\.\d{3}")  # as the manual has it for ±10 V: one byte less is no answer
_BEYOND = {"+9999": math.inf, "-0000": -math.inf, "-9999": -math.inf, "+9999.9": math.inf, "-9999.9": -math.inf}
_INPUT_TYPES = {
    "08": "±10 V",
    "07": "4 … 20 mA",
    "09": "±5 V",
    "0A": "±1 V",
    "0B": "±500 mV",
    "0C": "±150 mV",
    "0D": "±20 mA",
}
_FORMATS = {0: "engineering units", 1: "% of full scale", 2: "hexadecimal", 3: "ohms"}
_CLOSE_V = 2e-3  # two of the steps in which it is told


_devices = ByDescription("ascii_module")
terminals = _devices.terminals


class Settings(SerialSettings):
    """What `[devices.NAME]` may say.

    Attributes:
        module: its address on the line, 0 … 255.
        timeout_s: an answer that takes longer counts as none. A module does not answer what it does not understand.
        watchdog_s: the module makes its outputs safe when it hears nothing for so long, 0.1 … 999.9 s.
    """

    module: int = Field(default=1, ge=0, le=255)
    timeout_s: PositiveFloat = 0.2
    watchdog_s: PositiveFloat | None = None


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from _devices.faults(settings)
    if settings.watchdog_s is None or not _devices.is_sound(settings):
        return
    if _devices.described(settings).channels.direction == "in":
        yield ("watchdog_s",), f"{settings.model} has no outputs that a watchdog could make safe; take this away"
    elif not 0.1 <= settings.watchdog_s <= 999.9:
        yield ("watchdog_s",), f"{settings.watchdog_s:g} s: the module counts 0.1 … 999.9 s"


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("serial",)


def open_link(settings: Settings, wiring: Wiring) -> AsciiModuleLink:
    """The module, recognised, its watchdog armed."""
    return AsciiModuleLink(settings, wiring)


@edge
class AsciiModuleLink(OnALine):
    """A module on its line (see `hil.daq.link.Link`).

    Attributes:
        identity: the name that the module gives itself, and its address.

    Raises:
        LinkError: another module answers than the one that was named, or one that is set otherwise.
    """

    line: Line
    _model: ModuleDescription

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        self._settings, self._model = settings, _devices.described(settings)
        self._number = {name: one.first for name, one in self._model.by_name.items()}
        self._at = f"{settings.module:02X}"
        self._inputs = [channel.terminal for channel in wiring.inputs.values()]
        self._outputs = [channel.terminal for channel in wiring.outputs.values()]
        close = dict.fromkeys(self._outputs, _CLOSE_V)
        super().__init__(wiring, settings.watchdog_s, close=close, device="module")
        self._open()

    def standing(self) -> dict[str, float]:
        """What the outputs were told last, or have from power-on, read back."""
        return {name: self._commanded_last(name) for name in self._outputs}

    def _identified(self) -> str:
        self.line = Line(self._settings, "\r", "\r", driver="ascii_module")
        try:
            return self._name()
        except LinkError:  # what an earlier program left on the line may have come in between
            return "" if self._wiring.only_safe else self._name()

    def _name(self) -> str:
        """What the module says that it is, and where."""
        return f"{self._ask('$%M', '!%')} at {self._at}"

    def _recognise(self, identity: str) -> None:
        if not identity:
            return
        if identity != f"{self._model.module_name} at {self._at}":
            name = identity.removesuffix(f" at {self._at}")
            raise LinkError(f"module {self._at} is a '{name}', not a {self._model.module_name}")
        self.line.meeting.met(identity, self._name)
        if self._wiring.only_safe:  # what is asked besides may go unanswered, and a safe value shall not wait for it
            return
        if self._inputs:
            self._check_settings()
        for output in self._outputs:
            number, wanted = self._number[output], self._model.type_code
            if (kind := self._ask(f"$%8C{number}", f"!%C{number}")[-2:]) != wanted:
                low, high = self._model.channels.range
                raise LinkError(
                    f"{output} is of output type {kind}, not {wanted} ({low:g} … {high:+g} V): set it with "
                    f"$AA7CnR{wanted}"
                )

    def _make_ready(self) -> None:
        if self.watchdog_s is not None:
            self._done(f"$%X{round(10.0 * self.watchdog_s):04d}")

    def _tell_blindly(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.line.tell(self._request(name, value).replace("%", self._at))

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """One after the other; the module acknowledges each."""
        for name, value in values.items():
            self._done(request := self._request(name, value))
            yield name, float(request[-7:])

    def _request(self, name: str, value: float) -> str:
        return f"#%C{self._number[name]}{value:+07.3f}"

    def _measured(self) -> dict[str, float]:
        """All in one answer; infinite where the module says that it is beyond its range."""
        if not self._inputs:
            return {}
        text = self._ask("#%", ">")
        numbers = [self._reading(part, text) for part in re.findall("[+-][^+-]*|^[^+-]+", text)]
        if len(numbers) != len(self._number):
            raise self.line.failed(f"{len(numbers)} readings of {len(self._number)}: '{text}'")
        return {name: numbers[self._number[name]] for name in self._inputs}

    def _check_settings(self) -> None:
        """See that inputs are read in volts, as their terminals say: the module tells numbers without a unit."""
        text = self._ask("$%2", "!%")
        if not re.fullmatch("[0-9A-F]{6}", text):
            raise self.line.failed(f"'{text}' is not the settings of a module (type, baud rate, format)")
        kind, form = text[:2], int(text[4:], 16)
        wanted = self._model.type_code
        if kind == wanted and not form & 0b11:
            return
        is_set, reads = (f"type {code}{_in_words(_INPUT_TYPES.get(code))}" for code in (kind, wanted))
        raise LinkError(
            f"module {self._at} is set to input {is_set} and format {_FORMATS[form & 0b11]}; this driver reads {reads} "
            f"in {_FORMATS[0]}: set it with %{self._at}{self._at}{wanted}{text[2:4]}{form & ~0b11:02X}"
        )

    def _reading(self, part: str, text: str) -> float:
        """A reading in the one form that the module has, or what it says beyond its range."""
        if part in _BEYOND:
            return _BEYOND[part]
        if not _VALUE.fullmatch(part):
            raise self.line.failed(f"'{part}' in the answer '{text}' is no reading of the form +00.000")
        return float(part)

    def _commanded_last(self, name: str) -> float:
        text = self._ask(f"$%6C{self._number[name]}", "!%")
        if not _VALUE.fullmatch(text):
            raise self.line.failed(f"'{text}' is no read-back of the form +00.000")
        return float(text)

    def _done(self, request: str) -> None:
        """A request that is acknowledged with nothing but the module's address."""
        if more := self._ask(request, "!%"):
            raise self.line.failed(f"'{more}' behind the acknowledgement of {request}")

    def _ask(self, request: str, begins: str) -> str:
        """The answer without its beginning; `%` stands for the module's address."""
        request, begins = request.replace("%", self._at), begins.replace("%", self._at)
        answer = self.line.ask(request)
        if answer.startswith("?"):
            raise LinkError(f"the module refuses {request}")
        if not answer.startswith(begins):
            raise self.line.failed(f"'{answer}' is no answer to {request}")
        self._watchdog.heard()
        return answer.removeprefix(begins)


def _in_words(text: str | None) -> str:
    return f" ({text})" if text else ""
