"""PWM current amplifiers on Modbus, with a coil and its valve behind them; the twin of the driver (map of our own)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.daq.channel import Pwm
from sim_devices._field import Side
from sim_devices._modbus_bank import Bank
from sim_devices._modbus_frames import Refused
from sim_devices._modbus_table import serve_registers
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer
from sim_devices._twin import Twin, TwinSettings, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]

_MOST = {0: 3000, 1: 5000, 2: 5000, 3: 500, 4: 65535}  # of each holding register
_POWER_ON = {0: 0, 1: 1000, 2: 0, 3: 0, 4: 0}
_EXPIRED = 0b0001


class Amplifier(Bank):
    """Holding registers: set current, carrier, dither frequency and amplitude, watchdog; input: coil, status.

    When the watchdog expires the current is zero and stays so, with a bit in the status, until the watchdog is set
    anew. After power-on there is no dither.

    Attributes:
        status: its faults, one bit each.
    """

    def __init__(self, side: Side) -> None:
        super().__init__(side)
        self.status = 0
        self._held = {**_POWER_ON, 0: round(1000.0 * side.standing("current"))}
        self._modulate()

    def input(self, address: int) -> int:
        """What it measures at the coil, and its status."""
        if address == 2:
            return self.status
        scaled = {0: ("coil current", 1000.0), 1: ("coil voltage", 100.0)}
        if address not in scaled:
            raise Refused(2)
        terminal, per_unit = scaled[address]
        return max(0, min(0xFFFF, round(self.side.number(terminal) * per_unit)))

    def holding(self, address: int) -> int:
        """What was set."""
        if address not in self._held:
            raise Refused(2)
        return self._held[address]

    def may_write(self, address: int, count: int) -> None:
        """Within its range; no current while the watchdog stands expired."""
        if address not in _MOST:
            raise Refused(2)
        if count > _MOST[address] or (address == 1 and count < 100):
            raise Refused(3)
        if address == 0 and count and self.status & _EXPIRED:
            raise Refused(4)

    def write(self, address: int, count: int) -> None:
        """Set a register; it takes effect at once."""
        self._held[address] = count
        if address == 0:
            self.side.drive({"current": 1e-3 * count})
        elif address == 4:
            self.status &= ~_EXPIRED
        else:
            self._modulate()

    def restart(self) -> None:
        """No current, no dither, no watchdog."""
        self._held, self.status = dict(_POWER_ON), 0
        self.side.drive({"current": 0.0})
        self._modulate()

    def tick(self) -> None:
        """No current when nothing was asked for the watchdog's time."""
        if self._held[4] and self.silent_s > 0.1 * self._held[4] and not self.status & _EXPIRED:
            self.status |= _EXPIRED
            self.write(0, 0)

    def _modulate(self) -> None:
        tenths_hz = self._held[2]
        self.side.modulate("current", Pwm(self._held[1], 0.1 * tenths_hz if tenths_hz else None, 1e-3 * self._held[3]))


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> StreamServer:
    """Serve the amplifier where the driver will look for it."""
    return serve_registers(Amplifier(side), settings, side, behave)


_twin = Twin("pwm_amplifier", serve, example="127.0.0.1:1502", free="127.0.0.1:0")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
