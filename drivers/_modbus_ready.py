"""Whether a Modbus device lets its outputs obey: its faults cleared, watchdog armed, safe mode left, enabled."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from drivers._modbus_line import ModbusLine
from drivers._register_blocks import RegisterBlock
from drivers._registers import FUNCTIONS, Encoding
from hil.description.modbus import TIMES, Flag, ModbusDescription, Place, Write, safe_of
from hil.errors import LinkError
from hil.system import system

_LOOK_S = 0.02  # how often a flag is looked at that is waited for


class Readiness:
    """What a device's description says of it, asked and told on its line.

    Args:
        line: to the device.
        described: what it has, with addresses on the wire.
        registers: its terminals in them, by name.
        safe: where the bench has its outputs safe, by terminal.
        watchdog_s: time of its watchdog; None where it has none.
        out: its outputs as they are written.
    """

    def __init__(
        self, line: ModbusLine, described: ModbusDescription, registers: Mapping[str, Encoding],
        safe: Mapping[str, float], watchdog_s: float | None, out: Sequence[RegisterBlock],
    ) -> None:  # fmt: skip
        self._line, self._described, self._registers = line, described, registers
        self._safe, self._watchdog_s, self._out = safe, watchdog_s, out
        self._enabled = False

    def made(self, go_safe: Callable[[], None], look_around: Callable[[], None]) -> None:
        """Faults cleared, watchdog armed, outputs obeying: from the safe values on where they did not.

        Args:
            go_safe: writes the safe values.
            look_around: sees what else stands in registers that outputs share.

        Raises:
            LinkError: it reports a fault that cannot be cleared, or does not get ready.
        """
        self._clear_faults()
        if self._watchdog_s is not None and (watchdog := self._described.watchdog) is not None:
            self._do(watchdog.arm)
        self.no_fault()
        look_around()
        self._leave_safe_mode(go_safe)
        self._enable(go_safe)

    def undone(self) -> None:
        """Outputs that were enabled are so no longer, where the device has that."""
        if self._enabled:
            self._enabled = False
            self._do(self._described.enable.disable if self._described.enable else ())

    def no_fault(self) -> None:
        """Raise `LinkError` for a fault that the device reports."""
        if reported := self._reported():
            raise LinkError(f"the device reports a fault: {', '.join(reported)}")

    def in_safe_mode(self) -> list[str]:
        """Outputs that the device itself has made safe."""
        flagged: list[str] = []
        if (mode := self._described.safe_mode) is None:
            return flagged
        for block in self._out:
            flags = self._line.ask(1, self._of_output(mode.status, block.first), count=block.count)
            flagged += [name for name, flag in zip(block.terminals, flags, strict=False) if flag]
        return flagged

    def flags(self, flags: Iterable[Flag]) -> dict[Flag, bool]:
        """What flags say, each register asked once."""
        words: dict[tuple[str, int], int] = {}
        states: dict[Flag, bool] = {}
        for flag in flags:
            place = str(flag.table), flag.address
            if place not in words:
                (words[place],) = self._line.ask(FUNCTIONS[place[0]], flag.address)
            states[flag] = flag.is_so(words[place])
        return states

    def _do(self, steps: Iterable[Write]) -> None:
        """Write what stands in a description, its placeholders filled in."""
        for step in steps:
            words = self._filled(step.value)
            if words and step.table == "coil":
                self._line.ask(5, step.address, values=words)
            elif words:
                self._line.ask(6 if len(words) == 1 else 16, step.address, values=words)

    def _filled(self, value: int | str) -> list[int]:
        if isinstance(value, int):
            return [value]
        if value in TIMES:
            return [max(1, round(TIMES[value] * (self._watchdog_s or 0.0)))]
        terminal = safe_of(value)
        return self._registers[terminal].words_of(self._safe[terminal]) if terminal in self._safe else []

    def _clear_faults(self) -> None:
        """Clear what the device reports, and see that it is gone.

        Raises:
            LinkError: it is not.
        """
        faults = self._described.faults
        if faults is None or not faults.clear or not (reported := self._reported()):
            return
        self._do(faults.clear)
        if not self._waited(lambda: not self._reported(), faults.patience_s):
            raise LinkError(f"the device reports a fault and cannot be cleared: {', '.join(reported)}")

    def _enable(self, go_safe: Callable[[], None]) -> None:
        """Have the outputs obey, unless they do already: they stand at their safe values when they begin to.

        Raises:
            LinkError: the device does not get ready.
        """
        enable = self._described.enable
        if enable is None:
            return
        ready = enable.ready
        if enable.write and not (ready is not None and self._is_so(ready)):
            go_safe()
            self._do(enable.write)
            if ready is not None and not self._waited(lambda: self._is_so(ready), enable.patience_s):
                raise LinkError(
                    f"the outputs do not obey {enable.patience_s:g} s after they were enabled: "
                    f"{ready.table} {ready.address:#06x} does not say {ready.means or 'that they are ready'}"
                )
        self._enabled = bool(enable.disable)

    def _leave_safe_mode(self, go_safe: Callable[[], None]) -> None:
        """A device that made its outputs safe in an earlier run takes commands again, from the safe values on."""
        mode = self._described.safe_mode
        if mode is None or not self.in_safe_mode():
            return
        go_safe()
        for block in self._out:
            for register in block.terminals.values():
                self._line.ask(5, self._of_output(mode.clear, register.address), values=[1])

    def _of_output(self, first: Place, address: int) -> int:
        """The coil of the output at an address, in a row of coils that begins with that of the first output."""
        return first.address + address - min(self._registers[name].address for name in self._described.outputs)

    def _reported(self) -> list[str]:
        """What of its faults the device reports, in words."""
        reports = self._described.faults.flags if self._described.faults else ()
        flags = self.flags(reports)
        return [flag.means or f"{flag.table} {flag.address:#06x}" for flag in reports if flags[flag]]

    def _is_so(self, flag: Flag) -> bool:
        return self.flags([flag])[flag]

    @staticmethod
    def _waited(is_so: Callable[[], bool], patience_s: float) -> bool:
        until_s = system.now_s() + patience_s
        while not is_so():
            if system.now_s() > until_s:
                return False
            system.sleep(_LOOK_S)
        return True
