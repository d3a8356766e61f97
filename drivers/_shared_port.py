"""A serial port that is open once for all devices of this program on its line: an RS-485 line has many."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from hil.errors import DeviceLostError

_ports: dict[str, SharedPort] = {}
_quiet_until_s: dict[str, float] = {}
_registry = threading.Lock()


class SharedPort:
    """A port of pyserial. Who is done with it closes it; it is closed when nobody has it, or it broke.

    Attributes:
        line: held for a request and its answer: between them nobody else may speak.
        is_broken: whether it failed; nobody new gets it.
    """

    def __init__(self, key: str, port: Any) -> None:
        self._key, self._port, self._users, self.is_broken = key, port, 1, False
        self.line = threading.RLock()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    @property
    def in_waiting(self) -> int:
        """Bytes that have come."""
        return int(self._tried(lambda: self._port.in_waiting))

    def read(self, size: int) -> bytes:
        """What has come, so many bytes at most."""
        return bytes(self._tried(lambda: self._port.read(size)))

    def write(self, data: bytes) -> Any:
        """Send."""
        return self._tried(lambda: self._port.write(data))

    def close(self) -> None:
        """Let go of it; what comes on it from now on is nobody's."""
        with _registry:
            self._users -= 1
            if self._users > 0 and not self.is_broken:
                with suppress(Exception):
                    self._port.reset_input_buffer()
                return
            if _ports.get(self._key) is self:
                del _ports[self._key]
        self._port.close()

    def taken(self, speech: Mapping[str, object]) -> SharedPort:
        """The same for one more; raises `DeviceLostError` where that one speaks otherwise."""
        for name, wanted in speech.items():
            there = getattr(self._port, name)
            if there != wanted:
                raise DeviceLostError(
                    f"{self._key}: another device of this bench speaks with {name} {there} on it, this one "
                    f"with {wanted}: all on one line need the same"
                )
        self._users += 1
        return self

    def _tried(self, what: Callable[[], Any]) -> Any:
        try:
            return what()
        except OSError:
            self.is_broken = True
            raise


def shared_port(path: str, speech: Mapping[str, object], opened: Callable[[], Any]) -> SharedPort:
    """The port at a path: that which is open already, else a new one.

    `speech`: speed, parity and the like, by the port's own names.
    """
    key = os.path.realpath(path)
    with _registry:
        there = _ports.get(key)
        if there is not None and not there.is_broken:
            return there.taken(speech)
        _ports[key] = SharedPort(key, opened())
        return _ports[key]


def quiet_until_s(path: str) -> float:
    """Until when nothing may be asked on a line, since a late answer to somebody on it may still come."""
    return _quiet_until_s.get(os.path.realpath(path), 0.0)


def keep_quiet(path: str, until_s: float) -> None:
    """Nobody asks on this line until then; a shorter time does not end a longer one."""
    _quiet_until_s[os.path.realpath(path)] = max(until_s, quiet_until_s(path))
