"""`hil probe`: who is there, with nothing but reads on the wire."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import can
import pytest
from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext

from hil.bench.read import BenchFile
from hil.daq.probe import Found, probe_of
from hil.errors import DeviceLostError, LinkError, SettingError, UnknownNameError
from tests.links import PATIENT, free_port, served
from tests.recorded_line import RecordedLine


def _who(kind: str, address: str, **given: str) -> list[Found]:
    probe, options = probe_of(kind, address, given)
    found: list[Found] = probe.who(options, lambda _done, _text: None)
    return found


def _address(file: BenchFile, driver: str) -> str:
    (found,) = (d.settings["address"] for d in file.bench.devices.values() if d.driver == driver)
    return str(found)


def test_modbus_tcp_with_reads_alone(tmp_path):
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (_, devices):
        (device,) = devices.values()
        line = RecordedLine(device.port)
        found = _who("modbus", f"127.0.0.1:{line.port}", units="1..2", timeout_s="1.0")
        line.close()
        assert found and found[0].place.startswith("unit")
        assert line.modbus_functions == {3, 43}


def test_modbus_rtu_behind_a_serial_server(tmp_path):
    changes = ('"/tmp/hil-modbus-rtu"', '"socket://127.0.0.1:1"')
    with served("hpv41-modbus-rtu", tmp_path, *PATIENT, changes) as (file, _):
        address = next(d.settings["address"] for d in file.bench.devices.values() if "socket" in d.settings["address"])
        line = RecordedLine(int(address.rpartition(":")[2]))
        found = _who("modbus", f"socket://127.0.0.1:{line.port}", units="1,2", timeout_s="1.0")
        line.close()
        assert [one.place for one in found] == ["unit 1"]
        assert {frame[1] for frame in line.asked} <= {3, 43}


def test_canopen_with_uploads_alone(tmp_path):
    with served("hpv41-canopen", tmp_path, *PATIENT) as (file, _):
        address = _address(file, "canopen_valve")
        line = RecordedLine(int(address.rpartition(":")[2]))
        found = _who("can", f"socketcand:127.0.0.1:{line.port}", listen_s="1.0", timeout_s="1.0")
        line.close()
        assert [one.place for one in found] == ["CANopen node 1"] and found[0].answers["profile"].startswith("408 ")
        assert line.can_frames
        for identifier, data in line.can_frames:
            assert 0x601 <= identifier <= 0x67F
            assert data[0] & 0xE0 in (0x40, 0x60), data  # upload: begun, and its segments


def test_j1939_is_heard_and_not_asked_by_sdo(tmp_path):
    with served("hpv41-j1939", tmp_path, *PATIENT) as (file, _):
        address = _address(file, "j1939_valve")
        heard = []
        with _listening(address, heard):
            found = _who("can", address, listen_s="1.0")
        assert found and all(one.place.startswith("J1939 address") for one in found)
        assert all(message.is_extended_id for message in heard)


@contextmanager
def _listening(address: str, heard: list[can.Message]) -> Iterator[None]:
    from drivers._can import open_bus

    bus = open_bus(address, 250_000)
    notifier = can.Notifier(bus, [heard.append])
    try:
        yield
    finally:
        notifier.stop()
        bus.shutdown()


def test_scpi_with_one_question(tmp_path):
    with served("hpv41-j1939", tmp_path, *PATIENT) as (file, _):
        address = _address(file, "scpi")
        line = RecordedLine(int(address.rpartition(":")[2]))
        (found,) = _who("scpi", f"socket://127.0.0.1:{line.port}")
        line.close()
        assert set(found.answers) == {"maker", "model", "serial", "version"}
        assert b"".join(line.asked) == b"*IDN?\n"


def test_a_foreign_server_tells_its_name():
    with _pymodbus() as port:
        (found,) = _who("modbus", f"127.0.0.1:{port}", units="7", timeout_s="1")
        assert found == Found("unit 7", {"maker": "Somebody", "product": "XY", "version": "1.2"})


@contextmanager
def _pymodbus() -> Iterator[int]:
    """A server of another library, which speaks by itself."""
    import asyncio

    from pymodbus import ModbusDeviceIdentification
    from pymodbus.datastore import ModbusDeviceContext
    from pymodbus.server import ModbusTcpServer

    port, loop, up = free_port(), asyncio.new_event_loop(), threading.Event()
    identity = ModbusDeviceIdentification(
        info_name={"VendorName": "Somebody", "ProductCode": "XY", "MajorMinorRevision": "1.2"}
    )
    servers = []

    async def serve() -> None:
        device = ModbusDeviceContext(hr=ModbusSequentialDataBlock(1, [0] * 10))
        server = ModbusTcpServer(
            ModbusServerContext(devices=device, single=True), identity=identity, address=("127.0.0.1", port)
        )
        servers.append(server)
        task = asyncio.ensure_future(server.serve_forever())
        while True:
            with suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.1):
                break
            await asyncio.sleep(0.02)
        up.set()
        with suppress(asyncio.CancelledError):
            await task

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    assert up.wait(600.0)
    try:
        yield port
    finally:
        asyncio.run_coroutine_threadsafe(servers[0].shutdown(), loop).result(600.0)
        thread.join(600.0)
        loop.close()


def test_faults_in_one_line(tmp_path):
    with pytest.raises(UnknownNameError, match="known: can, modbus, scpi"):
        _who("profibus", "x")
    with pytest.raises(SettingError, match=r"bauds: .*there are: address, units, baud"):
        _who("modbus", "127.0.0.1:502", bauds="9600")
    with pytest.raises(SettingError, match=r"units: unit numbers 0 … 255"):
        _who("modbus", "127.0.0.1:502", units="1-3")
    with pytest.raises(SettingError, match="not INTERFACE:CHANNEL"):
        _who("can", "can0")
    with pytest.raises(DeviceLostError, match="cannot be reached"):
        _who("modbus", f"127.0.0.1:{free_port()}")


def test_command_line(tmp_path, command_line):
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (_, devices):
        (device,) = devices.values()
        told = ["probe", "modbus", f"127.0.0.1:{device.port}", "--set", "units=1", "--set", "timeout_s=5.0"]
        assert command_line(*told).out.startswith("unit")
        answer = json.loads(command_line(*told, "--json").out)
        assert answer["schema"] == "hil.probe/1" and answer["found"]
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        found = command_line("probe", "scpi", f"socket://127.0.0.1:{port}", "--set", "timeout_s=1.0")
        assert found.status == LinkError.exit_status and "nobody answers (baud = 115200" in found.err
