"""Nodes on CANopen by their EDS or DCF, with a plant behind their objects; the twin of the driver."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

from hil.description.canopen import CanopenDescription, CanopenTerminal
from hil.description.named import description_of
from sim_devices._can_bus import CanServer
from sim_devices._canopen_node import CanopenNode, Place
from sim_devices._eds import objects_of
from sim_devices._field import Side
from sim_devices._quirks import Quirks
from sim_devices._twin import Twin, TwinSettings, named_in, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]


class DescribedNode(CanopenNode):
    """Objects of a file, some of which are terminals.

    When it misses the master's heartbeat its outputs go where the description says, with an emergency.
    """

    def __init__(self, side: Side, description: CanopenDescription, node: int) -> None:
        self._description = description
        self._terminals = description.by_name
        self._outputs = self._by_place("out")
        self._inputs = self._by_place("in")
        super().__init__(side, node, objects_of(description.eds, node))

    def power_on(self) -> None:
        """Outputs at the values of the file, or as near zero as they come."""
        super().power_on()
        for place, names in self._outputs.items():
            for name in names:
                low, high = self._terminals[name].range
                self._goes_to(place, name, min(max(0.0, low), high))

    def value(self, index: int, sub: int) -> float:
        """Terminals as they are now, in an object as it was written."""
        value, form = super().value(index, sub), self.objects[index, sub][0]
        for name in self._inputs.get((index, sub), ()):
            terminal = self._terminals[name]
            if form == "f":
                value = (self.side.read().get(name, 0.0) - terminal.offset) / terminal.slope
            else:
                value = _laid(terminal, value, _counted(terminal, self.side.number(name), form), form)
        return value

    def store(self, index: int, sub: int, value: float) -> None:
        """Outputs move; those whose bits stay stay."""
        super().store(index, sub, value)
        for name in self._outputs.get((index, sub), ()):
            terminal = self._terminals[name]
            self.side.drive(
                {name: _taken(terminal, value, self.objects[index, sub][0]) * terminal.slope + terminal.offset}
            )

    def missed_heartbeat(self) -> None:
        """Outputs go where they are safe, and it says so."""
        if self._description.watchdog is None:
            return
        for place, names in self._outputs.items():
            for name in names:
                self._goes_to(place, name, self._description.watchdog.expires_to)
        self.unsent.append((0x080 + self.node, struct.pack("<HB5x", 0x8130, 0x11)))

    def _goes_to(self, place: tuple[int, int], name: str, value: float) -> None:
        terminal, form = self._terminals[name], self.objects[place][0]
        number = (value - terminal.offset) / terminal.slope
        if form != "f":
            number = _laid(terminal, self.values[place], _counted(terminal, value, form), form)
        self.values[place] = number
        self.side.drive({name: value})

    def _by_place(self, direction: str) -> dict[Place, list[str]]:
        found: dict[Place, list[str]] = {}
        for name, terminal in self._terminals.items():
            if terminal.direction == direction:
                found.setdefault(terminal.place, []).append(name)
        return found


def _is_signed(terminal: CanopenTerminal, form: str) -> bool:
    return form.islower() and terminal.bit is None and (terminal.bits is None or terminal.bits[0] < terminal.bits[1])


def _width(terminal: CanopenTerminal, form: str) -> int:
    if terminal.bit is not None:
        return 1
    return 8 * struct.calcsize(form) if terminal.bits is None else terminal.bits[1] + 1 - terminal.bits[0]


def _lowest(terminal: CanopenTerminal) -> int:
    return terminal.bit or (0 if terminal.bits is None else terminal.bits[0])


def _laid(terminal: CanopenTerminal, value: float, count: int, form: str) -> int:
    """What an object says with this count in the terminal's bits."""
    size, at, n = struct.calcsize(form), _lowest(terminal), _width(terminal, form)
    bits = f"{int.from_bytes(struct.pack('>' + form, int(value)), 'big'):0{8 * size}b}"
    end = len(bits) - at
    bits = bits[: end - n] + f"{count % (1 << n):0{n}b}" + bits[end:]
    return int(struct.unpack(">" + form, int(bits, 2).to_bytes(size, "big"))[0])


def _taken(terminal: CanopenTerminal, value: float, form: str) -> float:
    """The terminal's count in what an object says."""
    if form == "f":
        return value
    n = _width(terminal, form)
    count = (int(value) >> _lowest(terminal)) % (1 << n)
    return count - (1 << n) if _is_signed(terminal, form) and 2 * count >= 1 << n else count


def _counted(terminal: CanopenTerminal, value: float, form: str) -> int:
    number = (value - terminal.offset) / terminal.slope
    width = _width(terminal, form)
    low, high = (-(1 << width - 1), (1 << width - 1) - 1) if _is_signed(terminal, form) else (0, (1 << width) - 1)
    if math.isnan(number):
        none = next((int(count, 0) for count in terminal.invalid if count.lower() != "nan"), 0)
        return none if none <= high else none - (1 << width)
    return max(low, min(high, round(number)))


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> CanServer:
    """Serve the node on the bus where the driver will look for it."""
    node = DescribedNode(side, description_of(named_in(settings), "canopen"), int(settings.get("node") or 1))
    return CanServer(node, side, behave, str(settings["address"]))


_twin = Twin("canopen", serve, example="virtual:hil", free="virtual:hil")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
