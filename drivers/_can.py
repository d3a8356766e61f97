"""CAN buses by address, for the drivers on CAN."""

from __future__ import annotations

import socket
from textwrap import shorten
from typing import Any

from drivers._edge import quiet, said_by
from hil.errors import DeviceLostError

_LONGEST_WHY = 200


def bus_fault(address: str) -> str:
    """What is wrong with the address of a bus, empty if nothing."""
    interface, colon, channel = address.partition(":")
    if not colon or not channel:
        return f"'{address}' is not INTERFACE:CHANNEL, such as socketcan:can0"
    if interface == "socketcand" and (channel.count(":") != 1 or not channel.rpartition(":")[2].isdecimal()):
        return f"'{address}' is not socketcand:HOST:PORT"
    return ""


def open_bus(address: str, bitrate: int) -> Any:
    """A bus: `socketcan:can0`, `pcan:PCAN_USBBUS1`, `socketcand:HOST:PORT`, `virtual:NAME`, as python-can names them.

    Raises:
        DeviceLostError: it cannot be opened.
    """
    import can

    quiet("can", "canopen")
    interface, _, channel = address.partition(":")
    try:
        if interface != "socketcand":
            return can.Bus(interface=interface, channel=channel, bitrate=bitrate)
        host, _, port = channel.rpartition(":")
        socket.create_connection((host, int(port)), 1.0).close()  # python-can alone would try for 10 s
        return can.Bus(interface=interface, channel="can0", host=host, port=int(port), tcp_tune=True)
    except Exception as error:  # interfaces that are not installed raise whatever their libraries do
        why = shorten(str(error), _LONGEST_WHY) or type(error).__name__  # some print all that came
        raise DeviceLostError(f"{address}: this bus cannot be opened: {why}") from error


def heard(bus: Any, address: str, wait_s: float) -> Any:
    """The next frame of a bus, None when none came in time.

    Raises:
        DeviceLostError: the bus is gone.
    """
    try:
        return bus.recv(wait_s)
    except Exception as error:  # python-can and the interfaces under it raise what they like
        raise gone(address, error) from error


def gone(address: str, error: Exception) -> DeviceLostError:
    """A bus that does not take or give frames any more: bus-off, a full queue, an adapter that was pulled."""
    return DeviceLostError(f"{address}: the bus is gone: {said_by(error) or type(error).__name__}")
