"""Nodes on CANopen by their EDS or DCF: objects by PDO, mapped as the file says or as it is told, heartbeats, EMCY."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress

from pydantic import Field, PositiveFloat

from drivers._can import OnABus, bus_fault
from drivers._canopen_node import MASTER, NodeLink
from drivers._described import ByDescription
from drivers._edge import edge
from drivers._pdo_mapping import configure, pdos_for, with_sync
from drivers._start_up import once_started
from hil.daq.channel import Wiring
from hil.description.canopen import CanopenDescription, CanopenTerminal, place_of
from hil.description.named import Described, description_faults
from hil.errors import HardwareError, SettingError

_devices = ByDescription("canopen")
terminals, has_watchdog = _devices.terminals, _devices.has_watchdog
watchdog_levels = _devices.watchdog_levels


class Settings(OnABus, Described):
    """What `[devices.NAME]` may say: how the node is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
        node: its number; that of the DCF if not given.
        startup_s: at opening the device is waited for so long, where it answers only after a start-up of its own.
        watchdog_s: the node makes its outputs safe when it misses our heartbeat for so long.
    """

    node: int | None = Field(default=None, ge=1, le=126)
    startup_s: float = Field(default=0.0, ge=0.0, le=300.0)
    watchdog_s: PositiveFloat | None = Field(default=None, le=65.5)


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from description_faults(settings, "canopen")
    if text := bus_fault(settings.address):
        yield ("address",), text
    if settings.watchdog_s is not None and settings.longest_reply_s >= settings.watchdog_s:
        yield ("longest_reply_s",), f"must be shorter than watchdog_s = {settings.watchdog_s:g}, or the node faults"
    yield from _devices.watchdog_faults(settings)


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "canopen")


def open_link(settings: Settings, wiring: Wiring) -> CanopenLink:
    """The node, recognised, its PDOs mapped, operational."""
    return CanopenLink(settings, wiring, _devices.described(settings))


@edge
class CanopenLink(NodeLink):
    """A node on CANopen (see `hil.daq.link.Link`).

    Outputs go out by PDO, SYNC asks for inputs, which come back by PDO. A node whose inputs alone are read is
    asked by SDO and left as it is. Our heartbeat goes with every drive, so that it ends when the program does.

    Attributes:
        identity: vendor, product, revision and serial number as its identity object (1018) has them.

    Raises:
        DeviceLostError: the bus cannot be opened, or nobody answers at this node.
        LinkError: it is another device than its file says, or its mapping is another and fixed.
    """

    def __init__(self, settings: Settings, wiring: Wiring, description: CanopenDescription) -> None:
        self._settings, self._description, file = settings, description, description.dictionary
        node = settings.node or file.node_id
        if not node:
            raise SettingError("node is missing, and its file says none")
        self._number = int(node)
        self._outputs = {c.terminal: description.by_name[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: description.by_name[c.terminal] for c in wiring.inputs.values()}
        wanted = [terminal.place for terminal in self._inputs.values()]
        flagged = dict.fromkeys(flag.place for terminal in self._inputs.values() for flag in terminal.status)
        synchronised = bool(self._outputs) and any(with_sync(file, i) for i in range(0x1800, 0x1A00) if (i, 1) in file)
        by_pdo = [*wanted, *(p for p in flagged if file[p].pdo_mappable)] if synchronised else []
        self._by_sdo = [place for place in dict.fromkeys([*wanted, *flagged]) if place not in by_pdo]
        self._sent = pdos_for(file, self._number, list(dict.fromkeys(by_pdo)), "sent")
        driven = dict.fromkeys(terminal.place for terminal in self._outputs.values())
        self._received = pdos_for(file, self._number, list(driven), "received")
        self._counts: dict[str, float] = {}
        self._objects_held: dict[tuple[int, int], float] = {}
        self._others_moved = False
        super().__init__(
            wiring, expires_to=description.watchdog.expires_to if description.watchdog else None, device="node",
            watchdog_s=settings.watchdog_s if self._outputs else None,
            longest_reply_s=settings.longest_reply_s,
            close={n: (t.close or 0.0) + 1e-6 * max(map(abs, t.range)) for n, t in self._outputs.items()},
        )  # fmt: skip
        self._open()

    def standing(self) -> dict[str, float]:
        """Where outputs stand, as the node says."""
        self._see(self._outputs.values())
        return {
            n: self._objects.value(terminal, self._objects_held[terminal.place])
            for n, terminal in self._outputs.items()
        }

    def _see(self, outputs: Iterable[CanopenTerminal]) -> None:
        """What stands in objects: what is not ours there is sent back as it is."""
        for place in dict.fromkeys(terminal.place for terminal in outputs):
            self._objects_held[place] = self._objects.count(place)

    def _see_shared(self) -> None:
        self._see(terminal for terminal in self._outputs.values() if terminal.field is not None)

    def _identified(self) -> str:
        settings = self._settings
        sent = (pdo.identifier for pdo in self._sent)
        self._connect(settings, self._number, "canopen", *sent, file=self._description.dictionary)
        return once_started(settings.startup_s, self._objects.recognised)

    def _make_ready(self) -> None:
        description = self._description
        self._manage(0x80)
        if self.watchdog_s is not None:
            self._objects.download(0x1016, 1, MASTER << 16 | round(1000.0 * self.watchdog_s), "<I")
        for value in description.setup:
            self._objects.write(place_of(value.object), value.value)
        configure(self._sent, "sent", self._objects.upload, self._objects.download, description.dictionary)
        configure(self._received, "received", self._objects.upload, self._objects.download, description.dictionary)
        self._see_shared()
        self._manage(0x01)
        self._emergency, self._others_moved = None, False

    def _put(self, values: Mapping[str, float]) -> list[tuple[str, float]]:
        """Send the PDOs of the outputs, and our heartbeat."""
        with suppress(HardwareError):  # a safe value goes out also where nobody answers
            self._receive()
            if self._others_moved:
                self._others_moved = False
                self._see_shared()
        self._counts |= {name: self._objects.counted(self._outputs[name], value) for name, value in values.items()}
        for name, count in self._counts.items():
            place = self._outputs[name].place
            self._objects_held[place] = self._objects.with_part(
                self._outputs[name], self._objects_held.get(place, 0), count
            )
        self._beat()
        driven = {self._outputs[name].place for name in self._counts}
        for pdo in self._received:
            if set(pdo.places) <= driven:
                self._send(pdo.identifier, pdo.packed(self._objects_held))
        return [(n, terminal.value_at(self._counts[n])) for n, terminal in self._outputs.items() if n in values]

    def _measured(self) -> dict[str, float]:
        """Those of this SYNC; by SDO of a node that is not ours to command, or that sends none with SYNC."""
        came = self._answers_to_sync({pdo.identifier for pdo in self._sent}) if self._sent else {}
        counts = {place: value for pdo in self._sent for place, value in pdo.values(came[pdo.identifier]).items()}
        counts |= {place: self._objects.count(place) for place in self._by_sdo}
        whys = {name: self._objects.why_none(terminal, counts) for name, terminal in self._inputs.items()}
        return {name: self._none(name, whys[name]) if whys[name] else self._objects.value(one, counts[one.place])
                for name, one in self._inputs.items()}  # fmt: skip

    def _on_emergency(self, data: bytes) -> None:
        super()._on_emergency(data)
        self._others_moved |= self._emergency is not None
