"""An auxiliary valve on J1939/ISOBUS with a plant behind it; the twin of the driver."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from sim_devices._can_bus import Frame, serve_node
from sim_devices._field import Side
from sim_devices._twin import offered

_EVERY_S = 0.1
_FUNCTION = 129  # auxiliary valve control
_NOT_ACKNOWLEDGED = 1  # control byte of the group 0xE800


class Valve:
    """A valve that obeys its command, tells the flow that it estimates, and blocks when it hears nothing.

    It claims its address and defends it; when a smaller NAME takes it, it says so once and does nothing any more.

    Args:
        side: its terminals, `flow command` and `estimated flow` in %.
        number: of the valve, 0 … 15.
        address: of its controller.
        patience_s: without a command for so long it goes to its fail-safe state.
    """

    answers_by_itself = True

    def __init__(self, side: Side, number: int, address: int, patience_s: float) -> None:
        self._side, self._number, self._address, self._patience_s = side, number, address, patience_s
        self._heard_s = self._sent_s = side.clock.now_s
        self._state = 0
        self._name = 2 << 60 | _FUNCTION << 40 | number
        self._claimed, self._silenced = False, False

    def on_frame(self, identifier: int, data: bytes) -> Iterator[Frame]:
        """A command is obeyed, and answered with the flow that follows from it."""
        yield from self._management(identifier, data)
        if (identifier >> 8) & 0x3FFFF != 0xFE30 + self._number or len(data) != 8 or self._silenced:
            return
        flow, state = data[0], data[2] & 0x0F
        if flow > 0xFA or state > 3:
            return
        self._heard_s = self._side.clock.now_s
        self._state = state
        self._drive({1: 0.4, 2: -0.4}.get(state, 0.0) * flow)
        yield self._estimate()

    def tick(self) -> Iterator[Frame]:
        """Flow each 100 ms; no flow when no command came."""
        now_s = self._side.clock.now_s
        if not self._claimed:
            self._claimed = True
            yield self._claim()
        if now_s - self._heard_s > self._patience_s and self._state:
            self._state = 0
            self._drive(0.0)
        if now_s - self._sent_s >= _EVERY_S and not self._silenced:
            self._sent_s = now_s
            yield self._estimate()

    def restart(self) -> None:
        """Blocked, its address claimed anew."""
        self._state = 0
        self._claimed, self._silenced = False, False
        self._drive(0.0)

    def _management(self, identifier: int, data: bytes) -> Iterator[Frame]:
        """What it says to a request for its address, and to one who claims the same."""
        group, to, source = identifier >> 16 & 0x3FF, identifier >> 8 & 0xFF, identifier & 0xFF
        if group == 0xEA and to in (self._address, 0xFF) and len(data) == 3:
            yield from self._requested(int.from_bytes(data, "little"), source, to)
        elif group == 0xEE and source == self._address and len(data) == 8 and not self._silenced:
            self._silenced = int.from_bytes(data, "little") < self._name
            if self._silenced:
                self._state = 0
                self._drive(0.0)
            yield self._claim()

    def _requested(self, group: int, source: int, to: int) -> Iterator[Frame]:
        """What was asked for; one who asks it alone for what it does not have is told so (SAE J1939-21, 5.4.4)."""
        if group == 0xEE00:
            yield self._claim()
        elif group == 0xFE10 + self._number and not self._silenced:
            yield self._estimate()
        elif to != 0xFF and not self._silenced:
            refused = bytes([_NOT_ACKNOWLEDGED, 0xFF, 0xFF, 0xFF, source]) + group.to_bytes(3, "little")
            yield 0x18E8FF00 | self._address, refused

    def _claim(self) -> Frame:
        source = 0xFE if self._silenced else self._address
        return 0x18EEFF00 | source, self._name.to_bytes(8, "little")

    def _drive(self, percent: float) -> None:
        self._side.drive({"flow command": percent})

    def _estimate(self) -> Frame:
        percent = max(-125.0, min(125.0, self._side.number("estimated flow")))
        extend = round(percent) + 125
        return 3 << 26 | 0xFE10 + self._number << 8 | self._address, bytes(
            [extend, 250 - extend, 0b0011_0000 | self._state, 0b0001_1111, *[0xFF] * 4]
        )


def _valve(settings: Mapping[str, Any], side: Side) -> Valve:
    number, address = int(settings.get("valve", 1)), int(settings.get("device", 0x80))
    valve = Valve(side, number, address, float(settings.get("watchdog_s", 0.3)))
    list(valve.tick())  # it has claimed its address before anybody listens
    return valve


Settings, faults, terminals, open_daq, serve, quirks, world = offered("j1939_valve", serve_node, _valve, "virtual:hil")
