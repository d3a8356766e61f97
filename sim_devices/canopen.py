"""Nodes on CANopen by their EDS or DCF, with a plant behind their objects; the twin of the driver."""

from __future__ import annotations

import struct

from hil.description.canopen import CanopenDescription, CanopenTerminal
from hil.description.terminal import counts_of
from sim_devices._bits import Bits
from sim_devices._can_bus import serve_node
from sim_devices._canopen_node import CanopenNode, Place
from sim_devices._eds import objects_of
from sim_devices._field import Side, nearest_zero
from sim_devices._twin import described_in, offered


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
                self._goes_to(place, name, nearest_zero(*self._terminals[name].range))

    def value(self, index: int, sub: int) -> float:
        """Terminals as they are now, in an object as it was written."""
        value, form = super().value(index, sub), self.objects[index, sub][0]
        for name in self._inputs.get((index, sub), ()):
            reading = self.side.read().get(name, 0.0) if form == "f" else self.side.number(name)
            value = laid(self._terminals[name], form, value, reading)
        return value

    def store(self, index: int, sub: int, value: float) -> None:
        """Outputs move; those whose bits stay stay."""
        super().store(index, sub, value)
        for name in self._outputs.get((index, sub), ()):
            self.side.drive({name: taken(self._terminals[name], self.objects[index, sub][0], value)})

    def missed_heartbeat(self) -> None:
        """Outputs go where they are safe, and it says so."""
        if self._description.watchdog is None:
            return
        for place, names in self._outputs.items():
            for name in names:
                self._goes_to(place, name, self._description.watchdog.expires_to)
        self.unsent.append((0x080 + self.node, struct.pack("<HB5x", 0x8130, 0x11)))

    def _goes_to(self, place: tuple[int, int], name: str, value: float) -> None:
        self.values[place] = laid(self._terminals[name], self.objects[place][0], self.values[place], value)
        self.side.drive({name: value})

    def _by_place(self, direction: str) -> dict[Place, list[str]]:
        found: dict[Place, list[str]] = {}
        for name, terminal in self._terminals.items():
            if terminal.direction == direction:
                found.setdefault(terminal.place, []).append(name)
        return found


def laid(terminal: CanopenTerminal, form: str, held: float, value: float) -> float:
    """What an object of a form says with its terminal at a value, other bits as it `held` them."""
    data = bytearray(struct.pack("<" + form, held if form == "f" else int(held)))
    none = next(iter(counts_of(terminal.invalid)), 0)
    _bits(terminal, form).put(data, terminal.raw_at(value), none)
    (says,) = struct.unpack("<" + form, data)
    return float(says) if form == "f" else int(says)


def taken(terminal: CanopenTerminal, form: str, held: float) -> float:
    """The terminal's value by what its object says."""
    data = struct.pack("<" + form, held if form == "f" else int(held))
    return terminal.value_at(_bits(terminal, form).taken(data))


def _bits(terminal: CanopenTerminal, form: str) -> Bits:
    lowest, width = terminal.field or (0, 8 * struct.calcsize(form))
    places = tuple(divmod(bit, 8) for bit in range(lowest, lowest + width))
    return Bits(places, form in "bhi" and width > 1, form == "f")


Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "canopen",
    serve_node,
    lambda settings, side: DescribedNode(side, described_in(settings, "canopen"), int(settings.get("node") or 1)),
    "virtual:hil",
)
