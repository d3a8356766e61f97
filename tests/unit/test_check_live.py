"""`hil check --live`: what a bench can measure, with no output opened."""

import json

import pytest

from hil.bench.find import benches
from hil.bench.manual.live import look_at
from hil.bench.read import read_bench
from hil.errors import LinkError
from hil.session.feasibility import infeasibility
from hil.session.procedure import load_procedure
from sim_devices._quirks import Quirks
from tests.bench_files import bench_file
from tests.links import PATIENT, served
from tests.recorded_line import recorded


def test_a_simulated_bench():
    seen = look_at(read_bench(benches()["brevini-hpv41"]), 1.0)
    inputs = {one.reading.name: one for one in seen.inputs}
    step = 10.0 * 20.0 * 1.048 / 65536  # 10 l/min per V, ±10 V and 2.4 % more either side, 16 bit
    assert inputs["flow"].resolution == pytest.approx(step, rel=0.06)
    assert inputs["flow"].reading.noise == pytest.approx(0.3, rel=0.15) and not seen.remarks
    assert seen.rate_hz == 1000.0 and seen.fastest_hz == 50.0


def test_a_polled_link_is_measured_and_nothing_is_written(tmp_path):
    with served("hpv41-modbus-tcp", tmp_path, *PATIENT) as (file, devices):
        (device,) = devices.values()
        device.behaviour.quirks = Quirks(late_s=0.03)
        with recorded(file, device.port) as (through, line):
            seen = look_at(through, 1.0)
    (link,) = seen.links
    assert link.latency_s is not None and link.latency_s > 0.03
    assert link.rate_hz < 27.0 and seen.rate_hz < 0.6 * link.rate_hz
    assert line.modbus_functions <= {3, 4, 43}


def test_what_is_not_plausible_is_told(tmp_path):
    dead = {"instruments": {"supply pressure": {"value": 0.0}}}
    path = bench_file(tmp_path / "bench.toml", "brevini-hpv41", simulation=dead)
    (remark,) = look_at(read_bench(path), 0.5).remarks
    assert remark.startswith("'supply pressure':") and "of interlock 'pressure-lost'" in remark


def test_procedures_that_can_run_and_what_keeps_the_others():
    file = read_bench(benches()["brevini-hpv41"])
    assert infeasibility(load_procedure("frequency_response"), file, 1000.0) == ""
    assert "the bench makes 30 Hz as measured" in infeasibility(load_procedure("frequency_response"), file, 30.0)
    assert "through flow" in infeasibility(load_procedure("leakage_check"), file, 1000.0)


def test_command_line(tmp_path, command_line):
    found = command_line("check", "brevini-hpv41", "--live", "--json")
    told = json.loads(found.out)
    assert found.status == 0 and told["schema"] == "hil.live/1"
    assert {p["name"]: p["can_run"] for p in told["procedures"]}["step_response"]
    nobody = bench_file(tmp_path / "nobody.toml", "hpv41-modbus-tcp", devices={"io": {"address": "127.0.0.1:1"}})
    found = command_line("check", nobody, "--live")
    assert found.status == LinkError.exit_status and "io: 127.0.0.1:1: cannot be reached" in found.err


def test_a_device_that_does_not_answer_hides_no_other(tmp_path, command_line):
    with served("hpv41-mixed", tmp_path, *PATIENT) as (file, devices):
        name, device = next(
            (name, one) for name, one in devices.items() if f"127.0.0.1:{getattr(one, 'port', 0)}" in file.text
        )
        path = tmp_path / "one-away.toml"
        path.write_text(file.text.replace(f"127.0.0.1:{device.port}", "127.0.0.1:1"), encoding="utf-8")
        found = command_line("check", path, "--live")
    lines = found.out.splitlines()
    assert found.status == LinkError.exit_status and found.err.startswith(f"hil: {name}: ")
    assert f"  link {name}: does not answer" in lines
    assert any(line.startswith("  link ") and "all inputs read in" in line for line in lines)
    assert f"  cannot run step_response: {name} must answer first" in lines and "  can run: nothing" in lines
