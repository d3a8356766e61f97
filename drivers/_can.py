"""CAN buses by address, for the drivers on CAN."""

from __future__ import annotations

import socket
from contextlib import suppress
from textwrap import shorten
from typing import Any

from pydantic import PositiveFloat, PositiveInt

from drivers._edge import message_of, quiet
from hil.errors import DeviceLostError
from hil.strict import Strict
from hil.system import system
from hil.system.tcp import close, connect, guard

_LONGEST_WHY = 200
_CONNECTS_S = 1.0


class OnABus(Strict):
    """How a device on a CAN bus is reached.

    Attributes:
        address: of the bus: `socketcan:can0`, `pcan:PCAN_USBBUS1`, `socketcand:host:port`, `virtual:name`.
        bitrate: of the bus.
        timeout_s: an answer, or a message that is waited for, that takes longer counts as none.
        longest_reply_s: after a failure nothing is asked, or believed, for so long, so that a late answer passes.
    """

    address: str
    bitrate: PositiveInt = 250_000
    timeout_s: PositiveFloat = 0.1
    longest_reply_s: PositiveFloat = 0.25


def bus_fault(address: str) -> str:
    """What is wrong with the address of a bus, empty if nothing."""
    interface, colon, channel = address.partition(":")
    if not colon or not channel:
        return f"'{address}' is not INTERFACE:CHANNEL, such as socketcan:can0"
    if interface == "socketcand" and (channel.count(":") != 1 or not channel.rpartition(":")[2].isdecimal()):
        return f"'{address}' is not socketcand:HOST:PORT"
    return ""


def open_bus(address: str, bitrate: int, timeout_s: float = 1.0) -> Any:
    """A bus: `socketcan:can0`, `pcan:PCAN_USBBUS1`, `socketcand:HOST:PORT`, `virtual:NAME`, as python-can names them.

    Args:
        address: of the bus.
        bitrate: of the bus.
        timeout_s: of the link; what a hub does not acknowledge for so long is not sent again.

    Raises:
        DeviceLostError: it cannot be opened.
    """
    quiet("can", "canopen")
    interface, _, channel = address.partition(":")
    try:
        if interface != "socketcand":
            return system.can_bus(interface=interface, channel=channel, bitrate=bitrate)
        host, _, port = channel.rpartition(":")
        connect(host, int(port), _CONNECTS_S).close()  # python-can alone would try for 10 s
        bus = system.can_bus(interface=interface, channel="can0", host=host, port=int(port), tcp_tune=True)
        if (behind := _socket_of(bus)) is not None:
            guard(behind, timeout_s)
        return bus
    except Exception as error:  # interfaces that are not installed raise whatever their libraries do
        why = shorten(str(error), _LONGEST_WHY) or type(error).__name__  # some print all that came
        raise DeviceLostError(f"{address}: this bus cannot be opened: {why}") from error


def close_bus(bus: Any, timeout_s: float = 1.0) -> None:
    """Leave a bus; what a hub does not acknowledge in time is given up."""
    behind = _socket_of(bus)
    if behind is not None and behind.fileno() >= 0:
        close(behind, timeout_s)
    bus.shutdown()


def _socket_of(bus: Any) -> socket.socket | None:
    """The connection of a bus behind a hub; None where it has none."""
    found: socket.socket | None = getattr(bus, "_SocketCanDaemonBus__socket", None)
    return found


def heard(bus: Any, address: str, wait_s: float) -> Any:
    """The next frame of a bus, None when none came in time.

    Raises:
        DeviceLostError: the bus is gone.
    """
    try:
        return bus.recv(wait_s)
    except Exception as error:  # python-can and the interfaces under it raise what they like
        raise gone(bus, address, error) from error


def gone(bus: Any, address: str, error: Exception) -> DeviceLostError:
    """A bus that does not take or give frames any more: bus-off, a full queue, an adapter that was pulled.

    It is given up: what the port of a serial adapter (slcan) still holds would go out after what is sent next.
    """
    with suppress(Exception):
        bus.serialPortOrig.reset_output_buffer()
    return DeviceLostError(f"{address}: the bus is gone: {message_of(error) or type(error).__name__}")
