"""A node on CANopen as a link: outputs by PDO with our heartbeat, inputs by SYNC, emergencies, read-back."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from contextlib import suppress

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._can import close_bus, open_bus
from drivers._edge import edge, wire_log
from drivers._node_objects import NodeObjects
from drivers._pdo_mapping import configure, pdos_for, with_sync
from drivers._start_up import once_started
from hil.daq.channel import Wiring
from hil.daq.device_link import ReadBackTimes
from hil.description.canopen import CanopenDescription, CanopenTerminal, place_of, variable
from hil.errors import HardwareError, LinkError, SettingError
from hil.units import behind_a_number

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
class CanopenLink:
    """A node on CANopen (see `hil.daq.link.Link`).

    Outputs go out by PDO, SYNC asks for inputs, which come back by PDO. A node whose inputs alone are read is
    asked by SDO and left as it is. Our heartbeat goes with every drive, so that it ends when the program does.

    Attributes:
        identity: vendor, product, revision and serial number as its identity object (1018) has them.

    Raises:
        DeviceLostError: the bus cannot be opened, or nobody answers at this node.
        LinkError: it is another device than its file says, or its mapping is another and fixed.
    """

    def __init__(self, settings: NodeSettings, wiring: Wiring, told: CanopenDescription) -> None:
        import canopen

        from drivers._canopen_network import CanopenNetwork

        _check_level(settings, told, wiring)
        self._settings, file = settings, told.dictionary
        node = settings.node or file.node_id
        if not node:
            raise SettingError("node is missing, and its file says none")
        self._number = int(node)
        self._outputs = {c.terminal: told.by_name[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: told.by_name[c.terminal] for c in wiring.inputs.values()}
        self.watchdog_s: float | None = settings.watchdog_s if self._outputs else None
        self.keep_alive_s: float | None = self.watchdog_s / 4.0 if self.watchdog_s else None
        wanted = [told.place for told in self._inputs.values()]
        flagged = dict.fromkeys(flag.place for told in self._inputs.values() for flag in told.status)
        synchronised = bool(self._outputs) and any(with_sync(file, i) for i in range(0x1800, 0x1A00) if i in file)
        by_pdo = [*wanted, *(p for p in flagged if variable(file, p).pdo_mappable)] if synchronised else []
        self._by_sdo = [place for place in dict.fromkeys([*wanted, *flagged]) if place not in by_pdo]
        self._sent = pdos_for(file, self._number, list(dict.fromkeys(by_pdo)), "sent")
        driven = dict.fromkeys(told.place for told in self._outputs.values())
        self._received = pdos_for(file, self._number, list(driven), "received")
        self._looked_at, self._before = wiring.looked_at, set[str]()
        self.unmeasured: dict[str, str] = {}
        self._driven: dict[str, float] = {}
        self._held: dict[tuple[int, int], float] = {}
        self._others_moved = False
        self._came: dict[int, bytes] = {}
        self._emergency: tuple[int, int] | None = None
        self._quiet_until_s, self._checked_s, self._drove_s = 0.0, time.monotonic(), 0.0
        self._read_back_times = ReadBackTimes()
        bus = open_bus(settings.address, settings.bitrate, settings.timeout_s)
        self._network = CanopenNetwork(bus, settings.address, wire_log("canopen", settings.address))
        self._closed = False
        try:
            self._network.connect()
            node_ = self._network.add_node(self._number, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
            node_.sdo.RESPONSE_TIMEOUT = settings.timeout_s
            self._objects = NodeObjects(self._network, node_, file, settings.address)
            self._network.subscribe(0x080 + self._number, self._on_emergency)
            for pdo in self._sent:
                self._network.subscribe(pdo.identifier, self._on_pdo)
            self.identity = once_started(settings.startup_s, self._objects.recognised)
            wiring.refuse_another(self.identity)
            if self._outputs:
                self._set_up(told)
        except BaseException:
            self.close()
            raise

    def standing(self) -> dict[str, float]:
        """Where outputs stand, as the node says."""
        return {name: self._objects.asked(told) for name, told in self._outputs.items()}

    def drive(self, values: Mapping[str, float]) -> None:
        """Send the PDOs of the outputs, and our heartbeat."""
        if self._others_moved:
            self._others_moved = False
            with suppress(HardwareError):  # a safe value goes out also where nobody answers
                self._look_around()
        self._driven |= {name: self._objects.counted(self._outputs[name], value) for name, value in values.items()}
        for name, count in self._driven.items():
            place = self._outputs[name].place
            self._held[place] = self._objects.with_part(self._outputs[name], self._held.get(place, 0), count)
        self._network.send_message(0x700 + MASTER, b"\x05")
        driven = {self._outputs[name].place for name in self._driven}
        for pdo in self._received:
            if set(pdo.places) <= driven:
                self._network.send_message(pdo.identifier, pdo.packed(self._held))
        self._drove_s = time.monotonic()

    def read(self) -> dict[str, float]:
        """The inputs of this SYNC, NaN where there is no measurement.

        They are asked for by SDO of a node that is not ours to command, or that sends none with SYNC.

        Raises:
            LinkError: no answer, an emergency, or it must have missed our heartbeat.
        """
        self._look()
        begun_s = time.monotonic()
        counts = self._synchronised() if self._sent else {}
        counts |= {place: self._objects.count(place) for place in self._by_sdo}
        self._read_back_times.took(time.monotonic() - begun_s)
        if self._driven and self._read_back_times.is_due(self._checked_s):
            self._outputs_stand()
        self.unmeasured = {}
        return {name: self._measured(name, told, counts) for name, told in self._inputs.items()}

    def close(self) -> None:
        """Leave the bus."""
        if self._closed:
            return
        self._closed = True
        with suppress(Exception):
            self._network.disconnect()
        if self._network.bus is not None:
            close_bus(self._network.bus, self._settings.timeout_s)

    def _measured(self, name: str, told: CanopenTerminal, counts: Mapping[tuple[int, int], float]) -> float:
        """A reading, NaN when it is none.

        Raises:
            LinkError: it is none from the first on, and something is to be run.
        """
        why = self._objects.why_none(told, counts)
        if why and name not in self._before and not self._looked_at:
            raise LinkError(f"{name} reads no measurement: {why}")
        self._before.add(name)
        if why:
            self.unmeasured[name] = why
            return math.nan
        return self._objects.value(told, counts[told.place])

    def _look_around(self) -> None:
        """Objects that hold more than our outputs: what else stands there is sent back as it is."""
        for place in dict.fromkeys(told.place for told in self._outputs.values() if told.field is not None):
            self._held[place] = self._objects.count(place)

    def _set_up(self, told: CanopenDescription) -> None:
        self._network.send_message(0x000, bytes([0x80, self._number]))  # pre-operational
        if self.watchdog_s is not None:
            self._objects.download(0x1016, 1, MASTER << 16 | round(1000.0 * self.watchdog_s), "<I")
        for value in told.setup:
            self._objects.write(place_of(value.object), value.value)
        configure(self._sent, "sent", self._objects.upload, self._objects.download, told.dictionary)
        configure(self._received, "received", self._objects.upload, self._objects.download, told.dictionary)
        self._look_around()
        self._network.send_message(0x000, bytes([0x01, self._number]))  # operational
        self._emergency, self._others_moved = None, False

    def _synchronised(self) -> dict[tuple[int, int], float]:
        """What the PDOs of this SYNC say."""
        wait_s = self._quiet_until_s - time.monotonic()
        if wait_s > 0.0:  # a late answer to an earlier SYNC looks like one to this
            time.sleep(wait_s)
        self._quiet_until_s = 0.0
        network, wanted = self._network, {pdo.identifier for pdo in self._sent}
        with network.changed:
            self._came.clear()
            network.failure = None
            network.send_message(0x080, b"")
            network.changed.wait_for(lambda: wanted <= set(self._came) or network.failure, self._settings.timeout_s)
            if missing := wanted - set(self._came):
                network.check_readable()
                self._quiet_until_s = time.monotonic() + self._settings.longest_reply_s
                names = ", ".join(f"{identifier:#05x}" for identifier in sorted(missing))
                raise LinkError(f"no PDO {names} within {self._settings.timeout_s:g} s of SYNC")
            came = dict(self._came)
        return {place: value for pdo in self._sent for place, value in pdo.values(came[pdo.identifier]).items()}

    def _outputs_stand(self) -> None:
        self._checked_s = time.monotonic()
        for name, told in self._outputs.items():
            if name not in self._driven:
                continue
            stands, driven = self._objects.asked(told), told.slope * self._driven[name] + told.offset
            if abs(stands - driven) > (told.close or 0.0) + 1e-6 * max(map(abs, told.range)):
                self._others_moved = True
                raise LinkError(
                    f"{name} stands at {stands:.4g}{behind_a_number(told.unit)}, not at {driven:.4g} as it was driven: "
                    f"the node restarted, missed our heartbeat, or another master writes to it"
                )

    def _look(self) -> None:
        if self._emergency is not None:
            (code, register), self._emergency = self._emergency, None
            missed = " (it missed our heartbeat)" if code == 0x8130 else ""
            raise LinkError(f"emergency {code:#06x}, error register {register:#04x}{missed}")
        silent_s = time.monotonic() - self._drove_s
        if self._driven and self.watchdog_s is not None and silent_s > self.watchdog_s:
            self._drove_s = time.monotonic()
            raise LinkError(f"no heartbeat was sent for {silent_s:.3g} s: the node makes its outputs safe then")

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
