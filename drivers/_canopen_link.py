"""A node on CANopen as a link: outputs by PDO with our heartbeat, inputs by SYNC, emergencies, read-back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._can import close_bus, open_bus
from drivers._edge import edge, wire_log
from drivers._node_objects import NodeObjects
from drivers._pdo_mapping import configure, pdos_for, with_sync
from drivers._start_up import once_started
from hil.daq.channel import Wiring
from hil.daq.device_link import DeviceLink
from hil.description.canopen import CanopenDescription, place_of, variable
from hil.errors import HardwareError, LinkError, SettingError

MASTER = 127  # node that sends our heartbeat


class NodeSettings(BaseModel):
    """How a node is reached, whatever its objects.

    Attributes:
        address: of the bus, as python-can names it.
        node: its number; that of the DCF if not given.
        bitrate: of the bus.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure nothing is asked for so long, so that a late answer passes.
        startup_s: at opening the device is waited for so long, where it answers only after a start-up of its own.
        watchdog_s: the node makes its outputs safe when it misses our heartbeat for so long.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str
    node: int | None = Field(default=None, ge=1, le=126)
    bitrate: PositiveInt = 250_000
    timeout_s: PositiveFloat = 0.1
    longest_reply_s: PositiveFloat = 0.25
    startup_s: float = Field(default=0.0, ge=0.0, le=300.0)
    watchdog_s: PositiveFloat | None = Field(default=None, le=65.5)


