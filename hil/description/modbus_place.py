"""Where something stands in a Modbus device: manuals count from 0 or 1, with or without the table in the number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

Table = Literal["coil", "discrete", "input", "holding"]
Addresses = Literal["wire", "40001"]
_FIRST: Mapping[str, Table] = {"0": "coil", "1": "discrete", "3": "input", "4": "holding"}
_DIGIT = {table: digit for digit, table in _FIRST.items()}
_HIGHEST = 0xFFFF
BITS: frozenset[Table] = frozenset({"coil", "discrete"})


def on_the_wire(address: int, table: Table | None, addresses: Addresses) -> tuple[Table, int]:
    """Table and wire address of what a manual calls `address`.

    Args:
        address: as it is said; in the style of `40001` with the table in its first digit, coils from 1.
        table: where that is said beside it.
        addresses: the style.

    Raises:
        ValueError: there is no such place; says what the manual usually calls it.
    """
    if addresses == "wire":
        if table is None:
            raise ValueError(f'table is missing: say table = "holding", "input", "coil" or "discrete"{_maybe(address)}')
        if not 0 <= address <= _HIGHEST:
            raise ValueError(f"address {address}: on the wire there are 0 … {_HIGHEST}{_maybe(address)}")
        return table, address
    found = _in_manual(address)
    if found is None:
        raise ValueError(
            f"address {address}: as manuals count there are 1 … 65536 (coils), 10001 … 165536 (discrete inputs), "
            f'30001 … 365536 (input registers), 40001 … 465536 (holding ones); counted from 0 say addresses = "wire"'
        )
    if table is not None and table != found[0]:
        raise ValueError(f"address {address} is that of {_a(found[0])}, not of {_a(table)}: take table away")
    return found


def as_in_manuals(table: Table, address: int) -> str:
    """What manuals usually call a wire address: 40001 is holding register 0."""
    width = 5 if address < 9999 else 6
    return f"{_DIGIT[table]}{address + 1:0{width - 1}d}"


def _in_manual(address: int) -> tuple[Table, int] | None:
    """40001 and 400001 alike; a number without a table in front is that of a coil."""
    text = str(address)
    if len(text) <= 4 or (len(text) == 5 and text[0] not in "134"):
        return ("coil", address - 1) if 1 <= address <= _HIGHEST + 1 else None
    table, number = _FIRST.get(text[0]), int(text[1:])
    if table is None or table == "coil" or len(text) > 6 or not 1 <= number <= _HIGHEST + 1:
        return None
    return table, number - 1


def _maybe(address: int) -> str:
    """A hint for a number that looks like one of a manual."""
    found = _in_manual(address)
    if found is None or address < 10001:
        return ""
    there = f"{_a(found[0])} with wire address {found[1]}"
    return f'; a manual that says {address} usually means {there}: say addresses = "40001"'


def _a(table: Table) -> str:
    return {
        "coil": "a coil", "discrete": "a discrete input", "input": "an input register", "holding": "a holding register",
    }[table]  # fmt: skip
