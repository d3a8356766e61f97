"""Every type, byte order and scale of a described register, driver and twin alike, against `struct` alone."""

from __future__ import annotations

import math
import struct
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers._registers import encodings
from hil.description.modbus import ModbusDescription
from sim_devices._described_counts import Counts

CODES = {"u16": "H", "s16": "h", "u32": "I", "s32": "i", "f32": "f", "u64": "Q", "s64": "q", "f64": "d"}
LAID = {  # as struct lays bytes: whole number little or big, words in either order
    "ABCD": lambda data: data,
    "DCBA": lambda data: data[::-1],
    "BADC": lambda data: b"".join(struct.pack("<H", w) for w in struct.unpack(f">{len(data) // 2}H", data)),
    "CDAB": lambda data: b"".join(
        struct.pack("<H", w) for w in struct.unpack(f">{len(data) // 2}H", data[::-1])
    ),
}  # fmt: skip
SCALES = ({}, {"slope": 0.1}, {"slope": -0.001, "offset": 12.5}, {"raw": [0, 4000]}, {"raw": [4000, -100]})


def described(form: str, order: str, scale: dict[str, Any]) -> ModbusDescription:
    words = struct.calcsize(CODES[form]) // 2
    own = {} if words > 1 or order in ("ABCD", "CDAB") else {"byte_order": "BA"}
    return ModbusDescription.model_validate({
        "protocol": "modbus", "summary": "one", "modbus": {"addresses": "wire", "byte_order": order},
        "terminals": {"x": {"direction": "out", "range": [-50.0, 150.0], "unit": "bar", "table": "holding",
                            "address": 7, "type": form, **own, **scale}},
    })  # fmt: skip


@cache
def both_of(form: str, order: str, scale: int) -> tuple[Any, Counts, tuple[float, float]]:
    """The driver's register, its twin, slope and offset; neither remembers anything."""
    told = described(form, order, SCALES[scale])
    twin = Counts(told.by_name["x"], told.modbus.byte_order)
    return encodings(told)["x"], twin, told.terminals["x"].scale


def on_the_wire(form: str, order: str, count: float) -> list[int]:
    data = struct.pack(">" + CODES[form], count)
    laid = LAID[order](data) if len(data) > 2 else data[:: 1 if order in ("ABCD", "CDAB") else -1]
    return list(struct.unpack(f">{len(laid) // 2}H", laid))


@pytest.mark.parametrize("scale", SCALES, ids=str)
@pytest.mark.parametrize("order", LAID)
@pytest.mark.parametrize("form", CODES)
@settings(max_examples=15)
@given(value=st.floats(-50.0, 150.0, width=32), bits=st.integers(0, (1 << 64) - 1))
def test_registers_are_those_of_struct(form, order, scale, value, bits):
    register, twin, (slope, offset) = both_of(form, order, SCALES.index(scale))
    size = struct.calcsize(CODES[form])

    count = (value - offset) / slope
    if form[0] != "f":
        low, high = (0, (1 << 8 * size) - 1) if form[0] == "u" else (-(1 << 8 * size - 1), (1 << 8 * size - 1) - 1)
        count = max(low, min(high, round(count)))
    expected = on_the_wire(form, order, count)
    assert register.words_of(value) == expected
    assert twin.encoded(value) == expected

    (any_count,) = struct.unpack(">" + CODES[form], bits.to_bytes(8, "big")[:size])
    words = on_the_wire(form, order, any_count)
    for read in (register.value_of(words), twin.decoded(words)):
        assert read == slope * any_count + offset or (math.isnan(read) and math.isnan(any_count)) or math.isinf(read)


@given(
    lowest=st.integers(0, 15), width=st.integers(1, 16), word=st.integers(0, 0xFFFF), around=st.integers(0, 0xFFFF),
    signed=st.booleans(),
)  # fmt: skip
def test_a_part_of_a_register_leaves_the_rest(lowest, width, word, around, signed):
    width = min(width, 16 - lowest)
    told = ModbusDescription.model_validate({
        "protocol": "modbus", "summary": "one", "modbus": {"addresses": "wire"},
        "terminals": {"x": {"direction": "out", "range": [-1e5, 1e5], "table": "holding", "address": 0,
                            "type": "s16" if signed else "u16", "bits": [lowest, lowest + width - 1]}},
    })  # fmt: skip
    register, twin = encodings(told)["x"], Counts(told.by_name["x"], "ABCD")
    field = int(f"{word:016b}"[16 - lowest - width : 16 - lowest], 2)
    count = field - (1 << width) if signed and width > 1 and field >> width - 1 else field  # one bit has no sign
    assert register.value_of([word]) == twin.decoded([word]) == count
    (mask,) = register.mask
    assert mask == int("0" * (16 - lowest - width) + "1" * width + "0" * lowest, 2)
    (written,) = register.words_of(count)
    assert [written] == twin.encoded(count) == [word & mask]
    assert twin.encoded(count, around=[around]) == [around & ~mask | written]
