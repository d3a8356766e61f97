"""What an address leads to: which device it is under whatever name, and whether it is still the same one."""

from __future__ import annotations

import os
import re
import socket
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from hil.errors import DeviceLostError

_LINES = ("socket", "rfc2217")  # of the addresses that pyserial knows: a serial server, plain or by RFC 2217
_HARMFUL = ("spy", "alt", "loop", "hwgrep")  # writes a file, loads a class, leads nowhere, takes the first that fits
_USB = "usb:"
_VISA_LIKE = re.compile(r"(TCPIP|USB|GPIB|ASRL|PXI|VXI)\d*::", re.IGNORECASE)
_VISA = re.compile(r"(TCPIP|USB|GPIB)(\d*)::(.+)::INSTR", re.IGNORECASE)


def address_fault(address: str) -> str:
    """What is wrong with an address whoever uses it, empty if nothing."""
    if _VISA_LIKE.match(address) and not is_visa(address):
        return (
            f"'{address}': no resource of VISA that is used here; they are TCPIP::host::INSTR (VXI-11), "
            f"TCPIP::host::hislip0::INSTR, USB0::…::INSTR, GPIB0::12::INSTR, and for a plain socket socket://host:port"
        )
    scheme = address.partition("://")[0].lower()
    if "://" in address and scheme in _HARMFUL:
        return (
            f"'{address}': {scheme}:// is refused; a serial line is a port such as /dev/ttyUSB0, usb:SERIALNUMBER, "
            f"socket://host:port or rfc2217://host:port"
        )
    if "://" in address and scheme in _LINES and not _has_host_and_port(address):
        return f"'{address}': no {scheme}://host:port"
    return ""


def _has_host_and_port(url: str) -> bool:
    try:
        there = urlsplit(url)
        return bool(there.hostname) and there.port is not None
    except ValueError:  # a port that is no number, or beyond 65535
        return False


def is_visa(address: str) -> bool:
    """Whether it names an instrument of VISA (`TCPIP::host::INSTR`, `USB0::…::INSTR`, `GPIB0::12::INSTR`)."""
    return _VISA.fullmatch(address) is not None


def is_relayed(settings: Any) -> bool:
    """Whether something between this computer and a device may hold back what was sent: a server, gateway or hub.

    Of a gateway on Modbus TCP only the unit number tells: behind one there are several.
    """
    address = str(getattr(settings, "address", "")).lower()
    if address.partition(":")[0] in (*_LINES, "socketcand"):
        return True
    if is_visa(address):  # not an instrument that is on the network itself
        return re.search(r"::(inst|hislip)\d*(,\d+)?::instr|tcpip\d*::[^:]+::instr", address) is None
    return getattr(settings, "transport", "") == "tcp" and getattr(settings, "unit_id", 1) not in (0, 1, 255)


def places_of(address: str) -> list[str]:
    """What an address leads to: the same for every name of one device, as far as this computer can know."""
    scheme, is_url, rest = address.partition("://")
    if is_url and scheme.lower() in _LINES:
        return _hosts(re.split(r"[/?]", rest)[0]) or [address]
    if is_url:
        return [address]
    if visa := _VISA.fullmatch(address):
        return _instruments(visa[1].upper(), visa[2] or "0", visa[3])
    if address.startswith("socketcand:"):
        return _hosts(address.partition(":")[2]) or [address]
    if address.startswith("socketcan:"):
        return [_interface(address.partition(":")[2])]
    if address.startswith("slcan:"):
        return [_port(address.partition(":")[2].partition("@")[0])]
    if address.startswith(_USB) or _is_port(address):
        return [_port(address)]
    return _hosts(address) or [address]


