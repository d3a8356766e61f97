"""A device on Modbus as a link: outputs driven and read back, inputs read, its watchdog, faults and enabling."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from drivers._edge import edge
from drivers._modbus_line import LineSettings, ModbusLine
from drivers._modbus_model import PER_SECOND, Model, Step, check_level, safe_of
from drivers._registers import Flag, Register, WordOrder
from drivers._start_up import once_started
from drivers._stretches import Stretch, stretches, written
from drivers._watchdog import DeviceWatchdog
from hil.daq.channel import Wiring
from hil.errors import LinkError

_CHECK_S = 0.5  # how often outputs are read back: another master, or a device that restarted
_LOOK_S = 0.02  # how often a flag is looked at that is waited for
_ADDRESSES = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}


@edge
class ModbusLink:
    """A device on Modbus (see `hil.daq.polled.Link`).

    Attributes:
        identity: maker, product and version as the device tells them (function 43/14), empty when it does not. Only
            asked on TCP.

    Raises:
        DeviceLostError: nothing answers at the address.
        LinkError: it reports a fault that cannot be cleared, or does not get ready.
    """

    def __init__(self, settings: LineSettings, wiring: Wiring, model: Model) -> None:
        if settings.watchdog_s is not None:
            check_level(model, wiring)
        self._watchdog = DeviceWatchdog(settings.watchdog_s)
        self.watchdog_s, self.keep_alive_s = self._watchdog.time_s, self._watchdog.keep_alive_s
        self._model = model
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
        self._enabled = False
        settings = settings.model_copy(
            update={"echo": settings.echo or (model.echo and settings.transport == "rtu"),
                    "pause_s": max(settings.pause_s, model.pause_s)}
        )  # fmt: skip
        self._line = ModbusLine(settings, self._watchdog.heard)
        try:
            once_started(settings.startup_s, lambda: self._reached(settings.startup_s))
            if wiring.outputs:  # a device whose inputs alone are read is left as it is
                self._made_ready()
            self.identity = self._line.identity()
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
        said: dict[str, tuple[int, ...]] = {}
        for stretch in self._in:
            said |= stretch.split(self._ask(stretch.function, stretch.first, count=stretch.count))
        flags = self._flags(flag for register in self._inputs.values() for flag in register.status)
        self._line.has_read = True
        self.unmeasured = {}
        readings = {name: self._measured(name, r, said[name], flags) for name, r in self._inputs.items()}
        if self._driven and time.monotonic() - self._checked_s > _CHECK_S:
            self._outputs_stand()
        return readings

    def close(self) -> None:
        """Close the connection; outputs that were enabled are so no longer where the device has that."""
        try:
            if self._enabled:
                self._enabled = False
                self._do(self._model.enabling.undo)
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

    def _made_ready(self) -> None:
        """Faults cleared, watchdog armed, outputs obeying: from the safe values on where they did not."""
        self._clear_faults()
        if self.watchdog_s is not None:
            self._do(self._model.arming)
        self._no_fault()
        self._look_around()
        self._leave_safe_mode()
        self._enable()

    def _do(self, steps: Iterable[Step]) -> None:
        """Write what stands in a description, its placeholders filled in."""
        for step in steps:
            words = self._filled(step.value)
            if words and step.table == "coil":
                self._ask(5, step.address, values=words)
            elif words:
                self._ask(6 if len(words) == 1 else 16, step.address, values=words)

    def _filled(self, value: int | str) -> list[int]:
        if isinstance(value, int):
            return [value]
        if value in PER_SECOND:
            return [max(1, round(PER_SECOND[value] * (self.watchdog_s or 0.0)))]
        terminal = safe_of(value)
        return (
            self._model.registers[terminal].words_of(self._safe[terminal], self._order)
            if terminal in self._safe
            else []
        )

    def _clear_faults(self) -> None:
        """Clear what the device reports, and see that it is gone.

        Raises:
            LinkError: it is not.
        """
        if not self._model.clear or not (told := self._reported()):
            return
        self._do(self._model.clear)
        if not self._waited(lambda: not self._reported(), self._model.clear_patience_s):
            raise LinkError(f"the device reports a fault and cannot be cleared: {', '.join(told)}")

    def _no_fault(self) -> None:
        """Raise `LinkError` for a fault that the device reports."""
        if told := self._reported():
            raise LinkError(f"the device reports a fault: {', '.join(told)}")

    def _enable(self) -> None:
        """Have the outputs obey, unless they do already: they stand at their safe values when they begin to.

        Raises:
            LinkError: the device does not get ready.
        """
        enabling = self._model.enabling
        if enabling.steps and not (enabling.ready is not None and self._is_so(enabling.ready)):
            for stretch, words in self._words(self._safe):
                self._ask(stretch.writing, stretch.first, values=words)
            self._do(enabling.steps)
            ready = enabling.ready
            if ready is not None and not self._waited(lambda: self._is_so(ready), enabling.patience_s):
                raise LinkError(
                    f"the outputs do not obey {enabling.patience_s:g} s after they were enabled: "
                    f"{ready.table} {ready.address:#06x} does not say {ready.means or 'that they are ready'}"
                )
        self._enabled = bool(enabling.undo)

    def _leave_safe_mode(self) -> None:
        """A device that made its outputs safe in an earlier run takes commands again, from the safe values on."""
        if self._model.safe_status is None or self._model.clear_safe is None or not self._in_safe_mode():
            return
        for stretch, words in self._words(self._safe):
            self._ask(stretch.writing, stretch.first, values=words)
        for stretch in self._out:
            for register in stretch.terminals.values():
                self._ask(5, self._model.clear_safe + register.address - self._first_output, values=[1])

    def _look_around(self) -> None:
        """Registers that hold more than an output: what else stands there is written back as it is."""
        for stretch in self._out:
            if stretch.has_parts:
                words = self._ask(stretch.read_back_function, stretch.read_back, count=stretch.count)
                self._around[stretch.first] = words

    @property
    def _first_output(self) -> int:
        return min(r.address for r in self._model.outputs.values())

    def _in_safe_mode(self) -> list[str]:
        """Outputs that the device itself has made safe."""
        flagged: list[str] = []
        if self._model.safe_status is None:
            return flagged
        for stretch in self._out:
            flags = self._ask(1, self._model.safe_status + stretch.first - self._first_output, count=stretch.count)
            flagged += [name for name, flag in zip(stretch.terminals, flags, strict=False) if flag]
        return flagged

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
        self._no_fault()
        if safe := self._in_safe_mode():
            raise LinkError(
                f"{', '.join(safe)}: the device itself has made it safe; its watchdog expired, or it was told to"
            )
        for name, register, words in self._read_back():
            if name in self._driven and not register.stands(words, self._driven[name], self._order):
                stands, driven = (register.value_of(w, self._order) for w in (words, self._driven[name]))
                raise LinkError(
                    f"{name} stands at {stands:.4g} {register.unit}, not at {driven:.4g} as it was driven: the device "
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

    def _reported(self) -> list[str]:
        """What of its faults the device reports, in words."""
        flags = self._flags(self._model.faults)
        return [flag.means or f"{flag.table} {flag.address:#06x}" for flag in self._model.faults if flags[flag]]

    def _flags(self, flags: Iterable[Flag]) -> dict[Flag, bool]:
        """What flags say, each register asked once."""
        words: dict[tuple[str, int], int] = {}
        told: dict[Flag, bool] = {}
        for flag in flags:
            place = flag.table, flag.address
            if place not in words:
                (words[place],) = self._ask(_ADDRESSES[flag.table], flag.address)
            told[flag] = flag.is_so(words[place])
        return told

    def _is_so(self, flag: Flag) -> bool:
        return self._flags([flag])[flag]

    @staticmethod
    def _waited(is_so: Callable[[], bool], patience_s: float) -> bool:
        until_s = time.monotonic() + patience_s
        while not is_so():
            if time.monotonic() > until_s:
                return False
            time.sleep(_LOOK_S)
        return True

    def _ask(self, function: int, address: int, *, count: int = 1, values: Sequence[int] = ()) -> list[int]:
        return self._line.ask(function, address, count=count, values=values)

    @property
    def _client(self) -> Any:
        return self._line.client
