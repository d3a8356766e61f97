"""A node of CANopen on its bus: SDO, SYNC and the PDOs that answer it, emergencies, our heartbeat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drivers._can_frames import CanFrames
from drivers._node_objects import NodeObjects
from drivers._sdo import Sdo
from hil.daq.device_link import DeviceLink
from hil.description.eds import Dictionary
from hil.errors import LinkError
from hil.system import system

MASTER = 127  # node that sends our heartbeat


class NodeLink(DeviceLink):
    """A link to a node (see `hil.daq.device_link.DeviceLink`). Our heartbeat goes with every drive."""

    _forgiving = False  # a node that is not operational obeys nothing
    causes: Mapping[int, str] = {0x8130: " (it missed our heartbeat)"}
    _frames: Any = None
    _emergency: tuple[int, int] | None = None

    def _connect(self, settings: Any, number: int, driver: str, *sent: int, file: Dictionary | None = None) -> None:
        """Join its bus, and hear its emergencies and these PDOs; `file`: the objects of its file."""
        self._settings, self._number, self._pdos, self._came = settings, number, sent, dict[int, bytes]()
        self._frames = CanFrames(settings, self._take, driver=driver)
        self._sdo = Sdo(number, settings.timeout_s, self._send, self._receive)
        self._objects = NodeObjects(self._sdo, file or Dictionary(), settings.address)

    def close(self) -> None:
        """Leave the bus."""
        frames, self._frames = self._frames, None
        if frames is not None:
            frames.close()

    def _receive(self, wait_s: float = 0.0) -> None:
        self._frames.receive(wait_s)

    def _take(self, identifier: int, data: bytes, extended: bool) -> bool:
        """A frame of the bus; those with 29 bits belong to other protocols."""
        is_emergency, is_pdo = identifier == 0x080 + self._number, identifier in self._pdos
        if extended or not (is_emergency or is_pdo or self._sdo.take(identifier, data)):
            return False
        if is_emergency:
            self._on_emergency(data)
        if is_pdo:
            self._came[identifier] = data
        return True

    def _send(self, identifier: int, data: bytes) -> None:
        self._frames.send(identifier, data, extended=False)

    def _manage(self, command: int) -> None:
        """Have the node change its state: 0x80 pre-operational, 0x01 operational."""
        self._send(0x000, bytes([command, self._number]))

    def _beat(self) -> None:
        self._send(0x700 + MASTER, b"\x05")
        self._watchdog.heard()

    def _look(self) -> None:
        self._receive()
        if self._emergency is not None:
            (code, register), self._emergency = self._emergency, None
            raise LinkError(f"emergency {code:#06x}, error register {register:#04x}{self.causes.get(code, '')}")

    def _answers_to_sync(self, wanted: set[int], named: str = "") -> dict[int, bytes]:
        """The PDOs that a SYNC brings, by identifier.

        Raises:
            LinkError: one did not come in time.
        """
        self._receive()
        self._came.clear()
        self._send(0x080, b"")
        until_s = system.now_s() + self._settings.timeout_s
        while (missing := wanted - set(self._came)) and (left_s := until_s - system.now_s()) > 0.0:
            self._receive(left_s)
        if missing:
            named = named or f"PDO {', '.join(f'{identifier:#05x}' for identifier in sorted(missing))}"
            raise self._failed(f"no {named} within {self._settings.timeout_s:g} s of SYNC")
        return dict(self._came)

    def _on_emergency(self, data: bytes) -> None:
        if len(data) >= 3 and (code := data[0] | data[1] << 8):
            self._emergency = code, data[2]
