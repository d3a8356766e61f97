"""Nodes on CANopen by their EDS or DCF, with a plant behind their objects; the twin of the driver."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

from hil.description.canopen import CanopenDescription, CanopenTerminal
from hil.description.named import Described, description_of
from sim_devices._can_bus import CanServer
from sim_devices._canopen_node import CanopenNode
from sim_devices._eds import objects_of
from sim_devices._field import Side
from sim_devices._quirks import Quirks
from sim_devices._twin import Twin, TwinSettings, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]


class DescribedNode(CanopenNode):
    """Objects of a file, some of which are terminals.

    When it misses the master's heartbeat its outputs go where the description says, with an emergency.
    """

    def __init__(self, side: Side, told: CanopenDescription, node: int) -> None:
        self._told = told
        self._outputs = {t.place: name for name, t in told.terminals.items() if t.direction == "out"}
        self._inputs = {t.place: name for name, t in told.terminals.items() if t.direction == "in"}
        super().__init__(side, node, objects_of(told.eds, node))

    def power_on(self) -> None:
        """Outputs at the values of the file, or as near zero as they come."""
        super().power_on()
        for place, name in self._outputs.items():
            low, high = self._told.terminals[name].range
            self._goes_to(place, name, min(max(0.0, low), high))

    def value(self, index: int, sub: int) -> float:
        """A terminal as it is now, or an object as it was written."""
        name = self._inputs.get((index, sub))
        if name is None:
            return super().value(index, sub)
        terminal, form = self._told.terminals[name], self.objects[index, sub][0]
        if form == "f":
            return (self.side.read().get(name, 0.0) - terminal.offset) / terminal.slope
        return _counted(terminal, self.side.number(name), form)

    def store(self, index: int, sub: int, value: float) -> None:
        """An output moves."""
        super().store(index, sub, value)
        if (name := self._outputs.get((index, sub))) is not None:
            told = self._told.terminals[name]
            self.side.drive({name: value * told.slope + told.offset})

    def missed_heartbeat(self) -> None:
        """Outputs go where they are safe, and it says so."""
        if self._told.watchdog is None:
            return
        for place, name in self._outputs.items():
            self._goes_to(place, name, self._told.watchdog.expires_to)
        self.unsent.append((0x080 + self.node, struct.pack("<HB5x", 0x8130, 0x11)))

    def _goes_to(self, place: tuple[int, int], name: str, value: float) -> None:
        terminal, form = self._told.terminals[name], self.objects[place][0]
        number = (value - terminal.offset) / terminal.slope
        self.values[place] = number if form == "f" else _counted(terminal, value, form)
        self.side.drive({name: value})


def _counted(told: CanopenTerminal, value: float, form: str) -> int:
    number = (value - told.offset) / told.slope
    width = 8 * struct.calcsize(form)
    low, high = (-(1 << width - 1), (1 << width - 1) - 1) if form.islower() else (0, (1 << width) - 1)
    if math.isnan(number):
        none = next((int(count, 0) for count in told.invalid if count.lower() != "nan"), 0)
        return none if none <= high else none - (1 << width)
    return max(low, min(high, round(number)))


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> CanServer:
    """Serve the node on the bus where the driver will look for it."""
    named = Described(model=settings.get("model", ""), description=settings.get("description"))
    node = DescribedNode(side, description_of(named, "canopen"), int(settings.get("node") or 1))
    return CanServer(node, side, behave, str(settings["address"]))


_twin = Twin("canopen", serve, example="virtual:hil", free="virtual:hil")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
