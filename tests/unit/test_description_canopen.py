"""CANopen nodes by their EDS: raw frames of python-can as the other side, mapping by file and by SDO, what is wrong."""

from __future__ import annotations

import math
import re
import struct
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import pytest
from canopen.objectdictionary import import_od

from drivers import canopen as driver
from drivers._node_objects import NodeObjects
from drivers._pdo_mapping import pdos_for
from hil.daq.channel import Wiring
from hil.description.canopen import FORMS, CanopenTerminal, dictionary
from hil.description.find import descriptions
from hil.description.read import read_description
from hil.errors import DeviceLostError, FileError, HardwareError, LinkError, SettingError
from sim_devices import canopen as twin
from sim_devices._eds import objects_of
from tests.channels import inputs, outputs
from tests.described import bench, input_, is_told, output, passes, written
from tests.waits import until

HERE = descriptions()["io-401"].parent
IO = (HERE / "io-401.toml").read_text(encoding="utf-8")
WIRING = Wiring(outputs({"u": "ao1"}), inputs(("ai1", "ai2")))


class ByHand:
    """A node on a bus, frame by frame: an SDO server over a dict of bytes, and PDOs by its mapping objects."""

    def __init__(self, bus: str, objects: dict[tuple[int, int], bytes], node: int = 5) -> None:
        self.bus, self.objects, self.node = can.Bus(interface="virtual", channel=bus), objects, node
        self.nmt: list[int] = []
        self.fixed: set[int] = set()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.is_set():
            message = self.bus.recv(0.02)
            if message is None or message.is_extended_id:
                continue
            data = bytes(message.data)
            if message.arbitration_id == 0x600 + self.node:
                self.send(0x580 + self.node, self._sdo(data))
            elif message.arbitration_id == 0:
                self.nmt.append(data[0])
            elif message.arbitration_id == 0x080:
                for index in [i for i, sub in self.objects if 0x1800 <= i < 0x1A00 and sub == 1]:
                    self.send(self._int(index, 1) & 0x7FF, self._pdo(index + 0x200))
            else:
                for index in [i for i, sub in self.objects if 0x1400 <= i < 0x1600 and sub == 1]:
                    if self._int(index, 1) & 0x800007FF == message.arbitration_id:
                        self._take(index + 0x200, data)

    def _int(self, index: int, sub: int) -> int:
        return int.from_bytes(self.objects[index, sub], "little")

    def entries(self, mapping: int) -> list[tuple[int, int]]:
        entries = [self._int(mapping, i + 1) for i in range(self._int(mapping, 0))]
        return [(entry >> 16, entry >> 8 & 0xFF) for entry in entries]

    def _pdo(self, mapping: int) -> bytes:
        return b"".join(self.objects[place] for place in self.entries(mapping))

    def _take(self, mapping: int, data: bytes) -> None:
        for place in self.entries(mapping):
            size = len(self.objects[place])
            self.objects[place], data = data[:size], data[size:]

    def _sdo(self, data: bytes) -> bytes:
        index, sub = struct.unpack("<HB", data[1:4])
        if (index, sub) not in self.objects:
            return struct.pack("<BHBI", 0x80, index, sub, 0x06020000)
        if data[0] == 0x40:
            held = self.objects[index, sub]
            return struct.pack("<BHB", 0x43 | (4 - len(held)) << 2, index, sub) + held.ljust(4, b"\0")
        if index not in self.fixed:
            self.objects[index, sub] = data[4 : 4 + len(self.objects[index, sub])]
        return struct.pack("<BHBI", 0x60, index, sub, 0)

    def send(self, identifier: int, data: bytes) -> None:
        self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.bus.shutdown()


