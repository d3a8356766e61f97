"""Tests under adjusted conditions over links: the figures are those of the same bench without one."""

import math
import re
import signal
import socket
import struct
import subprocess
import sys

import pytest

import hil
from tests.links import served
from tests.waits import until

SETTINGS = {"commands": (100.0,), "supplies": (50.0, 100.0, 150.0), "hold_s": 2.0}


@pytest.mark.slow
@pytest.mark.parametrize(("link", "watchdog"), [("modbus", "watchdog_s = 1.0\n"), ("can", "watchdog_s = 0.5\n")])
def test_figures_over_a_link_are_those_without_it(link, watchdog, tmp_path):
    direct = hil.run("flow_over_pressure_drop", "four-way-lab", settings=SETTINGS, out=tmp_path / "direct")
    with served(f"four-way-lab-{link}", tmp_path, (watchdog, "watchdog_s = 10.0\n")) as (file, _):
        linked = hil.run("flow_over_pressure_drop", file, settings=SETTINGS, out=tmp_path / "linked")
    assert len(direct.findings.measured) >= 4
    for here, there in zip(direct.findings.measured, linked.findings.measured, strict=True):
        assert here.name == there.name
        assert abs(here.value - there.value) < math.hypot(here.std, there.std), here.name


@pytest.mark.slow
def test_killed_between_pump_and_valve_every_output_is_safe(tmp_path):
    """Stopped, the pressure goes down first and the command stands: there the program is killed."""
    with served("four-way-lab-modbus", tmp_path, ("watchdog_s = 1.0\n", "")) as (file, _):
        port = int(re.findall(r":(\d+)\"", file.text)[0])  # of the first device, which has the command
        told = ["step_response", "--bench", str(file.path), "--set", "levels=0,50", "--set", "hold_s=60"]
        with (
            socket.create_connection(("127.0.0.1", port)) as link,
            subprocess.Popen(
                [sys.executable, "-m", "hil", "run", *told, "--out", str(tmp_path / "run")],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            ) as program,
        ):

            def outputs():
                """Codes of command, supply, load and tank, as another master reads them back."""
                assert program.poll() is None or has_stood, "it ended before it drove the command"
                link.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 512, 4))
                answer = b""
                while len(answer) < 17:
                    answer += link.recv(17 - len(answer))
                return struct.unpack(">4h", answer[9:])

            has_stood = False
            try:
                until(lambda: outputs()[0] > 16_000)
                has_stood = True
                pump = outputs()[1]
                program.send_signal(signal.SIGINT)
                until(lambda: outputs()[1] < pump, every_s=0.002)
                command = outputs()[0]
            finally:
                program.kill()
            assert command > 16_000
            until(lambda: outputs() == (0, 0, 0, 0))
