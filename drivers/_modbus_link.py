"""A device on Modbus as a link: outputs driven and read back, inputs read, its watchdog, faults and enabling."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress

from drivers._edge import edge
from drivers._meeting import OnALine
from drivers._modbus_client import LineSettings
from drivers._modbus_line import ModbusLine
from drivers._modbus_model import Model, described_by
from drivers._modbus_ready import Readiness
from drivers._register_blocks import RegisterBlock, register_blocks, written
from drivers._registers import Encoding, encodings
from drivers._start_up import once_started
from hil.daq.channel import Wiring
from hil.description.modbus import Flag, ModbusDescription, ModbusTerminal
from hil.errors import DeviceLostError, LinkError, SettingError
from hil.system import system


@edge
class ModbusLink(OnALine):
    """A device on Modbus (see `hil.daq.link.Link`).

    Args:
        settings: how it is reached.
        wiring: the channels in use.
        model: what it is.
        expires_to: where its watchdog puts outputs, as it was set; by the description if not given.

    Attributes:
        identity: maker, product and version as the device tells them (function 43/14), empty when it does not.

    Raises:
        DeviceLostError: nothing answers at the address.
        LinkError: it reports a fault that cannot be cleared, or does not get ready.
        SettingError: a carrier or dither that it does not make.
    """

    line: ModbusLine

    def __init__(
        self, settings: LineSettings, wiring: Wiring, model: ModbusDescription | Model,
        expires_to: float | None = None,
    ) -> None:  # fmt: skip
        described = described_by(model)
        wire, watchdog = described.modbus, described.watchdog
        if watchdog is None or not watchdog.arm:
            self._remedy += "set that at the device and say so with watchdog_level, or "
        if expires_to is None and watchdog is not None:
            expires_to = watchdog.expires_to
        self._order = settings.word_order or wire.byte_order
        registers = encodings(described, self._order)
        used = {c.terminal for c in wiring.outputs.values()} | {c.terminal for c in wiring.inputs.values()}
        chosen = {name: register for name, register in registers.items() if name in used}
        outputs = {name: r for name, r in chosen.items() if r.terminal.direction == "out"}
        self._inputs = {name: r for name, r in chosen.items() if r.terminal.direction == "in"}
        self._out = written(outputs, wire.longest_write)
        self._pwm = {name: level for name, r in registers.items()
                     if (level := modulation(r.terminal, wiring)) is not None}  # fmt: skip
        made = {name: registers[name] for name in self._pwm}
        self._pwm_out = written(made, wire.longest_write)
        readable = {name: r for name, r in (outputs | made).items() if r.can_be_read}
        self._back = register_blocks(readable, 0, wire.longest_read)
        self._in = register_blocks(self._inputs, wire.gap, wire.longest_read)
        self._words_sent: dict[str, tuple[int, ...]] = {}
        self._around: dict[int, list[int]] = {}
        self._before: dict[str, float] = {}
        close = {name: register.terminal.close or 0.0 for name, register in outputs.items()}
        super().__init__(wiring, settings.watchdog_s, expires_to=expires_to, close=close)
        self._units |= {name: r.terminal.unit for name, r in made.items()}
        settings = settings.model_copy(
            update={"echo": settings.echo or (wire.echo and settings.transport == "rtu"),
                    "pause_s": max(settings.pause_s, wire.pause_s)}
        )  # fmt: skip
        self._startup_s = 0.0 if wiring.only_safe else settings.startup_s
        self.line = ModbusLine(settings, self._watchdog.heard)
        self._ready = Readiness(self.line, described, registers, self._safe, self.watchdog_s, self._out)
        self._open()

    def standing(self) -> dict[str, float]:
        """Where the outputs stand, carrier and dither too, read back; those that cannot be are left out."""
        found: dict[str, float] = {}
        for block in self._back:
            words = block.split(self._ask(block.read_back_function, block.read_back, count=block.count))
            found |= {name: register.value_of(words[name]) for name, register in block.terminals.items()}
        return found

    def close(self) -> None:
        """Close the connection; outputs that were enabled are so no longer where the device has that."""
        try:
            self._ready.undone()
        finally:
            self.line.close()

    def _identified(self) -> str:
        once_started(self._startup_s, self._reached)
        return self.line.identity() if self._wiring.known_as else ""

    def _reached(self) -> None:
        """Connect; a device that has a start-up is asked something too."""
        try:
            self.line.connect()
            if self._startup_s:
                block = next(iter(self._in or self._back or self._out))
                self._ask(block.function, block.first, count=block.count)
        except BaseException:
            self.line.close()
            raise

    def _make_ready(self) -> None:
        self._ready.made(self._go_safe, self._look_around)
        if self._wiring.only_safe and not self._wiring.known_as:  # none that keeps silent keeps a safe value waiting
            self._go_safe()

    def _opened(self, identity: str) -> None:
        if not self._wiring.known_as:
            with suppress(DeviceLostError):  # some hang up on a question that they do not know
                identity = self.line.identity()
        self.line.meeting.met(identity, self.line.identity)
        for block, words in self._words(self._pwm, self._pwm_out):
            self._ask(block.writing, block.first, values=words)
            for name, mine in block.split(words).items():
                self._driven[name] = [(system.now_s(), block.terminals[name].value_of(mine))]

    def _go_safe(self) -> None:
        for block, words in self._words(self._safe, self._out):
            self._ask(block.writing, block.first, values=words)

    def _look_around(self) -> None:
        """Registers that hold more than an output: what else stands there is written back as it is."""
        for block in self._out:
            if block.has_parts:
                words = self._ask(block.read_back_function, block.read_back, count=block.count)
                self._around[block.first] = words

    def _tell_blindly(self, values: Mapping[str, float]) -> None:
        self.line.tell_blindly([(s.writing, s.first, words) for s, words in self._words(values, self._out)])

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """Neighbours in one request."""
        for block, words in self._words(values, self._out):
            self._ask(block.writing, block.first, values=words)
            for name, mine in block.split(words).items():
                self._words_sent[name] = mine
                yield name, block.terminals[name].value_of(mine)

    def _measured(self) -> dict[str, float]:
        words: dict[str, tuple[int, ...]] = {}
        for block in self._in:
            words |= block.split(self._ask(block.function, block.first, count=block.count))
        flags = self._ready.flags(flag for one in self._inputs.values() for flag in one.terminal.status)
        self.line.has_read = True
        return {name: self._reading(name, r, words[name], flags) for name, r in self._inputs.items()}

    def _words(
        self, values: Mapping[str, float], out: Iterable[RegisterBlock]
    ) -> Iterator[tuple[RegisterBlock, list[int]]]:
        """What to write; an output that is not given keeps what was driven before."""
        for block in out:
            words = {name: self._words_sent.get(name, (0,) * r.words) for name, r in block.terminals.items()}
            words |= {name: tuple(r.words_of(values[name])) for name, r in block.terminals.items()
                      if name in values}  # fmt: skip
            yield block, block.joined(words, self._around.get(block.first, [0] * block.count))

    def _look_at_outputs(self) -> None:
        self._ready.no_fault()
        if safe := self._ready.in_safe_mode():
            raise LinkError(
                f"{', '.join(safe)}: the device itself has made it safe; its watchdog expired, or it was told to"
            )

    def _reading(self, name: str, register: Encoding, words: Sequence[int], flags: Mapping[Flag, bool]) -> float:
        why = register.why_none(words)
        why = why or next((flag.means or "its status says so" for flag in register.terminal.status if flags[flag]), "")
        number = register.value_of(words)
        value = math.nan if why else register.measured(number, self._before.get(name))
        self._before[name] = value
        if math.isnan(value):
            cause = why or f"a dead sensor, or check word_order (now {self._order})"
            return self._none(name, why or f"reads {number:.3g} {register.terminal.unit}: {cause}")
        return value

    def _ask(self, function: int, address: int, *, count: int = 1, values: Sequence[int] = ()) -> list[int]:
        return self.line.ask(function, address, count=count, values=values)


def modulation(terminal: ModbusTerminal, wiring: Wiring) -> float | None:
    """What a terminal is set to that `sets` carrier or dither of an output; None where nobody asks for it.

    Without dither its amplitude is none, at its lowest frequency.

    Raises:
        SettingError: it is beyond what the device makes.
    """
    of, _, key = (terminal.sets or "").rpartition(".")
    channel = next((c for c in wiring.outputs.values() if c.terminal == of), None)
    if channel is None or channel.pwm is None:
        return None
    low, high = terminal.range
    if key != "carrier_hz" and channel.pwm.dither_hz is None:
        return low
    value, unit = float(getattr(channel.pwm, key)), terminal.unit
    if not low <= value <= high:
        raise SettingError(
            f"'{channel.name}': pwm.{key} = {value:g} {unit}; the amplifier makes {low:g} … {high:g} {unit}"
        )
    return value