def module() -> dict[tuple[int, int], bytes]:
    """The module of the profile, as its manual would list it; node 5."""
    u8, u32, i16 = (lambda v: struct.pack("<B", v)), (lambda v: struct.pack("<I", v)), (lambda v: struct.pack("<h", v))
    objects = {(0x1000, 0): u32(0x000C0191), (0x1018, 1): u32(0), (0x1016, 1): u32(0), (0x1017, 0): b"\0\0"}
    for comm, identifier, index in ((0x1401, 0x305, 0x6411), (0x1801, 0x285, 0x6401)):
        objects |= {(comm, 1): u32(identifier), (comm, 2): u8(255), (comm + 0x200, 0): u8(4)}
        objects |= {(comm + 0x200, k): u32(index << 16 | k << 8 | 16) for k in range(1, 5)}
        objects |= {(index, k): i16(0) for k in range(1, 5)}
    return objects | {(0x6443, k): u8(0) for k in range(1, 5)}


@contextmanager
def by_hand(folder: Path, objects: dict[tuple[int, int], bytes], fixed: set[int] | None = None,
            model: str = "io-401", wiring: Wiring = WIRING, **more: Any) -> Iterator[tuple[Any, ByHand]]:  # fmt: skip
    with closing(ByHand(folder.name, objects)) as node:
        node.fixed = fixed or set()
        told = {
            "model": model,
            "address": f"virtual:{folder.name}",
            "node": 5,
            "timeout_s": 1.0,
            "longest_reply_s": 1.0,
            **more,
        }
        with closing(driver.open_link(driver.Settings.model_validate(told), wiring)) as link:
            yield link, node


def with_eds(folder: Path, name: str) -> None:
    written(folder, f"{name}.eds", (HERE / f"{name}.eds").read_text(encoding="utf-8"))


def read_on(link: Any) -> None:
    until(lambda: link.read() is None)


def test_a_mapping_that_would_drive_other_outputs_is_told_anew_and_read_back(tmp_path, half_a_second_later):
    """The file maps four outputs into one PDO; the bench has but one of them."""
    with by_hand(tmp_path, module(), watchdog_s=1.0) as (link, node):
        assert node.entries(0x1601) == [(0x6411, 1)]  # ours alone
        assert node.entries(0x1A01) == [(0x6401, 1), (0x6401, 2), (0x6401, 3), (0x6401, 4)]  # as the file says
        assert node.objects[0x1801, 2] == b"\x01"
        assert node.objects[0x1016, 1] == struct.pack("<I", 127 << 16 | 1000)
        assert node.objects[0x6443, 1] == b"\x01"
        node.objects[0x6411, 2] = b"\x34\x12"
        until(lambda: node.nmt == [0x80, 0x01])
        link.drive({"ao1": -5.0})
        node.objects[0x6401, 1], node.objects[0x6401, 2] = struct.pack("<h", 16384), struct.pack("<h", -32767)
        assert link.read() == pytest.approx({"ai1": 5.00015, "ai2": -10.0}, abs=1e-4)
        assert node.objects[0x6411, 1] == struct.pack("<h", -16384) and node.objects[0x6411, 2] == b"\x34\x12"
        assert link.standing() == pytest.approx({"ao1": -5.0002}, abs=1e-4)
        node.objects[0x6411, 1] = b"\0\0"
        half_a_second_later()
        with pytest.raises(LinkError, match=r"ao1 stands at 0 V, not at -5\.\d+ V as it was driven"):
            link.read()
        node.send(0x085, struct.pack("<HB5x", 0x8130, 0x11))
        with pytest.raises(LinkError, match=r"emergency 0x8130, error register 0x11 \(it missed our heartbeat\)"):
            read_on(link)


def test_a_mapping_that_cannot_be_changed_is_told(tmp_path):
    with (
        pytest.raises(
            LinkError, match=r"object 1601 reads 0x64110110, .* back, not what it was told: its mapping is fixed"
        ),
        by_hand(tmp_path, module(), {0x1601}),
    ):
        raise AssertionError("it was opened")


