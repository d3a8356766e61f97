"""Devices on CAN and J1939 by a DBC file: raw frames of python-can as the other side, the twin, what is wrong."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import can as driver
from drivers._can_messages import checksum, group_of
from hil.daq.channel import Wiring
from hil.daq.device_link import DeviceWatchdog
from hil.description.can import database
from hil.errors import HardwareError, LinkError, SettingError
from sim_devices import can as twin
from tests.channels import inputs, outputs
from tests.described import bench, input_, is_told, output, passes, written
from tests.waits import PATIENCE_S, until

DBC = """\
VERSION ""
NS_ :
BS_:
BU_: Bench Amplifier
BO_ 512 Command: 8 Bench
 SG_ Which M : 0|4@1+ (1,0) [0|15] "" Amplifier
 SG_ Current m1 : 15|16@0- (0.001,0) [-10|10] "V" Amplifier
 SG_ Ramp m2 : 15|16@0+ (0.01,0) [0|100] "" Amplifier
 SG_ Alive : 4|4@1+ (1,0) [0|15] "" Amplifier
 SG_ Check : 56|8@1+ (1,0) [0|255] "" Amplifier
BO_ 513 Status: 8 Amplifier
 SG_ Stands : 7|16@0- (0.001,0) [-10|10] "V" Bench
 SG_ Measured : 16|12@1+ (0.005,-10) [-10|10] "V" Bench
 SG_ Count : 28|4@1+ (1,0) [0|15] "" Bench
 SG_ Sum : 32|8@1+ (1,0) [0|255] "" Bench
"""
AMPLIFIER = """\
protocol = "can"
summary = "an amplifier with alive counters and checksums"
dbc = "amplifier.dbc"

[messages.Command]
every_s = 0.05
counter = "Alive"
checksum = { signal = "Check", kind = "crc8" }
values = { Which = 1 }

[messages.Status]
every_s = 0.02
timeout_s = 0.6
counter = "Count"
checksum = { signal = "Sum", kind = "xor" }

[terminals.set]
direction = "out"
unit = "V"
range = [-10.0, 10.0]
message = "Command"
signal = "Current"
read_back = { message = "Status", signal = "Stands" }
close = 0.002

[terminals.measured]
direction = "in"
unit = "V"
range = [-10.0, 10.0]
message = "Status"
signal = "Measured"

