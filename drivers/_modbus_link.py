"""A device on Modbus as a link: outputs driven and read back, inputs read, its watchdog, faults and enabling."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from drivers._edge import edge
from drivers._meeting import OnALine
from drivers._modbus_client import LineSettings
from drivers._modbus_line import ModbusLine
from drivers._modbus_model import Model, check_level
from drivers._modbus_ready import Readiness
from drivers._read_back import ReadBackTimes
from drivers._registers import Flag, Register, WordOrder
from drivers._start_up import once_started
from drivers._stretches import Stretch, stretches, written
from drivers._watchdog import DeviceWatchdog
from hil.daq.channel import Wiring
from hil.errors import LinkError
from hil.units import behind_a_number


@edge
class ModbusLink(OnALine):
    """A device on Modbus (see `hil.daq.link.Link`).

    Attributes:
        identity: maker, product and version as the device tells them (function 43/14), empty when it does not.

    Raises:
        DeviceLostError: nothing answers at the address.
        LinkError: it reports a fault that cannot be cleared, or does not get ready.
    """

    _line: ModbusLine

    def __init__(self, settings: LineSettings, wiring: Wiring, model: Model) -> None:
        if settings.watchdog_s is not None:
            check_level(model, wiring)
        self._watchdog = DeviceWatchdog(settings.watchdog_s)
        self.watchdog_s, self.keep_alive_s = self._watchdog.time_s, self._watchdog.keep_alive_s
        self._order: WordOrder = settings.word_order or model.word_order
        used = {c.terminal for c in wiring.outputs.values()} | {c.terminal for c in wiring.inputs.values()}
        chosen = {name: register for name, register in model.registers.items() if name in used}
        outputs = {name: r for name, r in chosen.items() if r.direction == "out"}
        self._inputs = {name: r for name, r in chosen.items() if r.direction == "in"}
        self._out = written(outputs, model.longest_write)
        self._back = stretches({name: r for name, r in outputs.items() if r.can_be_read}, 0, model.longest_read)
        self._in = stretches(self._inputs, model.gap, model.longest_read)
        self._safe = {c.terminal: c.safe for c in wiring.outputs.values()}
        self._driven: dict[str, tuple[int, ...]] = {}
        self._around: dict[int, list[int]] = {}
        self._before: dict[str, float] = {}
        self._looked_at = wiring.looked_at
        self.unmeasured: dict[str, str] = {}
        self._checked_s = time.monotonic()
        self._read_back_times = ReadBackTimes()
        settings = settings.model_copy(
            update={"echo": settings.echo or (model.echo and settings.transport == "rtu"),
                    "pause_s": max(settings.pause_s, model.pause_s)}
        )  # fmt: skip
        self._line = ModbusLine(settings, self._watchdog.heard)
        self._ready = Readiness(self._line, model, self._order, self._safe, self.watchdog_s, self._out)
        try:
            startup_s = 0.0 if wiring.only_safe else settings.startup_s
            once_started(startup_s, lambda: self._reached(startup_s))
            identity = self._line.identity() if wiring.known_as else ""
            wiring.refuse_another(identity)
            with wiring.forgiving():
                self._make_ready()
                if wiring.only_safe and not wiring.known_as:  # no device that keeps silent keeps a safe value waiting
                    self._go_safe()
            self._line.meeting.met(identity if wiring.known_as else self._line.identity(), self._line.identity)
        except BaseException:
            self.close()
            raise

    def standing(self) -> dict[str, float]:
        """Where the outputs stand, read back; those that cannot be are left out."""
        return {name: register.value_of(words, self._order) for name, register, words in self._read_back()}

    def drive(self, values: Mapping[str, float]) -> None:
        """Write the outputs, neighbours in one request.

        Raises:
            LinkError: also when the device's watchdog must have expired meanwhile, so that outputs stand elsewhere.
        """
        if not self._line.is_clean:  # a safe value shall not wait: sent at once, and once more when the line is clean
            self._line.tell_blindly([(s.writing, s.first, words) for s, words in self._words(values)])
        self._watchdog_has_not_expired()
        for stretch, words in self._words(values):
            self._ask(stretch.writing, stretch.first, values=words)
            self._driven.update(stretch.split(words))

    def read(self) -> dict[str, float]:
        """Every input, NaN where it has no measurement; now and then also whether outputs still stand as driven."""
        self._watchdog_has_not_expired()
        begun_s = time.monotonic()
        said: dict[str, tuple[int, ...]] = {}
        for stretch in self._in:
            said |= stretch.split(self._ask(stretch.function, stretch.first, count=stretch.count))
        flags = self._ready.flags(flag for register in self._inputs.values() for flag in register.status)
        self._line.has_read = True
        self._read_back_times.took(time.monotonic() - begun_s)
        self.unmeasured = {}
        readings = {name: self._measured(name, r, said[name], flags) for name, r in self._inputs.items()}
        if self._driven and self._read_back_times.is_due(self._checked_s):
            self._outputs_stand()
        return readings

    def close(self) -> None:
        """Close the connection; outputs that were enabled are so no longer where the device has that."""
        try:
            self._ready.undone()
        finally:
            self._line.close()

    def _reached(self, startup_s: float) -> None:
        """Connect; a device that has a start-up is asked something too."""
        try:
            self._line.connect()
            if startup_s:
                stretch = next(iter(self._in or self._back or self._out))
                self._ask(stretch.function, stretch.first, count=stretch.count)
        except BaseException:
            self._line.close()
            raise

    def _make_ready(self) -> None:
        if self._safe:  # a device whose inputs alone are read is left as it is
            self._ready.made(self._go_safe, self._look_around)

    def _go_safe(self) -> None:
        for stretch, words in self._words(self._safe):
            self._ask(stretch.writing, stretch.first, values=words)

    def _look_around(self) -> None:
        """Registers that hold more than an output: what else stands there is written back as it is."""
        for stretch in self._out:
            if stretch.has_parts:
                words = self._ask(stretch.read_back_function, stretch.read_back, count=stretch.count)
                self._around[stretch.first] = words

    def _words(self, values: Mapping[str, float]) -> Iterable[tuple[Stretch, list[int]]]:
        """What to write; an output that is not given keeps what was driven before."""
        for stretch in self._out:
            words = {name: self._driven.get(name, (0,) * r.words) for name, r in stretch.terminals.items()}
            words |= {name: tuple(r.words_of(values[name], self._order)) for name, r in stretch.terminals.items()
                      if name in values}  # fmt: skip
            yield stretch, stretch.joined(words, self._around.get(stretch.first, [0] * stretch.count), self._order)

    def _read_back(self) -> Iterator[tuple[str, Register, tuple[int, ...]]]:
        for stretch in self._back:
            words = stretch.split(self._ask(stretch.read_back_function, stretch.read_back, count=stretch.count))
            yield from ((name, register, words[name]) for name, register in stretch.terminals.items())

    def _outputs_stand(self) -> None:
        self._checked_s = time.monotonic()
        self._ready.no_fault()
        if safe := self._ready.in_safe_mode():
            raise LinkError(
                f"{', '.join(safe)}: the device itself has made it safe; its watchdog expired, or it was told to"
            )
        for name, register, words in self._read_back():
            if name in self._driven and not register.stands(words, self._driven[name], self._order):
                stands, driven = (register.value_of(w, self._order) for w in (words, self._driven[name]))
                unit = behind_a_number(register.unit)
                raise LinkError(
                    f"{name} stands at {stands:.4g}{unit}, not at {driven:.4g} as it was driven: the device "
                    f"restarted, its watchdog expired, or another master writes to it"
                )

    def _watchdog_has_not_expired(self) -> None:
        if self._driven:
            self._watchdog.check()

    def _measured(self, name: str, register: Register, words: Sequence[int], flags: Mapping[Flag, bool]) -> float:
        """A reading, NaN when it is none.

        Raises:
            LinkError: it is none from the first on, and something is to be run: the bench file is wrong, or the sensor
                dead.
        """
        why = register.said_invalid(words, self._order)
        why = why or next((flag.means or "its status says so" for flag in register.status if flags[flag]), None)
        said = register.value_of(words, self._order)
        value = math.nan if why else register.measured(said, self._before.get(name))
        if math.isnan(value):
            cause = why or f"a dead sensor, or check word_order (now {self._order})"
            if name not in self._before and not self._looked_at:
                raise LinkError(f"{name} reads {said:.3g} {register.unit}, no measurement: {cause}")
            self.unmeasured[name] = why or f"reads {said:.3g} {register.unit}: {cause}"
        self._before[name] = value
        return value

    def _ask(self, function: int, address: int, *, count: int = 1, values: Sequence[int] = ()) -> list[int]:
        return self._line.ask(function, address, count=count, values=values)

    @property
    def _client(self) -> Any:
        return self._line.client