def test_another_device_than_the_file_says_and_nobody(tmp_path):
    objects = module() | {(0x1000, 0): struct.pack("<I", 0x00020194)}
    with (
        pytest.raises(LinkError, match="of device type 0x00020194, its file 0x000c0191"),
        by_hand(tmp_path, objects),
    ):
        raise AssertionError("it was opened")
    settings = driver.Settings(model="io-401", address=f"virtual:{tmp_path.name}", node=6)
    with pytest.raises(DeviceLostError, match=r"node 6 on .* does not answer"):
        driver.open_link(settings, WIRING)


def test_a_node_that_is_only_read_is_asked_by_sdo_and_left_as_it_is(tmp_path):
    objects = {(0x1000, 0): struct.pack("<I", 0x00020194), (0x1018, 1): b"\0" * 4,
               (0x6130, 1): struct.pack("<f", 123.5)}  # fmt: skip
    wiring = Wiring({}, inputs({"p": "pressure"}, "bar", 0.0, 250.0))
    with by_hand(tmp_path, objects, model="transmitter-404", wiring=wiring) as (link, node):
        assert link.read() == {"pressure": 123.5}
        assert node.nmt == []
        node.objects[0x6130, 1] = struct.pack("<f", math.nan)
        assert math.isnan(link.read()["pressure"]) and link.invalid_reasons == {"pressure": "not a number"}
        del node.objects[0x6130, 1]
        with pytest.raises(HardwareError, match=r"object 6130\.1: upload refused"):
            link.read()


def test_an_encoder_is_read_by_sdo(tmp_path):
    objects = {(0x1000, 0): struct.pack("<I", 0x00010196), (0x1018, 1): bytes(4), (0x6004, 0): struct.pack("<I", 2048)}
    wiring = Wiring({}, inputs(["angle"], "deg", 0.0, 360.0))
    with by_hand(tmp_path, objects, model="encoder-406", wiring=wiring) as (link, _):
        assert link.read() == {"angle": 90.0}


BY_EDS = pytest.mark.parametrize(
    "name", [name for name, path in descriptions().items() if 'protocol = "canopen"' in path.read_text()]
)


@BY_EDS
def test_the_twin_reads_a_file_as_the_library_does(name):
    path = str(descriptions()[name].with_suffix(".eds"))
    objects, by_library = objects_of(path, 5), import_od(path, 0)
    known = {(found.index, found.subindex): found for entry in by_library.values()
             for found in (entry.values() if hasattr(entry, "subindices") else [entry])}  # fmt: skip
    for place, (_, value, writable) in objects.items():
        assert known[place].writable == writable
        assert value == (known[place].default or 0) + (5 if known[place].relative else 0)
    assert set(known) == set(objects)


@BY_EDS
def test_a_file_without_faults_is_read_as_the_library_does(name):
    path = str(descriptions()[name].with_suffix(".eds"))
    by_library = import_od(path, 0)
    for found in (own := dictionary(path)).values():
        entry = by_library[found.index]
        known = entry[found.sub] if found.record else entry
        assert (found.record, found.name) == (entry.name if found.record else "", known.name)
        assert (found.data_type, found.access, found.pdo_mappable, found.default, found.is_relative, found.value) == (
            known.data_type, known.access_type, known.pdo_mappable, known.default, known.relative, known.value
        )  # fmt: skip
        assert (found.low, found.high, found.unit, found.factor) == (known.min, known.max, known.unit, known.factor)
    assert len(own) == sum(len(entry) if hasattr(entry, "subindices") else 1 for entry in by_library.values())


