"""A node of CANopen on its bus: SDO, SYNC and the PDOs that answer it, emergencies, our heartbeat."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from drivers._can import close_bus, open_bus
from drivers._edge import wire_log
from drivers._node_objects import NodeObjects
from hil.daq.device_link import DeviceLink
from hil.description.eds import Dictionary
from hil.errors import LinkError

MASTER = 127  # node that sends our heartbeat


class NodeLink(DeviceLink):
    """A link to a node (see `hil.daq.device_link.DeviceLink`). Our heartbeat goes with every drive."""

    _forgiving = False  # a node that is not operational obeys nothing
    causes: Mapping[int, str] = {0x8130: " (it missed our heartbeat)"}
    _network: Any = None
    _emergency: tuple[int, int] | None = None

    def _connect(self, settings: Any, number: int, driver: str, *sent: int, file: Dictionary | None = None) -> None:
        """Join its bus, and hear its emergencies and these PDOs; `file`: the objects of its file."""
        import canopen

        from drivers._canopen_network import CanopenNetwork

        self._settings, self._number, self._came = settings, number, dict[int, bytes]()
        bus = open_bus(settings.address, settings.bitrate, settings.timeout_s)
        self._network = CanopenNetwork(bus, settings.address, wire_log(driver, settings.address))
        self._network.connect()
        node = self._network.add_node(number, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
        node.sdo.RESPONSE_TIMEOUT = settings.timeout_s
        self._objects = NodeObjects(self._network, node, file or Dictionary(), settings.address)
        self._network.subscribe(0x080 + number, self._on_emergency)
        for identifier in sent:
            self._network.subscribe(identifier, self._on_pdo)

    def close(self) -> None:
        """Leave the bus."""
        network, self._network = self._network, None
        if network is None:
            return
        with suppress(Exception):
            network.disconnect()
        if network.bus is not None:
            close_bus(network.bus, self._settings.timeout_s)

    def _send(self, identifier: int, data: bytes) -> None:
        self._network.send_message(identifier, data)

    def _manage(self, command: int) -> None:
        """Have the node change its state: 0x80 pre-operational, 0x01 operational."""
        self._send(0x000, bytes([command, self._number]))

    def _beat(self) -> None:
        self._send(0x700 + MASTER, b"\x05")
        self._watchdog.heard()

    def _look(self) -> None:
        if self._emergency is not None:
            (code, register), self._emergency = self._emergency, None
            raise LinkError(f"emergency {code:#06x}, error register {register:#04x}{self.causes.get(code, '')}")

    def _answers_to_sync(self, wanted: set[int], named: str = "") -> dict[int, bytes]:
        """The PDOs that a SYNC brings, by identifier.

        Raises:
            LinkError: one did not come in time.
        """
        network, timeout_s = self._network, self._settings.timeout_s
        with network.changed:
            self._came.clear()
            network.failure = None
            self._send(0x080, b"")
            network.changed.wait_for(lambda: wanted <= set(self._came) or network.failure, timeout_s)
            if missing := wanted - set(self._came):
                network.check_readable()
                named = named or f"PDO {', '.join(f'{identifier:#05x}' for identifier in sorted(missing))}"
                raise self._failed(f"no {named} within {timeout_s:g} s of SYNC")
            return dict(self._came)

    def _on_pdo(self, identifier: int, data: bytearray, _time_s: float) -> None:
        with self._network.changed:
            self._came[identifier] = bytes(data)
            self._network.changed.notify_all()

    def _on_emergency(self, _identifier: int, data: bytearray, _time_s: float) -> None:
        if len(data) >= 3 and (code := data[0] | data[1] << 8):
            self._emergency = code, data[2]
