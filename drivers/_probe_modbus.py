"""Who answers on Modbus: asked for one register, then for the device's identification; nothing is written."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any, Literal

from pydantic import Field, PositiveFloat, PositiveInt, field_validator

from drivers._modbus_client import LineSettings, request
from drivers._modbus_line import ModbusLine
from hil.daq.probe import Found
from hil.record.run_folder.progress import Progress
from hil.strict import Strict

_OBJECTS = {0: "maker", 1: "product", 2: "version", 3: "url", 4: "name", 5: "model", 6: "application"}
_NOBODY_THERE = (10, 11)  # exceptions of a gateway for a unit that is not behind it


class Options(Strict):
    """What beside the address may be said.

    Attributes:
        address: `host:port`, a serial port, `usb:…` or `socket://host:port`, as in bench files.
        units: who is asked: `1..247`, `1,2,17`.
        baud, parity, echo: of a serial line.
        timeout_s: an answer that takes longer counts as none.
    """

    address: str
    units: tuple[int, ...] = tuple(range(1, 248))
    baud: PositiveInt = 19200
    parity: Literal["N", "E", "O"] = "N"
    echo: bool = False
    timeout_s: PositiveFloat = Field(default=0.2, le=10.0)

    @field_validator("units", mode="before")
    @classmethod
    def _listed(cls, given: Any) -> Any:
        if not isinstance(given, str):
            return given
        numbers = [number for part in given.split(",") for number in _range(part.strip())]
        if not numbers or not all(0 <= number <= 255 for number in numbers):
            raise ValueError("unit numbers 0 … 255 such as 1..16 or 1,2,17")
        return numbers

    @property
    def is_tcp(self) -> bool:
        """Whether the address is that of Modbus TCP."""
        return re.fullmatch(r"[^/:]+:\d+|\[[^\]]+\]:\d+", self.address) is not None and self.address[:4] != "usb:"


def _range(part: str) -> range:
    found = re.fullmatch(r"(\d+)(?:\.\.(\d+))?", part)
    return range(int(found[1]), int(found[2] or found[1]) + 1) if found else range(0)


def who(options: Options, progress: Progress) -> list[Found]:
    """Every unit that answers; neighbours that tell the same are one."""
    reached = {"transport": "tcp" if options.is_tcp else "rtu", "longest_reply_s": max(1.0, options.timeout_s)}
    settings = LineSettings.model_validate(options.model_dump(exclude={"units"}) | reached)
    line = ModbusLine(settings, lambda: None)
    line.connect()
    answered: list[tuple[int, Mapping[str, str]]] = []
    try:
        for i, unit in enumerate(options.units):
            if (identity := _identity(line, unit)) is not None:
                answered.append((unit, identity))
            progress((i + 1) / len(options.units), f"unit {unit}; {len(answered)} answered")
    finally:
        line.close()
    return list(_together(answered))


def _together(answered: list[tuple[int, Mapping[str, str]]]) -> Iterator[Found]:
    numbered = [(unit, i, identity) for i, (unit, identity) in enumerate(answered)]
    for _, same in groupby(numbered, key=lambda one: (one[0] - one[1], tuple(one[2].items()))):
        members = list(same)
        units = [unit for unit, _, _ in members]
        place = f"unit {units[0]}" if len(units) == 1 else f"units {units[0]} … {units[-1]}, all alike"
        yield Found(place, members[0][2])


def _identity(line: ModbusLine, unit: int) -> Mapping[str, str] | None:
    """What a unit says of itself; None where nobody answers."""
    from pymodbus.pdu.mei_message import ReadDeviceInformationRequest

    answer = _asked(line, request(3, 0, 1, (), unit))
    if answer is None or (answer.isError() and getattr(answer, "exception_code", 0) in _NOBODY_THERE):
        return None
    identity = _asked(line, ReadDeviceInformationRequest(dev_id=unit))
    if identity is None or identity.isError():
        return {"identification": "none (function 43/14)"}
    return {_OBJECTS.get(number, f"object {number}"): text.decode("ascii", "replace").strip()
            for number, text in identity.information.items() if isinstance(text, bytes)}  # fmt: skip


def _asked(line: ModbusLine, asked: Any) -> Any:
    from pymodbus.exceptions import ModbusException

    try:
        line.connect()
        return line.exchange(asked)
    except (ModbusException, OSError):
        line.drop()  # a late answer belongs to nobody
        return None
