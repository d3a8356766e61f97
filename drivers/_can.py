"""CAN buses by address, for the drivers on CAN."""

from __future__ import annotations

import socket
from typing import Any

from hil.errors import DeviceLostError


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

    interface, _, channel = address.partition(":")
    try:
        if interface != "socketcand":
            return can.Bus(interface=interface, channel=channel, bitrate=bitrate)
        host, _, port = channel.rpartition(":")
        socket.create_connection((host, int(port)), 1.0).close()  # python-can alone would try for 10 s
        return can.Bus(interface=interface, channel="can0", host=host, port=int(port), tcp_tune=True)
    except (can.CanError, OSError, ValueError) as error:
        raise DeviceLostError(f"{address}: this bus cannot be opened: {error}") from None