def test_identifiers_go_with_the_node():
    objects = dictionary(str(HERE / "encoder-406.eds"))
    (first, second) = pdos_for(objects, 9, [(0x6004, 0)], "sent")
    assert (first.identifier, second.identifier, first.as_file) == (0x189, 0x289, True)
    with pytest.raises(SettingError, match="the node has 0 PDOs for 1 objects"):
        pdos_for(objects, 9, [(0x6004, 0)], "received")


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        ('eds = "io-401.eds"', 'eds = "no.eds"', 6, "cannot be read"),
        ('object = "6411.1"', 'object = "6412.1"', 18, "6412.1 is not in the file"),
        ('object = "6411.1"', 'object = "6401.1"', 18, "6401.1 can only be read"),
        ('object = "6411.1"', 'object = "ao"', 18, "'ao' is no object: an index of four hexadecimal digits"),
        ('object = "6443.1"', 'object = "6401.1"', 7, "no object of io-401.eds that can be written"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(old, new, line, told, tmp_path):
    with_eds(tmp_path, "io-401")
    is_told(tmp_path, IO, old, new, told, line)
    with pytest.raises(FileError, match="not an EDS or DCF"):
        dictionary(str(written(tmp_path, "no.eds", "nothing")))


def test_pdos_that_come_at_changes_alone_are_left_and_their_inputs_asked_for(tmp_path):
    """As small I/O nodes have them: transmission type 255, identifiers without remote frames, neither to be changed."""
    file = (HERE / "io-401.eds").read_text(encoding="utf-8")
    fixed = re.sub(r"(\[180\dsub[12]\][^\[]*AccessType=)rw", r"\1const", file)
    assert fixed != file
    written(tmp_path, "io-401.eds", fixed)
    model = str(written(tmp_path, "io.toml", IO))
    objects = module() | {(0x1801, 1): struct.pack("<I", 0x40000285), (0x1401, 1): struct.pack("<I", 0x40000305)}
    with by_hand(tmp_path, objects, {0x1801, 0x1A01}, model=model) as (link, node):
        assert node.objects[0x1801, 2] == b"\xff"
        assert node.objects[0x1401, 1] == struct.pack("<I", 0x40000305)  # as it was: not every node takes another
        node.objects[0x6401, 1] = struct.pack("<h", 16384)
        link.drive({"ao1": 5.0})
        assert link.read() == pytest.approx({"ai1": 5.0002, "ai2": 0.0}, abs=1e-4)
        until(lambda: node.objects[0x6411, 1] == struct.pack("<h", 16384))


CHANNEL = 'object = "6401.1"\n'
WORDS = """invalid = { "0x8000" = "sensor broken", "-2" = "not taught" }
status = [
  { object = "6401.3", mask = 0x0F00, equals = 0x0500, means = "open wire" },
  { object = "1001", bit = 4, means = "the module has a fault" },
]
"""


def with_words(folder: Path, words: str = WORDS) -> str:
    """The module with what its manual says of readings that are none."""
    with_eds(folder, "io-401")
    return str(written(folder, "io.toml", IO.replace(CHANNEL, f"{CHANNEL}{words}", 1)))


@pytest.mark.parametrize("outputs", [True, False], ids=["by PDO", "by SDO"])
def test_counts_and_flags_that_are_no_measurement_are_told_in_words(outputs, tmp_path):
    wiring = WIRING if outputs else Wiring({}, {"ai1": WIRING.inputs["ai1"]})
    objects = module() | {(0x1001, 0): b"\0"}
    with by_hand(tmp_path, objects, model=with_words(tmp_path), wiring=wiring) as (link, node):
        node.objects[0x6401, 1] = struct.pack("<h", -32768)
        with pytest.raises(LinkError, match="ai1 reads no measurement from the first on: sensor broken"):
            link.read()
        node.objects[0x6401, 1] = bytes(2)
        assert link.read()["ai1"] == 0.0
        for place, data, why in (
            ((0x6401, 1), struct.pack("<h", -32768), "sensor broken"),
            ((0x6401, 1), struct.pack("<h", -2), "not taught"),
            ((0x6401, 3), struct.pack("<H", 0xF5FF), "open wire"),
            ((0x6401, 3), struct.pack("<H", 0x0700), ""),
            ((0x1001, 0), b"\x10", "the module has a fault"),
            ((0x1001, 0), b"\x01", ""),
        ):
            before, node.objects[place] = node.objects[place], data
            read = link.read()["ai1"]
            assert math.isnan(read) is bool(why)
            assert link.invalid_reasons == ({"ai1": why} if why else {})
            node.objects[place] = before
        assert link.read()["ai1"] == 0.0 and link.invalid_reasons == {}


def test_the_twin_says_that_a_broken_sensor_has_no_measurement(tmp_path):
    terminal = read_description(Path(with_words(tmp_path))).terminals["ai1"]
    assert twin.laid(terminal, "h", 0, math.nan) == -32768
    assert twin.laid(terminal, "h", 0, 5.0) == 16384


DIGITAL = (HERE / "dio-401.toml").read_text(encoding="utf-8")


LAMP = '[terminals.lamp]\ndirection = "out"\nrange = [0, 1]\nobject = "6200.1"\nbit = 7\n\n'


def lines(out: tuple[str, ...] = ("do2", "do5"), into: tuple[str, ...] = ("di1", "di8")) -> Wiring:
    return Wiring(outputs(out, "1", 0.0, 1.0), inputs(into, "1", 0.0, 1.0))


def digital_module() -> dict[tuple[int, int], bytes]:
    """Outputs 6 and 8 are on, which belong to somebody else."""
    objects = {(0x1000, 0): struct.pack("<I", 0x00030191), (0x1018, 1): bytes(4), (0x1016, 1): bytes(4)}
    for comm, identifier, entry in ((0x1400, 0x205, 0x62000108), (0x1800, 0x185, 0x60000108)):
        objects |= {(comm, 1): struct.pack("<I", identifier), (comm, 2): b"\xff", (comm + 0x200, 0): b"\1",
                    (comm + 0x200, 1): struct.pack("<I", entry)}  # fmt: skip
    return objects | {(0x6000, 1): b"\0", (0x6200, 1): b"\xa0", (0x6206, 1): b"\0", (0x6207, 1): b"\0"}


def stands_soon(node: ByHand, place: tuple[int, int], byte: int) -> None:
    until(lambda: node.objects[place] == bytes([byte]))


def test_bits_of_an_object_are_driven_and_the_others_stay_as_they_were_found(tmp_path, half_a_second_later):
    with by_hand(tmp_path, digital_module(), model="dio-401", wiring=lines(), watchdog_s=1.0) as (link, node):
        assert node.objects[0x6206, 1] == b"\xff"
        assert link.standing() == {"do2": 0.0, "do5": 0.0}
        link.drive({"do2": 1.0})
        stands_soon(node, (0x6200, 1), 0b1010_0010)
        link.drive({"do5": 1.0})
        stands_soon(node, (0x6200, 1), 0b1011_0010)
        node.objects[0x6000, 1] = b"\x80"
        assert link.read() == {"di1": 0.0, "di8": 1.0}  # by PDO
        node.objects[0x6200, 1] = b"\x10"
        half_a_second_later()
        with pytest.raises(LinkError, match="do2 stands at 0, not at 1 as it was driven"):
            link.read()


def test_bits_of_others_that_a_node_switched_off_by_itself_are_not_switched_on_again(tmp_path):
    with by_hand(tmp_path, digital_module(), model="dio-401", wiring=lines(), watchdog_s=1.0) as (link, node):
        link.drive({"do2": 1.0, "do5": 1.0})
        stands_soon(node, (0x6200, 1), 0b1011_0010)
        node.objects[0x6200, 1] = b"\0"
        node.send(0x085, struct.pack("<HB5x", 0x8130, 0x11))
        with pytest.raises(LinkError, match="emergency 0x8130"):
            read_on(link)
        link.drive({"do2": 0.0, "do5": 1.0})
        stands_soon(node, (0x6200, 1), 0b0001_0000)


def test_bits_are_asked_for_by_sdo_where_nothing_is_driven(tmp_path):
    with by_hand(tmp_path, digital_module(), model="dio-401", wiring=lines((), ("di1", "di2", "di8"))) as (link, node):
        node.objects[0x6000, 1] = b"\x82"
        assert link.read() == {"di1": 0.0, "di2": 1.0, "di8": 1.0}
        assert node.nmt == [] and node.objects[0x6206, 1] == b"\0"


@pytest.mark.parametrize(
    ("text", "old", "new", "told"),
    [
        (IO, CHANNEL, CHANNEL + 'invalid = { "broken" = "x" }\n', "'broken' is no count"),
        (IO, CHANNEL, CHANNEL + 'status = [{ object = "6999", bit = 1 }]\n', "6999 is not in the file"),
        (IO, CHANNEL, CHANNEL + 'status = [{ object = "1001", bit = 8 }]\n', "1001 has the bits 0 … 7"),
        (IO, CHANNEL, CHANNEL + 'status = [{ object = "1001", bit = 1, mask = 2 }]\n', "bit or mask, not both"),
        (IO, CHANNEL, CHANNEL + 'status = [{ object = "1001", bit = 1, equals = 2 }]\n', "a bit equals 0 or 1"),
        (DIGITAL, "bit = 0\n", "bit = 1\n", "has the bits 0 … 7, the lowest first; this row of 8 would end at 8"),
        (DIGITAL, "bit = 0\n", "bit = 0\nbits = [0, 1]\n", "bit or bits, not both"),
        (DIGITAL, "bit = 0\n", "bits = [0, 1]\n", "this row of 8 would end at 15"),
        (DIGITAL, "bit = 0\n", "", "a row stands in the bits of one object"),
        (DIGITAL, "[terminals.\"di", f"{LAMP}[terminals.\"di", "'do{n}' is driven by bit 7 of 6200.1 already"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_readings_that_are_none_and_bits_is_told(text, old, new, told, tmp_path):
    for name in ("io-401", "dio-401"):
        with_eds(tmp_path, name)
    is_told(tmp_path, text, old, new, told)


@pytest.mark.parametrize("form", ["b", "h", "i", "B", "H", "I"])
@pytest.mark.parametrize(("lowest", "highest"), [(0, 0), (3, 3), (7, 7), (0, 7), (2, 5), (6, 7)])
def test_driver_and_twin_take_the_same_bits_for_a_terminal(form, lowest, highest):
    kind = next(kind for kind, letter in FORMS.items() if letter == form)
    part = {"bit": lowest} if lowest == highest else {"bits": (lowest, highest)}
    told = CanopenTerminal(direction="out", range=(-200.0, 200.0), object="2000", **part)  # type: ignore[arg-type]
    objects = NodeObjects(None, {(0x2000, 0): SimpleNamespace(data_type=kind)}, "")
    size = 8 * struct.calcsize(form)
    rest = ((1 << size) - 1) & ~(((2 << highest) - 1) & -(1 << lowest))
    for before in (0, (1 << size - 1) - 1, -1 if form.islower() else (1 << size) - 1):
        for value in (0, 1, 2, 5, -1, -3, 200, -200):
            count = objects.counted(told, value)
            after = objects.with_part(told, before, count)
            struct.pack("<" + form, int(after))
            assert after == twin.laid(told, form, before, value)
            assert objects.part(told, after) == twin.taken(told, form, after) == count
            assert int(after) & rest == int(before) & rest


@pytest.mark.alone
@pytest.mark.slow
def test_the_module_passes_the_checks_on_its_twin(tmp_path):
    told = f'driver = "canopen"\nmodel = "io-401"\nnode = 5\nwatchdog_s = 0.4\naddress = "virtual:{tmp_path.name}"'
    channels = output("command", "ao1", role="command") + input_("volts", "ai1", role="response")
    passed = passes(written(tmp_path, "bench.toml", bench(told, channels, "volts")), "canopen")
    assert "has_the_watchdog_that_it_promises" in passed
