"""Who is on a CAN bus: heard first, then asked by SDO uploads (CANopen) or for claimed addresses (J1939)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from pydantic import Field, PositiveFloat, PositiveInt, field_validator

from drivers._address_claim import CLAIM_WAIT_S, CLAIMED, REQUEST
from drivers._can import bus_fault, close_bus, gone, heard, open_bus
from drivers._node_objects import NodeObjects
from drivers._sdo import Sdo
from hil.daq.probe import Found
from hil.description.eds import Dictionary
from hil.errors import LinkError
from hil.record.run_folder.progress import Progress
from hil.strict import Strict
from hil.system import system

_NOBODY, _EVERYBODY = 0xFE, 0xFF  # addresses of J1939: who has none may ask for claims
_SEARCH_S = 0.3


class Options(Strict):
    """What beside the address may be said.

    Attributes:
        address: of the bus, `INTERFACE:CHANNEL`, as in bench files.
        bitrate: of the bus; a wrong one disturbs it.
        listen_s: so long is listened before anything is asked.
        timeout_s: an answer that takes longer counts as none.
    """

    address: str
    bitrate: PositiveInt = 250_000
    listen_s: PositiveFloat = Field(default=1.2, le=60.0)
    timeout_s: PositiveFloat = Field(default=0.1, le=10.0)

    @field_validator("address")
    @classmethod
    def _is_a_bus(cls, given: str) -> str:
        if fault := bus_fault(given):
            raise ValueError(fault)
        return given


def who(options: Options, progress: Progress) -> list[Found]:
    """Every node of CANopen, and every address of J1939. A bus of 29-bit frames alone is not asked by SDO."""
    bus = open_bus(options.address, options.bitrate, options.timeout_s)
    try:
        progress(0.0, "listening")
        standard, extended = _listened(bus, options.listen_s, options.address)
        found = _controllers(bus, extended, options.address) if extended else []
        if standard or not extended:
            progress(0.5, "asking nodes 1 … 127")
            found += _nodes(bus, options)
        return found
    finally:
        with suppress(Exception):
            close_bus(bus, options.timeout_s)


def _listened(bus: Any, for_s: float, address: str) -> tuple[set[int], dict[int, str]]:
    """Identifiers of 11 bits that were heard, and by source address of 29-bit frames the NAME, where it was told."""
    standard: set[int] = set()
    names: dict[int, str] = {}
    until_s = system.now_s() + for_s
    while (left_s := until_s - system.now_s()) > 0.0:
        message = heard(bus, address, left_s)
        if message is None or message.is_error_frame or message.is_remote_frame:
            continue
        if not message.is_extended_id:
            standard.add(message.arbitration_id)
            continue
        source = message.arbitration_id & 0xFF
        is_claim = message.arbitration_id >> 8 & 0x3FF00 == CLAIMED and len(message.data) == 8
        name = f"{int.from_bytes(message.data, 'little'):#018x}" if is_claim else ""
        names[source] = name or names.get(source, "")
    return standard, names


def _controllers(bus: Any, heard: Mapping[int, str], address: str) -> list[Found]:
    """Addresses of J1939, with the NAMEs that they tell when everybody is asked for his."""
    import can

    identifier = 6 << 26 | REQUEST << 8 | _EVERYBODY << 8 | _NOBODY
    try:
        bus.send(can.Message(arbitration_id=identifier, data=CLAIMED.to_bytes(3, "little"), is_extended_id=True))
    except Exception as error:
        raise gone(bus, address, error) from error
    _, claimed = _listened(bus, 2.0 * CLAIM_WAIT_S, address)
    names = {**heard, **{source: name for source, name in claimed.items() if name or source not in heard}}
    return [Found(f"J1939 address {source:#04x}", {"NAME": name or "not told"})
            for source, name in sorted(names.items()) if source < _NOBODY]  # fmt: skip


def _nodes(bus: Any, options: Options) -> list[Found]:
    """Nodes of CANopen that answer an upload of their device type, and what their identity object says."""
    import can

    def send(identifier: int, data: bytes) -> None:
        try:
            bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
        except Exception as error:
            raise gone(bus, options.address, error) from error

    for node in range(1, 128):
        send(0x600 + node, b"\x40\x00\x10\x00\x00\x00\x00\x00")
    standard, _ = _listened(bus, _SEARCH_S + options.timeout_s, options.address)
    nodes = [node for node in range(1, 128) if 0x580 + node in standard]
    return [Found(f"CANopen node {node}", _identity(bus, options, node, send)) for node in nodes]


def _identity(bus: Any, options: Options, node: int, send: Callable[[int, bytes], None]) -> dict[str, str]:
    from canopen import SdoCommunicationError

    def receive(wait_s: float) -> None:
        while (message := heard(bus, options.address, wait_s)) is not None:
            wait_s = 0.0
            if not message.is_extended_id:
                sdo.take(message.arbitration_id, bytes(message.data))

    sdo = Sdo(node, options.timeout_s, send, receive)
    answers: dict[str, str] = {}
    with suppress(LinkError, SdoCommunicationError):
        kind = int.from_bytes(sdo.transfer("upload", 0x1000, 0), "little")
        answers["profile"] = f"{kind & 0xFFFF} (type {kind:#010x})"
    with suppress(LinkError):  # optional
        answers["name"] = sdo.transfer("upload", 0x1008, 0).decode("ascii", "replace").strip("\0 ")
    return answers | {what: f"{number:#x}" for _, what, number in NodeObjects(sdo, Dictionary(), "").identity()}
