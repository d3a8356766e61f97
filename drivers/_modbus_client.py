"""How a device on Modbus is reached, and the library's requests by the number of their function."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import Field, PositiveFloat, PositiveInt

from drivers._meeting import RequestSettings
from drivers._registers import WordOrder


class LineSettings(RequestSettings):
    """How a device on Modbus is reached, whatever its registers.

    Attributes:
        transport: `tcp`, or `rtu` on a serial line.
        address: `host:port` for tcp; for rtu a serial port, `usb:` with the number or place of its adapter, or
            `socket://host:port` (serial server).
        unit_id: of the device on its line.
        baud, parity: of a serial line.
        timeout_s, longest_reply_s, echo, pause_s: see `RequestSettings`.
        watchdog_s: the device makes its outputs safe after so long without a request. Armed by this driver where
            the device allows it; else it says how the device was set.
        word_order: of numbers in several registers: `big` (or `ABCD`) is the high word first, `little` (`CDAB`) the low
            one; `BADC` and `DCBA` have the bytes of each word swapped.
        startup_s: at opening the device is waited for so long, where it answers only after a start-up of its own.
    """

    transport: Literal["tcp", "rtu"] = "tcp"
    unit_id: PositiveInt = Field(1, le=247)
    baud: PositiveInt = 19200
    parity: Literal["N", "E", "O"] = "N"
    watchdog_s: PositiveFloat | None = None
    word_order: WordOrder | None = None
    startup_s: float = Field(0.0, ge=0.0, le=300.0)


def request(function: int, address: int, count: int, values: Sequence[int], unit_id: int) -> Any:
    """A request of the library by the number of its function."""
    from pymodbus.pdu import DecodePDU

    kind, _ = DecodePDU.pdu_table[function]
    asked = kind(address=address, dev_id=unit_id)
    asked.count, asked.registers = max(count, len(values)), list(values)
    asked.bits = [bool(value) for value in values]
    return asked


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
