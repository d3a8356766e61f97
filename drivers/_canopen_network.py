"""A CANopen network whose errors are those of this program, and which hears standard frames alone.

Imports the libraries when it is imported itself: drivers do so when they open a bus.
"""

from __future__ import annotations

import logging
from typing import Any

import canopen
from can import Listener, Message

from drivers._can import gone
from hil.errors import HardwareError, LinkError
from hil.system import system

_AGAIN_S = 0.05  # a bus that cannot be read is not asked more often


class CanopenNetwork(canopen.Network):
    """A network on a bus that is open already.

    Args:
        bus: of python-can; it is shut down with the network.
        address: of the bus, for errors.
        log: of its frames.

    Attributes:
        changed: notified whenever the bus fails.
        failure: what reading the bus last raised; None while it can be read.
    """

    NOTIFIER_CYCLE = 0.05  # how long it takes to leave the bus
    NOTIFIER_SHUTDOWN_TIMEOUT = 1.0

    def __init__(self, bus: Any, address: str, log: logging.Logger) -> None:
        super().__init__(bus)
        self.changed = system.condition()
        self.failure: Exception | None = None
        self._address, self._log = address, log
        self.listeners = [_StandardFrames(self, log)]  # type: ignore[list-item]

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        """Send a frame; raises `DeviceLostError` when the bus does not take it."""
        self._log.debug("→ %03X %s", can_id, bytes(data).hex(" "))
        try:
            super().send_message(can_id, data, remote)
        except Exception as error:  # python-can and the interfaces under it raise what they like
            raise gone(self.bus, self._address, error) from error

    def check(self) -> None:
        """Nothing: the library takes a bus for lost for ever once reading it has failed; this one goes on reading."""

    def check_readable(self) -> None:
        """Raise `DeviceLostError` when the bus cannot be read."""
        if self.failure is not None:
            raise gone(self.bus, self._address, self.failure) from self.failure

    def transfer(self, node: Any, kind: str, index: int, sub: int, *data: bytes) -> bytes:
        """An SDO `upload` or `download` of a node.

        Raises:
            LinkError: it is refused, or no valid answer comes; of object 1000, by which a node is looked for, the
                library's `SdoCommunicationError`.
        """
        try:
            answer: bytes = getattr(node.sdo, kind)(index, sub, *data)
        except canopen.SdoAbortedError as error:
            raise LinkError(f"object {index:04X}.{sub}: {kind} refused, abort code {error.code:#010x}") from None
        except HardwareError:
            raise
        except Exception as error:  # whatever the library makes of what came
            self.check_readable()
            if index == 0x1000 and isinstance(error, canopen.SdoCommunicationError):
                raise
            raise LinkError(f"object {index:04X}.{sub}: {error or type(error).__name__}") from error
        return answer

    def failed(self, error: Exception) -> None:
        """Reading raised an error."""
        with self.changed:
            self.failure = error
            self.changed.notify_all()


class _StandardFrames(Listener):
    """Hands over frames with 11-bit identifiers that others sent; those with 29 bits belong to other protocols."""

    def __init__(self, network: CanopenNetwork, log: logging.Logger) -> None:
        self._network, self._log = network, log

    def on_message_received(self, msg: Message) -> None:
        if msg.is_error_frame or msg.is_remote_frame or msg.is_extended_id or not msg.is_rx:
            return
        self._network.failure = None
        self._log.debug("← %03X %s", msg.arbitration_id, bytes(msg.data).hex(" "))
        try:
            self._network.notify(msg.arbitration_id, bytearray(msg.data), msg.timestamp)
        except Exception as error:  # a frame that nobody can read is no reason to stop listening
            self._log.debug("%03X is not understood: %r", msg.arbitration_id, error)

    def on_error(self, exc: Exception) -> None:
        self._network.failed(exc)
        system.sleep(_AGAIN_S)

    def stop(self) -> None:
        """Nothing to let go of."""