[watchdog]
time_s = 0.3
expires_to = 0.0
"""
WIRING = Wiring(outputs({"u": "set"}), inputs({"m": "measured"}))


class ByHand:
    """The amplifier on a bus, frame by frame: bytes and nothing else."""

    def __init__(self, bus: str) -> None:
        self.bus = can.Bus(interface="virtual", channel=bus)
        self.heard: list[bytes] = []
        self.stands, self.counts, self.advances, self.spoil = b"\x00\x00", 0, True, 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        next_s = 0.0
        while not self._ended.is_set():
            message = self.bus.recv(0.005)
            if message is not None and message.arbitration_id == 512 and not message.is_extended_id:
                self.heard.append(bytes(message.data))
                self.stands = bytes(message.data[1:3])
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + 0.02
                self._tell()

    def _tell(self) -> None:
        self.counts = (self.counts + self.advances) % 16
        body = self.stands + bytes([0x60, self.counts << 4 | 0x09])  # 0x960 = 2400: 2400 · 0.005 − 10 = 2 V
        total = body[0] ^ body[1] ^ body[2] ^ body[3] ^ self.spoil
        self.bus.send(can.Message(arbitration_id=513, data=body + bytes([total, 0, 0, 0]), is_extended_id=False))

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.bus.shutdown()


@contextmanager
def by_hand(folder: Path) -> Iterator[tuple[driver.CanLink, ByHand]]:
    written(folder, "amplifier.dbc", DBC)
    path = written(folder, "amplifier.toml", AMPLIFIER.replace("time_s = 0.3", "time_s = 4.0"))
    with closing(ByHand(folder.name)) as device:
        told = {"model": str(path), "address": f"virtual:{folder.name}", "timeout_s": 1.0, "longest_reply_s": 1.0}
        with closing(driver.open_link(driver.Settings.model_validate(told), WIRING)) as link:
            yield link, device


def test_frames_are_those_of_the_dbc(tmp_path):
    with by_hand(tmp_path) as (link, device):
        link.drive({"set": -2.5})
        link.drive({"set": 1.234})
        until(lambda: link.standing() != {"set": -2.5})  # said while the second command was on its way
        assert link.standing() == {"set": 1.234}
        assert link.read() == {"measured": 2.0}
        until(lambda: len(device.heard) == 2)
        assert [frame[0] for frame in device.heard] == [0x01, 0x11]  # selector 1, counter 0 and 1
        assert device.heard[0][1:3] == (-2500).to_bytes(2, "big", signed=True)
        assert device.heard[1][1:3] == (1234).to_bytes(2, "big", signed=True)
        assert all(frame[7] == j1850(frame[:7]) for frame in device.heard)


def j1850(data: bytes) -> int:
    """CRC-8 of SAE J1850, bit by bit as a long division."""
    number = int.from_bytes(data, "big") ^ 0xFF << 8 * (len(data) - 1)
    number <<= 8
    for bit in range(8 * len(data) + 7, 7, -1):
        number ^= 0x11D << bit - 8 if number >> bit & 1 else 0
    return number ^ 0xFF


def test_checksum_of_the_published_example():
    assert checksum("crc8", b"123456789") == j1850(b"123456789") == 0x4B


def test_a_counter_that_stands_still_is_a_sender_that_hangs(tmp_path):
    with by_hand(tmp_path) as (link, device):
        assert link.read() == {"measured": 2.0}
        device.advances = False
        with pytest.raises(LinkError, match=r"Status\.Measured: the counter Count stands still: its sender hangs"):
            until(lambda: link.read() is None)


def is_believed(link: driver.CanLink) -> bool:
    """Whether what came last is taken for a measurement."""
    try:
        return bool(link.read())
    except LinkError:
        return False


def test_a_message_whose_checksum_does_not_fit_is_none(tmp_path):
    with by_hand(tmp_path) as (link, device):
        assert link.read() == {"measured": 2.0}
        device.spoil = 0x40
        time.sleep(0.8)
        with pytest.raises(
            LinkError, match=r"no Status\.Measured for 0\.6 s; the last one was not believed: its checksum"
        ):
            link.read()
        device.spoil = 0
        until(lambda: is_believed(link))
        assert link.read() == {"measured": 2.0}


def test_an_output_that_stands_elsewhere_and_a_lapsed_watchdog_are_told(tmp_path):
    with by_hand(tmp_path) as (link, device):
        link.drive({"set": 3.0})
        until(lambda: len(device.heard) == 1)
        device.stands = b"\x00\x00"
        time.sleep(0.06)
        link.read()  # it may have been under way
        time.sleep(1.1)
        with pytest.raises(LinkError, match=r"set stands at 0 V, not at 3 V as it was driven"):
            link.read()
        time.sleep(4.0)
        with pytest.raises(LinkError, match=r"longer than its watchdog of 4 s: the device makes its outputs safe then"):
            link.read()


def test_outputs_that_would_fall_elsewhere_than_safe_are_refused(tmp_path):
    written(tmp_path, "amplifier.dbc", DBC)
    path = written(tmp_path, "amplifier.toml", AMPLIFIER)
    wiring = Wiring(outputs({"u": "set"}, safe=5.0), {})
    with pytest.raises(SettingError, match="puts set at 0 V, but 'u' is safe at 5 V; connect"):
        driver.open_link(driver.Settings(model=str(path), address="virtual:none"), wiring)


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        ('dbc = "amplifier.dbc"', 'dbc = "no.dbc"', 3, "it is looked for beside the file that names it"),
        ('signal = "Current"', 'signal = "Curent"', 22, "no signal 'Curent' in Command; there are: Which,"),
        ('message = "Command"', 'message = "Comand"', 21, "no message 'Comand'; there are: Command, Status"),
        ('counter = "Count"', 'counter = "Cnt"', 11, "no signal 'Cnt' in it; there are: Stands"),
        ('signal = "Sum", kind = "xor"', 'signal = "Measured", kind = "xor"', 15, "is not a whole byte"),
        ('kind = "xor"', 'kind = "md5"', 15, "input should be 'xor', 'sum' or 'crc8'"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(old, new, line, told, tmp_path):
    written(tmp_path, "amplifier.dbc", DBC)
    is_told(tmp_path, AMPLIFIER, old, new, told, line)


@given(start=st.integers(0, 63), length=st.integers(1, 32), big=st.booleans(), signed=st.booleans(),
       data=st.binary(min_size=8, max_size=8), bits=st.integers(0, (1 << 32) - 1))  # fmt: skip
def test_bits_of_the_twin_are_those_of_the_library(start, length, big, signed, data, bits):
    from cantools.database.can import Message, Signal
    from cantools.database.conversion import BaseConversion
    from cantools.database.errors import Error

    order = "big_endian" if big else "little_endian"
    signal = Signal("x", start, length, order, signed, conversion=BaseConversion.factory())
    try:
        message = Message(1, "m", 8, [signal], strict=True)
    except Error:
        return  # does not lie in eight bytes
    assert twin.bits_of(signal).taken(data) == message.decode(data)["x"]
    count = bits & (1 << length) - 1
    count -= (1 << length) if signed and count >> length - 1 else 0
    changed = bytearray(data)
    twin.bits_of(signal).put(changed, count)
    assert message.decode(bytes(changed))["x"] == count
    mask = bytearray(8)
    twin.bits_of(signal).put(mask, -1 if signed else (1 << length) - 1)
    assert all((a ^ b) & ~m & 0xFF == 0 for a, b, m in zip(data, changed, mask, strict=True))


def test_groups_of_j1939():
    assert group_of(0x0CFE31FE) == 0xFE31 and group_of(0x18EF8026) == 0xEF00


CHANNELS = output("command", "set", role="command") + input_("volts", "measured", role="response")


@pytest.mark.alone
@pytest.mark.slow
def test_the_amplifier_passes_the_checks_on_its_twin(tmp_path):
    written(tmp_path, "amplifier.dbc", DBC)
    written(tmp_path, "amplifier.toml", AMPLIFIER)
    told = f'driver = "can"\nmodel = "amplifier.toml"\naddress = "virtual:{tmp_path.name}"\n'
    told += "timeout_s = 1.0\nlongest_reply_s = 2.0"
    path = written(tmp_path, "bench.toml", bench(told, CHANNELS, "volts"))
    passed = passes(path, "can")
    assert "has_the_watchdog_that_it_promises" in passed


def test_an_isobus_valve_by_its_dbc_frame_by_frame(tmp_path, monkeypatch):
    wiring = Wiring(outputs({"c": "flow command"}, "%", -100.0, 100.0),
                    inputs({"f": "estimated flow"}, "%", -125.0, 125.0))  # fmt: skip
    valve = can.Bus(interface="virtual", channel=tmp_path.name)
    told = {"model": "isobus-valve", "address": f"virtual:{tmp_path.name}", "timeout_s": 1.0, "longest_reply_s": 1.0}
    link = driver.open_link(driver.Settings.model_validate(told), wiring)
    try:
        claim = valve.recv(PATIENCE_S)
        assert claim.arbitration_id == 0x18EEFF26
        for percent, first, third in ((50.0, 125, 0x31), (-20.0, 50, 0x32), (0.0, 0, 0x30)):
            link.drive({"flow command": percent})
            message = valve.recv(PATIENCE_S)
            assert message.arbitration_id == 0x0CFE3126
            assert (message.data[0], message.data[2]) == (first, third)
            assert message.data[1] == message.data[7] == 0xFF
        for byte, value in ((155, 30.0), (95, -30.0), (0xFF, None)):
            frame = bytes([byte, 250 - byte & 0xFF, 0x31, 0x1F, 255, 255, 255, 255])
            valve.send(can.Message(arbitration_id=0x0CFE1180, data=frame, is_extended_id=True))
            valve.send(can.Message(arbitration_id=0x0CFE1181, data=b"\x00" * 8, is_extended_id=True))  # another device
            read = link.read()["estimated flow"]
            assert read == value if value is not None else math.isnan(read)
        time.sleep(0.35)
        monkeypatch.setattr(DeviceWatchdog, "begin", lambda *_: None)  # its watchdog has not expired
        with pytest.raises(HardwareError, match=r"no EstimatedFlow\.ExtendFlow for 0\.3 s"):
            link.read()
    finally:
        link.close()
        valve.shutdown()


def test_what_is_no_dbc_is_told(tmp_path):
    from hil.errors import FileError

    with pytest.raises(FileError, match="not a DBC file"):
        database(str(written(tmp_path, "no.dbc", "BO_ what")))
