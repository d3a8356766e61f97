"""A serial port that is open once for all devices of this program on its line: an RS-485 line has many."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

from hil.errors import DeviceLostError
from hil.system import system
from hil.system.tcp import close


class _Registry:
    """The ports of this process that are open, by their place, and until when nobody asks on each line."""

    def __init__(self) -> None:
        self.lock = system.lock()
        self.ports: dict[str, SharedPort] = {}
        self.quiet_until_s: dict[str, float] = {}


def _registry() -> _Registry:
    return system.of_process(_Registry)


class SharedPort:
    """A port of pyserial, used as `drivers._ports.TcpPort`. It is closed when nobody has it any more, or it broke.

    Attributes:
        line: held for a request and its answer: between them nobody else may speak.
        is_broken: whether it failed; nobody new gets it.
    """

    is_hung_up = False

    def __init__(self, key: str, port: Any) -> None:
        self._key, self._port, self._users, self.is_broken = key, port, 1, False
        self.line = system.rlock()

    @property
    def quiet_until_s(self) -> float:
        """Until when nobody asks on its line, since a late answer to somebody there may still come."""
        return _registry().quiet_until_s.get(self._key, 0.0)

    @quiet_until_s.setter
    def quiet_until_s(self, until_s: float) -> None:
        latest_s = max(until_s, self.quiet_until_s)  # a shorter one does not end a longer one
        _registry().quiet_until_s[self._key] = latest_s

    def write(self, data: bytes) -> None:
        """Send; what has come before belongs to nobody."""
        with self._breaking():
            if waiting := self._port.in_waiting:
                self._port.read(waiting)
            self._port.write(data)

    def read(self, wait_s: float) -> bytes:
        """What has come; waited for as it was opened to, whatever is asked: a change is a negotiation on some ports."""
        with self._breaking():
            return bytes(self._port.read(max(1, self._port.in_waiting))) if wait_s > 0.0 else b""

    def hold_nothing_back(self) -> None:
        """What still waits in it to be sent is not: it would go out after what is sent next."""
        with suppress(Exception):
            self._port.reset_output_buffer()

    def drop(self) -> None:
        """Give it up, and what still waits in it to be sent."""
        self.hold_nothing_back()
        self.let_go(0.0)

    def let_go(self, patience_s: float = 1.0) -> None:
        """Let go of it in order; what comes on it from now on is nobody's."""
        known = _registry()
        with known.lock:
            self._users -= 1
            if self._users > 0 and not self.is_broken:
                with suppress(Exception):
                    self._port.reset_input_buffer()
                return
            if known.ports.get(self._key) is self:
                del known.ports[self._key]
        if (behind := getattr(self._port, "_socket", None)) is not None:  # of RFC 2217
            close(behind, patience_s)
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

    @contextmanager
    def _breaking(self) -> Iterator[None]:
        try:
            yield
        except OSError:
            self.is_broken = True
            raise


def shared_port(path: str, speech: Mapping[str, object], opened: Callable[[], Any]) -> SharedPort:
    """The port at a path: that which is open already, else a new one.

    `speech`: speed, parity and the like, by the port's own names.
    """
    key, known = os.path.realpath(path), _registry()
    with known.lock:
        there = known.ports.get(key)
        if there is not None and not there.is_broken:
            return there.taken(speech)
        known.ports[key] = SharedPort(key, opened())
        return known.ports[key]
