"""How a device on Modbus is reached, and the library's client for it: requests by the number of their function."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._edge import quiet
from drivers._registers import WordOrder


class LineSettings(BaseModel):
    """How a device on Modbus is reached, whatever its registers.

    Attributes:
        transport: `tcp`, or `rtu` on a serial line.
        address: `host:port` for tcp; for rtu a serial port, `usb:` with the number or place of its adapter, or
            `socket://host:port` (serial server).
        unit_id: of the device on its line.
        baud, parity: of a serial line.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure on a serial line nothing is asked for so long, so that a late answer passes
            and is not taken for the next one. No answer may come later than that.
        watchdog_s: the device makes its outputs safe after so long without a request. Armed by this driver where
            the device allows it; else it says how the device was set.
        word_order: of numbers in several registers: `big` (or `ABCD`) is the high word first, `little` (`CDAB`) the low
            one; `BADC` and `DCBA` have the bytes of each word swapped.
        echo: what is sent on a serial line comes back before the answer, as some RS-485 adapters do.
        pause_s: so long nothing is asked after an answer, for devices and converters that need to turn around.
        startup_s: at opening the device is waited for so long, where it answers only after a start-up of its own.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    transport: Literal["tcp", "rtu"] = "tcp"
    address: str
    unit_id: PositiveInt = Field(1, le=247)
    baud: PositiveInt = 19200
    parity: Literal["N", "E", "O"] = "N"
    timeout_s: PositiveFloat = 0.2
    longest_reply_s: PositiveFloat = 1.0
    watchdog_s: PositiveFloat | None = None
    word_order: WordOrder | None = None
    echo: bool = False
    pause_s: float = Field(0.0, ge=0.0, le=1.0)
    startup_s: float = Field(0.0, ge=0.0, le=300.0)


def client_of(settings: LineSettings, trace: Callable[[bool, bytes], bytes] | None = None) -> Any:
    """The library's client for such a line, not yet connected."""
    from pymodbus import FramerType

    from drivers._aborting_client import AbortingTcpClient
    from drivers._steady_serial import SteadySerialClient

    quiet("pymodbus.logging")
    common: dict[str, Any] = {"timeout": settings.timeout_s, "retries": 0, "trace_packet": trace}
    if settings.transport == "tcp":
        host, port = host_and_port(settings.address) or ("", 0)
        return AbortingTcpClient(host, port=port, **common)
    if settings.address.startswith("socket://"):
        host, port = host_and_port(settings.address.removeprefix("socket://")) or ("", 0)
        client: Any = AbortingTcpClient(host, port=port, framer=FramerType.RTU, **common)
    else:
        client = SteadySerialClient(settings.address, baudrate=settings.baud, parity=settings.parity, **common)
    client.comm_params.handle_local_echo = client.transaction.comm_params.handle_local_echo = settings.echo
    return client


def request(
    client: Any, function: int, address: int, count: int, values: Sequence[int], unit_id: int, *, blindly: bool = False
) -> Any:
    """Ask a client of the library by the number of a function; `blindly` without waiting for the answer."""
    from pymodbus.pdu import DecodePDU

    kind, _ = DecodePDU.pdu_table[function]
    asked = kind(address=address, dev_id=unit_id)
    asked.count, asked.registers = max(count, len(values)), list(values)
    asked.bits = [bool(value) for value in values]
    return client.execute(blindly, asked)


def belongs(answer: Any, function: int, address: int, count: int, values: Sequence[int]) -> bool:
    """Whether an answer can be the one to a request: same function, same length or same echo."""
    if answer.function_code != function:
        return False
    if function in (3, 4):
        return len(answer.registers) == count
    if function in (1, 2):
        return len(answer.bits) >= count
    if function in (15, 16):
        return bool(answer.address == address and answer.count == len(values))
    return bool(answer.address == address)


def host_and_port(text: str) -> tuple[str, int] | None:
    """The two parts of `host:port`, None where it is none."""
    host, colon, port = text.rpartition(":")
    is_one = colon and re.fullmatch(r"[\w.:%\[\]-]+", host) and port.isdecimal() and 0 < int(port) < 65536
    return (host, int(port)) if is_one else None
