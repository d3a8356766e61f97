"""The driver of SCPI on VXI-11 and HiSLIP: the conformance suite, and no old write that arrives after the safe one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers._visa import VisaPort
from hil.bench.read import BenchFile, read_bench
from hil.bench.twin import serve, subject
from hil.daq.conformance import examine
from hil.errors import HardwareError, LinkError
from hil.system import system
from sim_devices import _lines_of_text
from tests import visa_servers
from tests.contract.test_drivers import SCANNER, broken
from tests.links import bench_text, free_port
from tests.lost_packets import lost

pytest.importorskip("pyvisa_py")
pytestmark = pytest.mark.xdist_group("waits for instruments")
ON_TCP = {"VXI-11": "TCPIP::127.0.0.1,{port}::INSTR", "HiSLIP": "TCPIP::127.0.0.1::hislip0,{port}::INSTR"}
AT_THE_SEAM = {"USBTMC": "USB0::0x0957::0x0407::MY{port}::INSTR", "GPIB": "GPIB0::12::INSTR"}
ADDRESSES = ON_TCP | AT_THE_SEAM


@pytest.fixture
def bench(request, tmp_path, monkeypatch):
    """A bench whose scanner is on this transport."""
    monkeypatch.setattr(_lines_of_text, "serve_stream", visa_servers.serve)
    if request.param in AT_THE_SEAM:
        monkeypatch.setattr(system, "visa", visa_servers.Resource, raising=False)
    text = bench_text("hpv41-modbus-tcp", *SCANNER)
    path = tmp_path / "bench.toml"
    path.write_text(text.replace("/tmp/scanner", ADDRESSES[request.param].format(port=free_port())), encoding="utf-8")
    return read_bench(path)


@contextmanager
def served_by(bench: BenchFile, folder: Path) -> Iterator[tuple[Any, Callable[[str], float]]]:
    """The server of its scanner, and where that holds an output."""
    served = serve(bench, folder, {})
    with closing(served["io"]) as server:
        yield server, server.side.standing


@pytest.mark.parametrize("bench", ADDRESSES, indirect=True)
def test_driver_passes_on_its_twin(bench, tmp_path):
    with subject(bench, tmp_path, "scpi") as driver:
        results = list(examine(driver))
    assert broken(results) == {}
    assert sum(result.verdict == "passed" for result in results) >= 8


@pytest.mark.parametrize("bench", ["VXI-11"], indirect=True)
def test_an_instrument_that_does_not_even_say_that_it_has_nothing_to_say_gave_no_answer(bench, tmp_path, monkeypatch):
    """The library waited a second more, and took that for a line that is gone."""
    device = bench.devices["io"]
    wiring, for_ever = device.wiring(bench.bench.channels), threading.Event()
    with served_by(bench, tmp_path):
        link = device.pin.link(wiring)
        monkeypatch.setattr(visa_servers.Vxi11Server, "fetch", lambda *_: b"" * for_ever.wait())
        with pytest.raises(LinkError, match="no answer within 1 s"):
            link.standing()
        for_ever.set()
        link.close()


def test_a_port_of_which_the_library_does_not_tell_its_connection_is_closed(monkeypatch):
    closed = []
    resource = SimpleNamespace(visalib=SimpleNamespace(sessions={}), session=1, close=lambda: closed.append(True))
    monkeypatch.setattr(system, "visa", lambda *_: resource, raising=False)
    with pytest.raises(KeyError):
        VisaPort(ON_TCP["VXI-11"], 1.0, b"\n")
    assert closed


@pytest.mark.parametrize("bench", ON_TCP, indirect=True)
def test_what_was_driven_while_packets_were_lost_never_arrives_after_the_safe_value(bench, tmp_path):
    """The server takes nothing in for a while; a closed socket of the kernel's own would send again within 0.8 s."""
    device = bench.devices["io"]
    wiring = device.wiring(bench.bench.channels)
    (output,) = wiring.outputs.values()
    with served_by(bench, tmp_path) as (server, standing):
        link = device.pin.link(wiring)
        link.drive({output.terminal: 2.0})
        with lost(*server.sockets):
            with pytest.raises(HardwareError):
                link.drive({output.terminal: 7.0})
            link.close()
            time.sleep(0.5)
        rescuer = device.pin.link(wiring)
        rescuer.drive({output.terminal: output.safe})
        until_s, stood = time.monotonic() + 2.0, set()
        while time.monotonic() < until_s:
            stood.add(standing(output.terminal))
            time.sleep(0.01)
        rescuer.close()
    assert stood == {output.safe}
