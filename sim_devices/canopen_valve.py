"""A proportional valve on CANopen after CiA 408, with a plant behind its spool; the twin of the driver.

Written after the profile and CiA 301 without the library that the driver uses, so that they share no mistake.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

from sim_devices._can_bus import serve_node
from sim_devices._canopen_node import Abort, CanopenNode
from sim_devices._eds import objects_of
from sim_devices._field import Side
from sim_devices._twin import offered

_FULL = 16384
_INIT, _DISABLED, _HOLD, _ACTIVE, _FAULT_HOLD = 0b1000, 0b1001, 0b1011, 0b1111, 0b0011
_STEPS = {  # what the low three bits of the control word ask for, from where it is reached
    0b000: (_INIT, (_DISABLED,)),
    0b001: (_DISABLED, (_INIT, _HOLD)),
    0b011: (_HOLD, (_DISABLED, _ACTIVE)),
    0b111: (_ACTIVE, (_HOLD,)),
}

_MAPPED = 4  # entries of a mapping at most
_EDS = Path(__file__).with_suffix(".eds")  # identifiers are those of the predefined connection set


class Valve(CanopenNode):
    """A node with the state machine of the profile.

    Only in ACTIVE the set point, through its ramp if one is set, moves the spool; in HOLD it is the hold set point,
    in every other state the spool stands at its fail-safe position. A missed heartbeat of the master is a fault.

    Args:
        side: its terminals, `set point` and `actual value` in %.
        node: its number.
    """

    def __init__(self, side: Side, node: int) -> None:
        self._state, self._word, self._spool = _INIT, 0, 0.0
        super().__init__(side, node, objects_of(str(_EDS), node), _MAPPED)

    def power_on(self) -> None:
        """In INIT, spool at its fail-safe position."""
        super().power_on()
        self._state, self._word, self._spool = _INIT, 0, 0.0
        self.side.drive({"set point": 0.0})

    def check(self, index: int, sub: int, value: float) -> None:
        """A set point within the reference value."""
        if index == 0x6300 and abs(value) > _FULL:
            raise Abort(0x06090030)  # value range
        super().check(index, sub, value)

    def value(self, index: int, sub: int) -> float:
        """Status word and actual value as they are now."""
        if index == 0x6041:
            return self._state
        if (index, sub) == (0x6301, 1):
            percent = self.side.number("actual value")
            return max(-0x8000, min(0x7FFF, round(percent * _FULL / 100.0)))
        return super().value(index, sub)

    def store(self, index: int, sub: int, value: float) -> None:
        """Control word and set points move the valve."""
        super().store(index, sub, value)
        if index == 0x6040:
            self._control(int(value))
        if index in (0x6040, 0x6300, 0x6314):
            self.goes_on(0.0)

    def missed_heartbeat(self) -> None:
        """A fault, from any state but one."""
        if self._state & 0b1000:
            self._state, self.values[0x1001, 0] = _FAULT_HOLD, 0x11
            self.unsent.append((0x080 + self.node, struct.pack("<HB5x", 0x8130, 0x11)))

    def goes_on(self, passed_s: float) -> None:
        """Bring the spool's demand to where state and ramp let it go."""
        active = self._state == _ACTIVE and self.values[0x6042, 0] == 1
        if active:
            wanted = 100.0 * self.values[0x6300, 1] / _FULL
        elif self._state in (_HOLD, _FAULT_HOLD):
            wanted = 100.0 * self.values[0x6314, 1] / _FULL
        else:
            wanted = 0.0
        ramp_s = self.values[0x6331, 1] / 1000.0 if active and self.values[0x6330, 0] else 0.0
        most = 100.0 * passed_s / ramp_s if ramp_s else math.inf
        self._spool += max(-most, min(most, wanted - self._spool))
        if self.side.standing("set point") != self._spool:
            self.side.drive({"set point": self._spool})

    def _control(self, word: int) -> None:
        before, self._word = self._word, word
        if not self._state & 0b1000:  # a fault; reset by a rising edge of bit 3
            if word & 0b1000 and not before & 0b1000:
                self._state = {0b001: _DISABLED, 0b011: _HOLD}.get(word & 0b111, _INIT)
                self.master_s, self.values[0x1001, 0] = math.inf, 0
            return
        state, origins = _STEPS.get(word & 0b111, (self._state, ()))
        if self._state in origins:
            self._state = state


Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "canopen_valve", serve_node, lambda settings, side: Valve(side, int(settings.get("node", 1))), "virtual:hil"
)
