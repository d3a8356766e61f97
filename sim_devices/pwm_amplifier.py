"""PWM current amplifiers on Modbus, with a coil and its valve behind them; the twin of the driver (map of our own)."""

from __future__ import annotations

from hil.daq.channel import Pwm
from sim_devices._field import Side
from sim_devices._modbus_described import DescribedBank
from sim_devices._modbus_frames import Refused
from sim_devices._modbus_table import serve_registers
from sim_devices._twin import described_in, offered

_MOST = {0: 3000, 1: 5000, 2: 5000, 3: 500}  # of each holding register that has a limit
_POWER_ON = {1: 1000, 2: 0, 3: 0}  # carrier, dither and its amplitude


class Amplifier(DescribedBank):
    """What its description says, and the holding registers of carrier, dither frequency and amplitude.

    When the watchdog expires the current is zero and stays so, with a bit in the status, until the watchdog is set
    anew. After power-on there is no dither.

    Attributes:
        status: other faults of its, one bit each.
    """

    def __init__(self, side: Side) -> None:
        super().__init__(side, described_in({"model": "pwm-amplifier"}, "modbus"), {})
        self.status, self._modulation = 0, dict(_POWER_ON)
        self._modulate()

    def input(self, address: int) -> int:
        """What it measures at the coil, and its status."""
        return super().input(address) | (self.status if address == 2 else 0)

    def holding(self, address: int) -> int:
        """What was set."""
        return self._modulation[address] if address in self._modulation else super().holding(address)

    def may_write(self, address: int, count: int) -> None:
        """Within its range; no current while the watchdog stands expired."""
        if address not in self._modulation:
            super().may_write(address, count)
        if count > _MOST.get(address, count) or (address == 1 and count < 100):
            raise Refused(3)
        if address == 0 and count and self._tripped:
            raise Refused(4)

    def write(self, address: int, count: int) -> None:
        """Set a register; it takes effect at once."""
        if address not in self._modulation:
            super().write(address, count)
            return
        self._modulation[address] = count
        self._modulate()

    def restart(self) -> None:
        """No current, no dither, no watchdog."""
        super().restart()
        self.status, self._modulation = 0, dict(_POWER_ON)
        self._modulate()

    def _modulate(self) -> None:
        carrier_hz, tenths_hz, peak_ma = self._modulation.values()
        self.side.modulate("current", Pwm(carrier_hz, 0.1 * tenths_hz if tenths_hz else None, 1e-3 * peak_ma))


Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "pwm_amplifier", serve_registers, lambda _, side: Amplifier(side), "127.0.0.1:0"
)
