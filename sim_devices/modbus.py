"""Modbus devices on TCP or a serial line, with a plant behind their registers; the twin of the driver.

A device is what its description says; the coupler has more than a description can say, and is written after its manual.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sim_devices._field import Side
from sim_devices._modbus_bank import Bank
from sim_devices._modbus_described import DescribedBank
from sim_devices._modbus_frames import COMMON, Refused
from sim_devices._modbus_table import serve_registers
from sim_devices._twin import described_in, offered


class Wago750(Bank):
    """750-352 with four outputs and four inputs of ±10 V; the alternative watchdog (0x100A) sets outputs to zero.

    There is no digital module behind it, so functions for bits find no address.
    """

    functions = COMMON | {11, 22, 23}

    _FULL = 0x7FFF

    def __init__(self, side: Side) -> None:
        super().__init__(side)
        self._outputs = [_to_word(round(side.standing(f"ao{i}") * self._FULL / 10.0)) for i in range(4)]
        self._time, self._armed, self._status = 100, 0, 0

    def input(self, address: int) -> int:
        """The process image: four analogue inputs, and above 0x0200 the outputs."""
        if 0x0200 <= address < 0x0204:
            return self._outputs[address - 0x0200]
        if address >= 4:
            raise Refused(2)
        volts = self.side.number(f"ai{address}")
        return _to_word(max(-self._FULL, min(self._FULL, round(volts * self._FULL / 10.0))))

    def holding(self, address: int) -> int:
        """As by function 4, and the registers of the watchdog."""
        special = {0x1000: self._time, 0x1006: self._status, 0x100A: self._armed}
        return special[address] if address in special else self.input(address)

    def output(self, address: int) -> int:
        """An output at the address where it is written; read there is an input."""
        return self._outputs[address] if address < 4 else self.holding(address)

    def may_write(self, address: int, count: int) -> None:
        """Four outputs and the watchdog; its time may be changed only while it is off."""
        if address not in (*range(4), 0x1000, 0x1008, 0x100A):
            raise Refused(2)
        if (address == 0x1000 and self._status == 1) or (address == 0x1008 and count not in (0x55AA, 0xAA55)):
            raise Refused(3)

    def write(self, address: int, count: int) -> None:
        """An output, or a register of the watchdog."""
        if address < 4:
            self._outputs[address] = count
            self.side.drive({f"ao{address}": _from_word(count) * 10.0 / self._FULL})
        elif address == 0x1000:
            self._time = count
        elif address == 0x1008:
            self._status = 0
        else:
            self._armed = count
            self._status = 0 if count == 0 else self._status

    def restart(self) -> None:
        """Outputs zero, watchdog off."""
        self._time, self._armed, self._status = 100, 0, 0
        self._zero()

    def heard(self) -> None:
        """The alternative watchdog starts with the first request, and again after it has expired."""
        super().heard()
        if self._armed:
            self._status = 1

    def tick(self) -> None:
        """Outputs go to zero when nothing was asked for the watchdog's time."""
        if self._status == 1 and self.silent_s > 0.1 * self._time:
            self._status = 2
            self._zero()

    def _zero(self) -> None:
        self._outputs = [0] * 4
        self.side.drive({f"ao{i}": 0.0 for i in range(4)})


def _bank(settings: Mapping[str, Any], side: Side) -> Bank:
    if settings.get("model") == "wago-750":
        return Wago750(side)
    return DescribedBank(side, described_in(settings, "modbus"), settings)


def _to_word(value: int) -> int:
    return value & 0xFFFF


def _from_word(count: int) -> int:
    return count - 0x10000 if count >= 0x8000 else count


Settings, faults, terminals, open_daq, serve, quirks, world = offered("modbus", serve_registers, _bank, "127.0.0.1:0")