@edge
class CanopenLink(DeviceLink):
    """A node on CANopen (see `hil.daq.link.Link`).

    Outputs go out by PDO, SYNC asks for inputs, which come back by PDO. A node whose inputs alone are read is
    asked by SDO and left as it is. Our heartbeat goes with every drive, so that it ends when the program does.

    Attributes:
        identity: vendor, product, revision and serial number as its identity object (1018) has them.

    Raises:
        DeviceLostError: the bus cannot be opened, or nobody answers at this node.
        LinkError: it is another device than its file says, or its mapping is another and fixed.
    """

    _forgiving = False  # a node that is not operational obeys no PDO

    def __init__(self, settings: NodeSettings, wiring: Wiring, told: CanopenDescription) -> None:

        _check_level(settings, told, wiring)
        self._settings, self._description, file = settings, told, told.dictionary
        node = settings.node or file.node_id
        if not node:
            raise SettingError("node is missing, and its file says none")
        self._number = int(node)
        self._outputs = {c.terminal: told.by_name[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: told.by_name[c.terminal] for c in wiring.inputs.values()}
        wanted = [told.place for told in self._inputs.values()]
        flagged = dict.fromkeys(flag.place for told in self._inputs.values() for flag in told.status)
        synchronised = bool(self._outputs) and any(with_sync(file, i) for i in range(0x1800, 0x1A00) if i in file)
        by_pdo = [*wanted, *(p for p in flagged if variable(file, p).pdo_mappable)] if synchronised else []
        self._by_sdo = [place for place in dict.fromkeys([*wanted, *flagged]) if place not in by_pdo]
        self._sent = pdos_for(file, self._number, list(dict.fromkeys(by_pdo)), "sent")
        driven = dict.fromkeys(told.place for told in self._outputs.values())
        self._received = pdos_for(file, self._number, list(driven), "received")
        self._counts: dict[str, float] = {}
        self._objects_held: dict[tuple[int, int], float] = {}
        self._others_moved, self._closed = False, False
        self._came: dict[int, bytes] = {}
        self._emergency: tuple[int, int] | None = None
        super().__init__(
            wiring, settings.watchdog_s if self._outputs else None, device="node",
            longest_reply_s=settings.longest_reply_s,
            close={n: (t.close or 0.0) + 1e-6 * max(map(abs, t.range)) for n, t in self._outputs.items()},
        )  # fmt: skip
        self._open()

    def standing(self) -> dict[str, float]:
        """Where outputs stand, as the node says."""
        for place in dict.fromkeys(told.place for told in self._outputs.values()):
            self._objects_held[place] = self._objects.count(place)  # what is not ours there is sent back as it is
        return {n: self._objects.value(told, self._objects_held[told.place]) for n, told in self._outputs.items()}

    def close(self) -> None:
        """Leave the bus."""
        if self._closed:
            return
        self._closed = True
        with suppress(Exception):
            self._network.disconnect()
        if self._network.bus is not None:
            close_bus(self._network.bus, self._settings.timeout_s)

    def _identified(self) -> str:
        import canopen

        from drivers._canopen_network import CanopenNetwork

        told, file = self._settings, self._description.dictionary
        bus = open_bus(told.address, told.bitrate, told.timeout_s)
        self._network = CanopenNetwork(bus, told.address, wire_log("canopen", told.address))
        self._network.connect()
        node = self._network.add_node(self._number, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
        node.sdo.RESPONSE_TIMEOUT = told.timeout_s
        self._objects = NodeObjects(self._network, node, file, told.address)
        self._network.subscribe(0x080 + self._number, self._on_emergency)
        for pdo in self._sent:
            self._network.subscribe(pdo.identifier, self._on_pdo)
        self.identity = once_started(told.startup_s, self._objects.recognised)
        return self.identity

    def _make_ready(self) -> None:
        told = self._description
        self._network.send_message(0x000, bytes([0x80, self._number]))  # pre-operational
        if self.watchdog_s is not None:
            self._objects.download(0x1016, 1, MASTER << 16 | round(1000.0 * self.watchdog_s), "<I")
        for value in told.setup:
            self._objects.write(place_of(value.object), value.value)
        configure(self._sent, "sent", self._objects.upload, self._objects.download, told.dictionary)
        configure(self._received, "received", self._objects.upload, self._objects.download, told.dictionary)
        self.standing()
        self._network.send_message(0x000, bytes([0x01, self._number]))  # operational
        self._emergency, self._others_moved = None, False

    def _put(self, values: Mapping[str, float]) -> list[tuple[str, float]]:
        """Send the PDOs of the outputs, and our heartbeat."""
        if self._others_moved:
            self._others_moved = False
            with suppress(HardwareError):  # a safe value goes out also where nobody answers
                self.standing()
        self._counts |= {name: self._objects.counted(self._outputs[name], value) for name, value in values.items()}
        for name, count in self._counts.items():
            place = self._outputs[name].place
            self._objects_held[place] = self._objects.with_part(
                self._outputs[name], self._objects_held.get(place, 0), count
            )
        self._network.send_message(0x700 + MASTER, b"\x05")
        driven = {self._outputs[name].place for name in self._counts}
        for pdo in self._received:
            if set(pdo.places) <= driven:
                self._network.send_message(pdo.identifier, pdo.packed(self._objects_held))
        self._watchdog.heard()
        return [(n, told.slope * self._counts[n] + told.offset) for n, told in self._outputs.items() if n in values]

    def _look(self) -> None:
        if self._emergency is not None:
            (code, register), self._emergency = self._emergency, None
            missed = " (it missed our heartbeat)" if code == 0x8130 else ""
            raise LinkError(f"emergency {code:#06x}, error register {register:#04x}{missed}")

    def _measured(self) -> dict[str, float]:
        """Those of this SYNC; by SDO of a node that is not ours to command, or that sends none with SYNC."""
        counts = self._synchronised() if self._sent else {}
        counts |= {place: self._objects.count(place) for place in self._by_sdo}
        whys = {name: self._objects.why_none(told, counts) for name, told in self._inputs.items()}
        return {name: self._none(name, whys[name]) if whys[name] else self._objects.value(told, counts[told.place])
                for name, told in self._inputs.items()}  # fmt: skip

    def _synchronised(self) -> dict[tuple[int, int], float]:
        """What the PDOs of this SYNC say."""
        network, wanted = self._network, {pdo.identifier for pdo in self._sent}
        with network.changed:
            self._came.clear()
            network.failure = None
            network.send_message(0x080, b"")
            network.changed.wait_for(lambda: wanted <= set(self._came) or network.failure, self._settings.timeout_s)
            if missing := wanted - set(self._came):
                network.check_readable()
                names = ", ".join(f"{identifier:#05x}" for identifier in sorted(missing))
                raise self._failed(f"no PDO {names} within {self._settings.timeout_s:g} s of SYNC")
            came = dict(self._came)
        return {place: value for pdo in self._sent for place, value in pdo.values(came[pdo.identifier]).items()}

    def _on_pdo(self, identifier: int, data: bytearray, _time_s: float) -> None:
        with self._network.changed:
            self._came[identifier] = bytes(data)
            self._network.changed.notify_all()

    def _on_emergency(self, _identifier: int, data: bytearray, _time_s: float) -> None:
        if len(data) >= 3 and (code := data[0] | data[1] << 8):
            self._emergency, self._others_moved = (code, data[2]), True


def _check_level(settings: NodeSettings, told: CanopenDescription, wiring: Wiring) -> None:
    for name, channel in wiring.outputs.items():
        level = told.watchdog.expires_to if told.watchdog else math.nan
        if settings.watchdog_s is not None and abs(level - channel.safe) > 1e-9:
            raise SettingError(
                f"watchdog_s: when it expires the node puts {channel.terminal} at {level:g} {channel.unit}, but "
                f"'{name}' is safe at {channel.safe:g}: connect the valve so that this is safe, or take watchdog_s away"
            )