class Port:
    """The serial port at an address, and ever after the same one: a name may come to belong to another device.

    Args:
        address: a port, `usb:` and what is known of its adapter (serial number, or place such as 1-1.4), or what else
            a driver opens, of which nothing is known.

    Attributes:
        address: as it was given.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self._identity = ""

    def path(self) -> str:
        """Where to open it.

        Raises:
            DeviceLostError: it is not there, or another device is.
        """
        return self.now()[0]

    def now(self) -> tuple[str, bool]:
        """Where to open it, and whether that is elsewhere than its name says: its adapter may have another name now.

        Raises:
            DeviceLostError: it is not there, or another device is.
        """
        try:
            path, identity = found(self.address)
        except DeviceLostError:
            if moved_to := _port_of(self._identity):
                return moved_to, True
            raise
        if not self._identity or identity == self._identity:
            self._identity = identity
            return path, False
        if moved_to := _port_of(self._identity):
            return moved_to, True
        raise DeviceLostError(
            f"{self.address}: another device has this name now ({identity}), not the one that was opened "
            f"({self._identity})"
        )


def found(address: str) -> tuple[str, str]:
    """Where to open what an address names, and what it is, empty where only the device itself could tell.

    Raises:
        DeviceLostError: there is no such port.
    """
    if not (address.startswith(_USB) or _is_port(address)):
        return address, ""
    path = _usb_port(address) if address.startswith(_USB) else address
    try:
        node = Path(path).stat()
    except OSError as error:
        if os.name == "nt":
            return path, _usb_identity(path)
        raise DeviceLostError(f"{path}: cannot be opened, no such port: {error.strerror}") from None
    number = f"device number {os.major(node.st_rdev)}:{os.minor(node.st_rdev)}, node {node.st_ino}"
    return path, _usb_identity(path) or number


def _hosts(text: str) -> list[str]:
    """Every network address of `host:port`; this computer is one, whatever it is called."""
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdecimal()):
        return []
    try:
        resolved = socket.getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_STREAM)
    except (OSError, UnicodeError, OverflowError):
        return [f"{host.lower()}:{int(port)}"]
    return sorted({f"{_one_name(str(place[0]))}:{int(port)}" for *_, place in resolved})


def _instruments(kind: str, board: str, rest: str) -> list[str]:
    """An instrument of VISA: the same by VXI-11 and HiSLIP."""
    if kind != "TCPIP":
        return [f"{kind}{board}::{rest.upper()}"]
    host, _, device = rest.partition("::")
    name, _, port = device.partition(",")
    host, _, by_vxi = host.partition(",")
    number = re.sub(r"^(inst|hislip)", "", name.lower()) or "0"
    return [f"instrument {number} at {place}" for place in _hosts(f"{host}:{port or by_vxi or 0}")]


def _one_name(host: str) -> str:
    host = host.removeprefix("::ffff:").partition("%")[0]
    if host in ("127.0.0.1", "::1", "0.0.0.0", "::") or (not host.startswith("127.") and _is_here(host)):
        return "this computer"
    return host


def _is_here(host: str) -> bool:
    """Whether an address is one of this computer: nobody else's can be bound."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return False
        return True


def _interface(name: str) -> str:
    try:
        return f"network interface {socket.if_nametoindex(name)}"
    except OSError:
        return f"socketcan:{name}"


def _is_port(address: str) -> bool:
    return address.startswith(("/", "\\\\.\\", ".")) or re.fullmatch(r"COM\d+", address, re.IGNORECASE) is not None


def _port(address: str) -> str:
    try:
        path = _usb_port(address) if address.startswith(_USB) else address
        node = Path(path).stat()
    except (OSError, DeviceLostError):
        return address.upper() if os.name == "nt" else os.path.realpath(address)
    is_device = stat.S_ISCHR(node.st_mode)
    return f"device number {os.major(node.st_rdev)}:{os.minor(node.st_rdev)}" if is_device else os.path.realpath(path)


def _usb_port(address: str) -> str:
    """The port of the USB adapter with a serial number, or at a place.

    Raises:
        DeviceLostError: there is none, or several.
    """
    wanted = address.removeprefix(_USB)
    ports = [port for port in _ports() if wanted in (port.serial_number, port.location)]
    if len(ports) == 1:
        return str(ports[0].device)
    there = ", ".join(
        f"{port.serial_number or 'no number'} at {port.location}" for port in ports or _ports() if port.vid
    )
    what = f"{len(ports)} ports have it, say the place of one" if ports else "no USB adapter has this number or place"
    raise DeviceLostError(f"{address}: {what}; there are: {there or 'none'}")


def _usb_identity(path: str) -> str:
    real = os.path.realpath(path)
    return next((_adapter(port) for port in _ports() if os.path.realpath(port.device) == real), "")


def _adapter(port: Any) -> str:
    """What a serial port belongs to; empty where it is none of a USB adapter."""
    if port.vid is None:
        return ""
    kind = f"USB adapter {port.vid:04x}:{port.pid:04x}"
    interface = (port.location or "").partition(":")[2]
    if port.serial_number:
        return f"{kind} number {port.serial_number}" + (f", interface {interface}" if interface else "")
    return f"{kind} without number at {port.location}"


def _port_of(identity: str) -> str:
    """The port of the one adapter with this serial number, wherever it is now; empty where there is none."""
    ports = [port for port in _ports() if " number " in identity and _adapter(port) == identity]
    return str(ports[0].device) if len(ports) == 1 else ""


def _ports() -> Iterable[Any]:
    """Serial ports of this computer, as pyserial lists them; none where it is not installed."""
    try:
        from serial.tools import list_ports
    except ImportError:
        return []
    return list(list_ports.comports())
