"""A device on CAN or J1939 in words: which signals of a DBC file are its terminals, what keeps its messages alive."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import Field, FiniteFloat, PositiveFloat

from hil.bench.lines import Place
from hil.description.dbc import dbc_text
from hil.description.makers_text import makers_file
from hil.description.terminal import DescribedDevice, Invalid, ScaledTerminal
from hil.errors import FileError, listed
from hil.extras import is_installed
from hil.strict import Strict

Sum = Literal["xor", "sum", "crc8"]
"""Over all other bytes: exclusive or, sum, CRC-8 of SAE J1850."""


class Signal(Strict):
    """A signal of a message, by their names in the DBC file."""

    message: str
    signal: str


class CanTerminal(ScaledTerminal):
    """A terminal: value = slope · (what the DBC makes of the bits) + offset.

    Attributes:
        message, signal: by their names in the DBC file.
        read_back: the signal that says where an output stands.
        invalid: counts that are no measurement, and what they mean.
    """

    message: str
    signal: str
    read_back: Signal | None = None
    invalid: Invalid = Field(default_factory=dict)

    @property
    def is_read_back(self) -> bool:
        """Whether a message says it."""
        return self.read_back is not None


class Checksum(Strict):
    """A signal of one byte that must fit the others."""

    signal: str
    kind: Sum


class Message(Strict):
    """What holds for a message, beside its signals.

    Attributes:
        every_s: so often it is sent; a sent one falls silent with the program.
        timeout_s: a received one that is older counts as none.
        counter: signal that counts up with each message.
        checksum: see `Checksum`.
        values: signals that are sent as they stand here: a mode, the selector of a multiplexed message.
        sign: by what a terminal's sign is told apart: the signal and its value for zero, above and below; the
            terminal's signal then has the magnitude.
    """

    every_s: PositiveFloat | None = None
    timeout_s: PositiveFloat = 0.5
    counter: str = ""
    checksum: Checksum | None = None
    values: dict[str, float] = Field(default_factory=dict)
    sign: Sign | None = None


class Sign(Strict):
    """A direction beside a magnitude."""

    signal: str
    zero: int
    above: int
    below: int


class J1939(Strict):
    """Messages are told apart by their parameter group, whoever sends them.

    Attributes:
        device: the address whose messages are believed.
        source: ours.
        claim: whether our address is claimed (SAE J1939-81) before anything is sent.
    """

    device: int = Field(ge=0, le=253)
    source: int = Field(0x26, ge=0, le=253)
    claim: bool = True


class CanWatchdog(Strict):
    """The device makes its outputs safe when no command comes for `time_s`; they go to `expires_to`."""

    time_s: PositiveFloat
    expires_to: FiniteFloat


class CanDescription(DescribedDevice[CanTerminal]):
    """A device on CAN.

    Attributes:
        dbc: the DBC file, beside this one.
        j1939: where the bus is one of SAE J1939; numbers above its last valid one are then no measurement.
    """

    protocol: Literal["can"]
    dbc: str
    j1939: J1939 | None = None
    messages: dict[str, Message] = Field(default_factory=dict)
    watchdog: CanWatchdog | None = None

    def about(self, message: str) -> Message:
        """What holds for a message."""
        return self.messages.get(message) or Message.model_validate({})

    @property
    def database(self) -> Any:
        """The messages of the DBC file, as cantools reads them.

        Raises:
            FileError: it cannot be read.
        """
        return database(self.dbc)


def _database(data: bytes) -> Any:
    import cantools

    dbc = dbc_text(data)
    found: Any = cantools.database.load_string(
        dbc.text if dbc.text.strip() else 'VERSION ""\n', database_format="dbc", strict=False
    )
    found.left_out = tuple(dbc.left_out)
    return found


database = makers_file("a DBC file", _database)
"""A DBC file as cantools reads it, by its path; `left_out` says what in it was not taken as it stands.

Raises `FileError`."""


def can_faults(description: CanDescription) -> Iterator[tuple[Place, str]]:
    """Every fault with its place in the file; the text says what is allowed."""
    if not is_installed("cantools"):
        return
    try:
        found = description.database
    except FileError as error:
        yield ("dbc",), str(error)
        return
    known = {message.name: {signal.name: signal for signal in message.signals} for message in found.messages}
    for name, terminal in description.terminals.items():
        place: Place = ("terminals", name)
        yield from _signal(place, terminal.message, terminal.signal, known)
        if terminal.count > 1:
            yield (*place, "count"), "signals have names: describe each terminal"
        if terminal.direction == "out":
            yield from ((place, text) for text in _page(terminal, description.about(terminal.message), known))
        if terminal.direction == "in" and terminal.read_back is not None:
            yield (*place, "read_back"), "belongs to an output; take this away"
        if terminal.read_back is not None:
            back = terminal.read_back
            yield from _signal((*place, "read_back"), back.message, back.signal, known)
    for name, message in description.messages.items():
        if name not in known:
            yield ("messages", name), f"no message '{name}'; there are: {listed(known)}"
            continue
        names = [message.counter] if message.counter else []
        names += [message.checksum.signal] if message.checksum else []
        names += [*message.values, *([message.sign.signal] if message.sign else [])]
        for signal in names:
            if signal not in known[name]:
                yield ("messages", name), f"no signal '{signal}' in it; there are: {listed(known[name])}"
        if message.checksum and message.checksum.signal in known[name]:
            signal_ = known[name][message.checksum.signal]
            if signal_.length != 8 or signal_.start % 8 not in (0, 7):
                yield ("messages", name, "checksum", "signal"), "is not a whole byte"
    yield from description.needless()


def _page(terminal: CanTerminal, about: Message, known: dict[str, dict[str, Any]]) -> Iterator[str]:
    """A multiplexed message is sent as one of its pages, the one with this signal on it."""
    signals = known.get(terminal.message, {})
    for name, selector in signals.items():
        if not selector.is_multiplexer or not _is_sent(selector, about):
            continue
        pages = sorted(
            {page for one in signals.values() if one.multiplexer_signal == name for page in one.multiplexer_ids}
        )
        if about.values.get(name) not in pages:
            yield (
                f"{terminal.message} has pages, told apart by {name}: say under [messages.{terminal.message}] "
                f"values = {{ {name} = … }}, one of {listed(pages)}"
            )
            return
    if terminal.signal in signals and not _is_sent(signals[terminal.signal], about):
        pages = signals[terminal.signal].multiplexer_ids
        yield f"{terminal.signal} is not on the page that values choose; it is on {listed(pages)}"


def _is_sent(signal: Any, about: Message) -> bool:
    return signal.multiplexer_ids is None or about.values.get(signal.multiplexer_signal) in signal.multiplexer_ids


def _signal(place: Place, message: str, signal: str, known: dict[str, dict[str, Any]]) -> Iterator[tuple[Place, str]]:
    if message not in known:
        yield (*place, "message"), f"no message '{message}'; there are: {listed(known)}"
    elif signal not in known[message]:
        yield (*place, "signal"), f"no signal '{signal}' in {message}; there are: {listed(known[message])}"


Message.model_rebuild()
