"""Modbus devices on TCP or a serial line, with a plant behind their registers; the twin of the driver."""

# ruff: noqa: ARG002 - a bank of registers says what it refuses by methods that do nothing else

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

from sim_devices._field import Side
from sim_devices._modbus_frames import COMMON, Refused
from sim_devices._modbus_table import serve_registers
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer
from sim_devices._twin import Twin, TwinSettings, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]


class Bank:
    """The registers of a device as its manual lists them. An address that is not served is refused.

    Attributes:
        functions: those that its manual lists, by their codes.
    """

    functions = COMMON

    def __init__(self, side: Side, _settings: Mapping[str, Any]) -> None:
        self.side = side
        self.silent_since_s = side.clock.now_s

    def input(self, address: int) -> int:
        """An input register."""
        raise Refused(2)

    def holding(self, address: int) -> int:
        """A holding register."""
        raise Refused(2)

    def output(self, address: int) -> int:
        """What a write to a holding register changes."""
        return self.holding(address)

    def coil(self, address: int) -> bool:
        """A coil."""
        raise Refused(2)

    def discrete(self, address: int) -> bool:
        """A discrete input."""
        raise Refused(2)

    def write(self, address: int, count: int) -> None:
        """Write a holding register."""
        raise Refused(2)

    def write_coil(self, address: int, on: bool) -> None:
        """Write a coil."""
        raise Refused(2)

    def may_write(self, address: int, count: int) -> None:
        """Refuse what `write` would refuse, before anything of a request is written."""
        raise Refused(2)

    def restart(self) -> None:
        """Outputs and watchdog as after power-on."""

    def heard(self) -> None:
        """A valid request came."""
        self.silent_since_s = self.side.clock.now_s

    def tick(self) -> None:
        """Look at the watchdog."""

    @property
    def silent_s(self) -> float:
        """How long nothing was asked."""
        return self.side.clock.now_s - self.silent_since_s


class Wago750(Bank):
    """750-352 with four outputs and four inputs of ±10 V; the alternative watchdog (0x100A) sets outputs to zero.

    There is no digital module behind it, so functions for bits find no address.
    """

    functions = COMMON | {11, 22, 23}

    _FULL = 0x7FFF

    def __init__(self, side: Side, settings: Mapping[str, Any]) -> None:
        super().__init__(side, settings)
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


class IoLogikE1241(Bank):
    """Four outputs of 0 … 10 V in 12 bit; its watchdog makes them safe until that is cleared, output by output.

    Its watchdog and the level to which outputs then go are set at the device: `watchdog_s`, `watchdog_level`.
    """

    def __init__(self, side: Side, settings: Mapping[str, Any]) -> None:
        super().__init__(side, settings)
        self._timeout_s = settings.get("watchdog_s")
        self._level = float(settings.get("watchdog_level") or 0.0)
        self._counts = [round(side.standing(f"ao{i}") * 409.5) for i in range(4)]
        self._safe = [False] * 4

    def holding(self, address: int) -> int:
        """The raw value of an output."""
        if not 0x0400 <= address < 0x0404:
            raise Refused(2)
        return self._counts[address - 0x0400]

    def coil(self, address: int) -> bool:
        """Safe status of an output."""
        if not 0x1010 <= address < 0x1014:
            raise Refused(2)
        return self._safe[address - 0x1010]

    def may_write(self, address: int, count: int) -> None:
        """Four outputs of 12 bit."""
        if not 0x0400 <= address < 0x0404:
            raise Refused(2)
        if count > 4095:
            raise Refused(3)

    def write(self, address: int, count: int) -> None:
        """An output; it takes effect once the output is no longer in safe mode."""
        self._counts[address - 0x0400] = count
        self._drive(address - 0x0400)

    def write_coil(self, address: int, on: bool) -> None:
        """Clear the safe mode of an output."""
        if not 0x1020 <= address < 0x1024:
            raise Refused(2)
        if on:
            self._safe[address - 0x1020] = False
            self._drive(address - 0x1020)

    def restart(self) -> None:
        """Every output zero."""
        self._counts, self._safe = [0] * 4, [False] * 4
        self.side.drive({f"ao{i}": 0.0 for i in range(4)})

    def tick(self) -> None:
        """Outputs go to the level that was set, and stay there, when nothing was asked for the watchdog's time."""
        if self._timeout_s is not None and self.silent_s > self._timeout_s and not all(self._safe):
            self._safe = [True] * 4
            self.side.drive({f"ao{i}": self._level for i in range(4)})

    def _drive(self, i: int) -> None:
        if not self._safe[i]:
            self.side.drive({f"ao{i}": self._counts[i] / 409.5})


class IoLogikE1240(Bank):
    """Eight inputs of 0 … 10 V in 16 bit."""

    def input(self, address: int) -> int:
        """The raw value of an input."""
        if address >= 8:
            raise Refused(2)
        volts = self.side.number(f"ai{address}")
        return max(0, min(0xFFFF, round(volts * 6553.5)))


class FlowMeter(Bank):
    """Flow and temperature as floats, two input registers each."""

    def __init__(self, side: Side, settings: Mapping[str, Any]) -> None:
        super().__init__(side, settings)
        self._low_first = settings.get("word_order") == "little"

    def input(self, address: int) -> int:
        """Half of a float."""
        if address >= 4:
            raise Refused(2)
        value = self.side.read().get(("flow", "temperature")[address // 2], 0.0)
        high, low = struct.unpack(">HH", struct.pack(">f", value))
        first_is_low = self._low_first != self.side.quirks.word_order
        return int((low, high)[address % 2] if first_is_low else (high, low)[address % 2])


_BANKS: Mapping[str, type[Bank]] = {
    "wago-750": Wago750,
    "iologik-e1241": IoLogikE1241,
    "iologik-e1240": IoLogikE1240,
    "flow-meter": FlowMeter,
}


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> StreamServer:
    """Serve the device where the driver will look for it."""
    return serve_registers(_BANKS[settings["model"]](side, settings), settings, side, behave)


def _to_word(value: int) -> int:
    return value & 0xFFFF


def _from_word(count: int) -> int:
    return count - 0x10000 if count >= 0x8000 else count


_twin = Twin("modbus", serve, example="127.0.0.1:1502", free="127.0.0.1:0")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
