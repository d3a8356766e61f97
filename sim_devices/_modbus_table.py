"""A Modbus device that is nothing but a table of registers, for twins of simple modules."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sim_devices._field import Side
from sim_devices._modbus_bank import Bank
from sim_devices._modbus_frames import Refused, RtuFrames, TcpFrames
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer, TcpServer, serve_stream


@dataclass(frozen=True, slots=True)
class Place:
    """A terminal in a register: count = value · per_unit + zero; two's complement if it is `signed`."""

    terminal: str
    per_unit: float
    zero: float = 0.0
    signed: bool = False

    def count_of(self, value: float) -> int:
        """The value as the register has it."""
        count = round(value * self.per_unit + self.zero)
        return max(-0x8000, min(0x7FFF, count)) & 0xFFFF if self.signed else max(0, min(0xFFFF, count))

    def value_of(self, count: int) -> float:
        """What the register says."""
        return ((count - 0x10000 if self.signed and count >= 0x8000 else count) - self.zero) / self.per_unit


@dataclass(frozen=True, slots=True)
class Timer:
    """A watchdog that is armed over the wire: the holding register of its time, and counts in a second.

    `safe` are registers with the counts to which outputs go, by address of the output.
    """

    register: int
    per_second: float
    safe: Mapping[int, int] = field(default_factory=dict)


class Table(Bank):
    """Registers of a device as its manual lists them.

    Args:
        side: its terminals.
        outputs: by address among the holding registers (functions 3, 6, 16).
        inputs: by address among the input registers (function 4).
        watchdog_s: outputs go to `safe` when nothing is asked for so long, as somebody set it at the device itself;
            None: nobody did. A twin of a device that its driver arms has a `timer` instead: one that is armed whatever
            the driver does says nothing about the driver.
        safe: count to which they go then.
        timer: its watchdog, where the driver arms it.
    """

    def __init__(
        self,
        side: Side,
        outputs: Mapping[int, Place],
        inputs: Mapping[int, Place],
        watchdog_s: float | None = None,
        safe: int = 0,
        timer: Timer | None = None,
    ) -> None:
        super().__init__(side)
        self._outputs, self._inputs = outputs, inputs
        self._watchdog_s, self._timer = watchdog_s, timer
        self._safe = dict.fromkeys(outputs, safe)
        self._settable = {register: output for output, register in timer.safe.items()} if timer else {}
        self._counts = {address: place.count_of(side.standing(place.terminal)) for address, place in outputs.items()}
        self._heard_s: float | None = None

    def input(self, address: int) -> int:
        """An input register."""
        if address not in self._inputs:
            raise Refused(2)
        place = self._inputs[address]
        return place.count_of(self.side.number(place.terminal))

    def holding(self, address: int) -> int:
        """An output, as it stands."""
        if address in self._settable:
            return self._safe[self._settable[address]]
        if self._timer is not None and address == self._timer.register:
            return round((self._watchdog_s or 0.0) * self._timer.per_second)
        if address not in self._outputs:
            raise Refused(2)
        return self._counts[address]

    def may_write(self, address: int, count: int) -> None:
        """Any count, where there is an output or a register of the watchdog."""
        known = {*self._outputs, *self._settable} | ({self._timer.register} if self._timer else set())
        if address not in known or not 0 <= count <= 0xFFFF:
            raise Refused(2)

    def write(self, address: int, count: int) -> None:
        """Set an output, or the watchdog."""
        if address in self._settable:
            self._safe[self._settable[address]] = count
            return
        if self._timer is not None and address == self._timer.register:
            self._watchdog_s = count / self._timer.per_second if count else None
            return
        self._counts[address] = count
        place = self._outputs[address]
        self.side.drive({place.terminal: place.value_of(count)})

    def heard(self) -> None:
        """A request came."""
        self._heard_s = self.side.clock.now_s

    def restart(self) -> None:
        """Outputs at their safe count; what was armed over the wire is not any more."""
        self._make_safe()
        if self._timer is not None:
            self._watchdog_s = None

    def tick(self) -> None:
        """Look at the watchdog."""
        since_s = self._heard_s
        if self._watchdog_s is not None and since_s is not None and self.side.clock.now_s - since_s > self._watchdog_s:
            self._heard_s = None
            self._make_safe()

    def _make_safe(self) -> None:
        for address in self._outputs:
            self.write(address, self._safe[address])


def serve_registers(registers: Any, settings: Mapping[str, Any], side: Side, quirks: Quirks) -> StreamServer:
    """Serve registers where a driver's settings (`transport`, `address`, `unit_id`) will look for them."""
    unit_id, address = int(settings.get("unit_id", 1)), str(settings["address"])
    if settings.get("transport", "tcp") == "tcp":
        host, _, port = address.rpartition(":")
        return TcpServer(TcpFrames(registers, unit_id), side, quirks, host, int(port))
    return serve_stream(RtuFrames(registers, unit_id), side, quirks, address)
