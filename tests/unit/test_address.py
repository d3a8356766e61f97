"""What an address leads to, under whatever name, and that a port stays the one that was opened."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers import modbus
from drivers._line import Line, SerialSettings
from drivers._modbus_line import ModbusLine
from hil.bench.fail_safe_shutdown import FailSafeShutdown, tried_once
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.bench.stop.stop_service import StopService
from hil.daq import address
from hil.daq.address import Port, places_of
from hil.daq.channel import Wiring
from hil.errors import DeviceLostError, FileError
from tests.channels import outputs
from tests.links import PATIENT, served

HERE = ["this computer:502"]


@pytest.fixture
def ports(tmp_path):
    """Two serial lines."""
    pairs = [os.openpty() for _ in range(2)]
    yield [os.ttyname(slave) for _, slave in pairs]
    for pair in pairs:
        for end in pair:
            os.close(end)


@pytest.mark.parametrize(
    "text",
    ["127.0.0.1:502", "localhost:502", "[::1]:502", "::1:502", "::ffff:127.0.0.1:502", "0.0.0.0:502", "127.0.0.1:0502",
     "socket://localhost:502", "SOCKET://127.0.0.1:502", "rfc2217://127.0.0.1:502?ign_set_control",
     "socketcand:localhost:502"],
)  # fmt: skip
def test_this_computer_is_one_place(text):
    assert places_of(text) == HERE


def test_other_places_are_others():
    seen = [places_of(text) for text in ("127.0.0.1:503", "127.0.0.2:502", "192.0.2.1:502", "no.such.invalid:502")]
    assert seen == [["this computer:503"], ["127.0.0.2:502"], ["192.0.2.1:502"], ["no.such.invalid:502"]]
    assert places_of("pcan:PCAN_USBBUS1") == ["pcan:PCAN_USBBUS1"] and places_of("virtual:a") == ["virtual:a"]


def test_an_instrument_is_one_place_by_vxi11_and_hislip_and_on_every_spelling():
    lan = ("TCPIP::192.0.2.1::INSTR", "tcpip0::192.0.2.1::inst0::instr", "TCPIP0::192.0.2.1::hislip0::INSTR")
    assert {tuple(places_of(text)) for text in lan} == {("instrument 0 at 192.0.2.1:0",)}
    assert places_of("TCPIP::192.0.2.1::gpib0,5::INSTR") != places_of("TCPIP::192.0.2.1::gpib0,6::INSTR")
    assert places_of("GPIB::12::INSTR") == places_of("gpib0::12::INSTR") != places_of("GPIB1::12::INSTR")


@pytest.mark.parametrize("text", ["TCPIP::192.0.2.1::5025::SOCKET", "ASRL1::INSTR", "USB0::1::2::3::RAW"])
def test_what_of_visa_is_not_used_is_refused_with_what_is(text):
    assert "socket://host:port" in address.address_fault(text)


@pytest.mark.parametrize(
    "text", ["socket://", "socket://:4001", "rfc2217://10.0.0.5", "socket://10.0.0.5:99999", "SOCKET://a:b"]
)
def test_a_serial_server_has_a_host_and_a_port(text):
    assert address.address_fault(text) == f"'{text}': no {text.partition(':')[0].lower()}://host:port"
    assert address.address_fault("rfc2217://10.0.0.5:4001?logging=debug") == ""
    assert address.address_fault("socket://[::1]:4001") == ""


@pytest.mark.skipif(not Path("/sys/class/net/lo").exists(), reason="needs a network interface that is known")
def test_a_bus_is_its_network_interface():
    index = Path("/sys/class/net/lo/ifindex").read_text(encoding="ascii").strip()
    assert places_of("socketcan:lo") == [f"network interface {index}"]


def test_a_port_is_one_under_every_link_to_it(ports, tmp_path):
    (tmp_path / "by-id").symlink_to(ports[0])
    (tmp_path / "again").symlink_to(tmp_path / "by-id")
    assert places_of(ports[0]) == places_of(f"{tmp_path}/by-id") == places_of(f"{tmp_path}/again")
    assert places_of(ports[0]) != places_of(ports[1])
    assert places_of(f"{tmp_path}/gone") == [f"{tmp_path}/gone"]


def test_a_name_that_belongs_to_another_port_is_refused(ports, tmp_path):
    name = tmp_path / "name"
    name.symlink_to(ports[0])
    port = Port(str(name))
    assert port.path() == port.path() == str(name)
    name.unlink()
    with pytest.raises(DeviceLostError, match="name: cannot be opened, no such port: No such file"):
        port.path()
    name.symlink_to(ports[1])
    with pytest.raises(
        DeviceLostError, match=r"another device has this name now \(device number .*\), not the one that was opened"
    ):
        port.path()
    name.unlink()
    name.symlink_to(ports[0])
    assert port.path() == str(name)


def test_usb_adapters_are_known_by_number_or_place(ports, monkeypatch):
    def adapter(device, number, place):
        return SimpleNamespace(device=device, vid=0x0403, pid=0x6001, serial_number=number, location=place)

    plugged = [adapter(ports[0], "A50285BI", "1-1.4"), adapter(ports[1], None, "1-1.2")]
    monkeypatch.setattr(address, "_ports", lambda: plugged)
    known, placed = Port("usb:A50285BI"), Port("usb:1-1.2")
    assert [known.path(), placed.path()] == ports
    assert places_of("usb:A50285BI") == places_of(ports[0])
    plugged[:] = [adapter(ports[1], "A50285BI", "1-1.3")]  # the same adapter, plugged in again elsewhere
    assert known.path() == ports[1]
    by_name = Port(ports[1])
    by_name.path()
    plugged[:] = [adapter(ports[1], "OTHER", "1-1.3")]
    with pytest.raises(
        DeviceLostError, match=r"\(USB adapter 0403:6001 number OTHER\), not the one .* number A50285BI"
    ):
        by_name.path()
    with pytest.raises(DeviceLostError, match=r"no USB adapter has this number or place; there are: OTHER at 1-1.3"):
        known.path()
    plugged[:] = [adapter(port, "TWICE", f"1-1.4:1.{i}") for i, port in enumerate(ports)]
    with pytest.raises(DeviceLostError, match="2 ports have it, say the place of one"):
        Port("usb:TWICE").path()
    assert Port("usb:1-1.4:1.1").path() == ports[1]


@pytest.mark.parametrize("text", ["spy:///dev/ttyUSB0?file=/tmp/x", "SPY://COM1", "alt:///dev/x?class=y", "loop://"])
def test_addresses_that_write_files_or_lead_elsewhere_are_refused(text, tmp_path):
    path = tmp_path / "bench.toml"
    good = benches()["hpv41-serial"].read_text(encoding="utf-8")
    path.write_text(good.replace("socket://127.0.0.1:14001", text), encoding="utf-8")
    with pytest.raises(
        FileError, match=r"address: '.*' ?: .*:// is refused; a serial line is a port such as /dev/ttyUSB0"
    ):
        read_bench(path)
    with pytest.raises(DeviceLostError, match=":// is refused"):
        Line(SerialSettings(address=text, timeout_s=0.1, longest_reply_s=0.3), "\r", "\r", driver="ascii_module")


def test_the_coupler_that_has_the_name_of_a_lost_one_is_left_alone(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    wiring = Wiring(outputs({"command": "ao0"}), {})
    bench = "hpv41-modbus-rtu"
    with served(bench, tmp_path / "a", *PATIENT) as (file, _), served(bench, tmp_path / "b", *PATIENT) as (_, twins):
        settings = modbus.Settings.model_validate(file.bench.devices["io"].settings)
        name, there = Path(settings.address), Path(twins["io"].where)
        other = modbus.open_link(settings.model_copy(update={"address": str(there)}), wiring)
        other.drive({"ao0": 3.0})
        other.close()
        watched = file.devices["io"]
        watched.open(file.bench.channels).close()
        link = modbus.open_link(settings, wiring)
        link.drive({"ao0": 5.0})
        link.close()  # the adapter is pulled, and another one gets its name
        own = name.readlink()
        name.unlink()
        name.symlink_to(there.readlink())
        with pytest.raises(DeviceLostError, match="another device has this name now"):
            link.drive({"ao0": 0.0})
        with pytest.raises(DeviceLostError, match="another device has this name now"):
            watched.open(file.bench.channels)
        other = modbus.open_link(settings.model_copy(update={"address": str(there)}), wiring)
        assert other.standing()["ao0"] == pytest.approx(3.0, abs=1e-3)
        other.close()
        name.unlink()
        name.symlink_to(own)
        link.drive({"ao0": 0.0})
        assert link.standing()["ao0"] == 0.0
        link.close()


def test_a_port_that_another_program_has_is_said_to_be_so(tmp_path):
    with served("hpv41-modbus-rtu", tmp_path, *PATIENT) as (file, _):
        settings = modbus.Settings.model_validate(file.bench.devices["io"].settings)
        held = os.open(settings.address, os.O_RDWR | os.O_NOCTTY)
        fcntl.flock(held, fcntl.LOCK_EX)  # as another program that has it alone
        with pytest.raises(DeviceLostError, match="cannot be opened: another program has it"):
            modbus.open_link(settings, Wiring({}, {}))
        os.close(held)
        modbus.open_link(settings, Wiring({}, {})).close()


def _at(settings: modbus.Settings, address: str, volts: float | None = None) -> float:
    """Where an output stands at an address, driven there first."""
    wiring = Wiring(outputs({"command": "ao0"}), {})
    link = modbus.open_link(settings.model_copy(update={"address": address}), wiring)
    if volts is not None:
        link.drive({"ao0": volts})
    stands = link.standing()["ao0"]
    link.close()
    return float(stands)


@pytest.mark.parametrize("numbered", [False, True])
def test_the_watchdog_writes_to_its_own_adapter_under_any_name_or_to_none(numbered, tmp_path, monkeypatch):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    bench = "hpv41-modbus-rtu"
    with served(bench, tmp_path / "a", *PATIENT) as (file, _), served(bench, tmp_path / "b") as (_, twins):
        settings = modbus.Settings.model_validate(file.bench.devices["io"].settings)
        name, there, own = Path(settings.address), twins["io"].where, Path(settings.address).readlink()
        if numbered:
            monkeypatch.setattr(address, "_ports", lambda: [
                SimpleNamespace(device=str(port), vid=0x0403, pid=0x6001, serial_number=number, location=None)
                for port, number in ((own, "OURS"), (Path(there).readlink(), "THEIRS"))
            ])  # fmt: skip
        for at in (str(own), there):
            _at(settings, at, 3.0)
        assert tried_once(file) == [] and _at(settings, str(own)) == 0.0
        _at(settings, str(own), 3.0)
        name.unlink()
        name.symlink_to(Path(there).readlink())  # two adapters swap their names
        left = tried_once(file)
        assert len(left) == (0 if numbered else 1)
        assert all("another device has this name now" in text and "not there" not in text for text in left)
        stands = [_at(settings, at) for at in (str(own), there)]
        assert stands == pytest.approx([0.0 if numbered else 3.0, 3.0], abs=1e-3)


@pytest.mark.parametrize(
    ("said", "says", "stands"),
    [("another one", "another device answers: it says that it is another one; WAGO", 3.0),
     ("", "it does not say what it is; WAGO", 0.0)],
)  # fmt: skip
def test_who_answers_as_another_one_is_told_nothing_and_who_says_nothing_is_told_to_be_safe(
    said, says, stands, tmp_path, monkeypatch
):
    with served("hpv41-modbus-tcp", tmp_path, ("watchdog_s = 1.0", "")) as (file, _):
        settings = modbus.Settings.model_validate(file.bench.devices["io"].settings)
        monkeypatch.setattr(ModbusLine, "identity", lambda _line: "WAGO")
        shutdown = FailSafeShutdown(file, StopService({}, "watchdog", lambda _wish: None))
        assert tried_once(file) == []
        _at(settings, settings.address, 3.0)
        monkeypatch.setattr(ModbusLine, "identity", lambda _line: said)
        shutdown.one_attempt()
        assert says in shutdown.left[0]
        assert shutdown.outputs["command"].state == ("unknown" if said else "unconfirmed")
        assert _at(settings, settings.address) == pytest.approx(stands, abs=1e-3)


def test_who_answers_as_another_one_is_another_device(tmp_path):
    with served("hpv41-serial", tmp_path, *PATIENT) as (file, _):
        device = file.devices["module"]
        for _ in range(2):
            device.open(file.bench.channels).close()
        device.pin.identity = "another module at 01"
        with pytest.raises(
            DeviceLostError, match=r"it says that it is .* at 01; another module at 01 was opened before"
        ):
            device.open(file.bench.channels)
