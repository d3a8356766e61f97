"""One program at a time drives a bench: the lease, and what a second program is told."""

import json
import os
import signal
import subprocess
import sys

import pytest

from hil.bench import watchdog
from hil.bench.find import benches
from hil.bench.lease import leased
from hil.bench.read import read_bench
from hil.bench.stop.stop_service import StopService
from hil.errors import InUseError

pytestmark = pytest.mark.usefixtures("own_state")

HOLD = """
import sys, time
from pathlib import Path
from hil.bench.lease import leased
from hil.bench.read import read_bench
with leased(read_bench(Path(sys.argv[1]))):
    print("held", flush=True)
    time.sleep(120)
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(benches()["hpv41-modbus-tcp"].read_text(encoding="utf-8"), encoding="utf-8")
    return read_bench(path)


@pytest.fixture
def holder(file):
    """Another program that holds the bench."""
    with subprocess.Popen([sys.executable, "-c", HOLD, str(file.path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_second_program_is_told_who_drives(file, holder):
    says = rf"HPV41 on Modbus TCP: in use by process {holder.pid} .* since 20"
    with pytest.raises(InUseError, match=says) as told, leased(file):
        pass
    assert (told.value.pid, told.value.exit_status) == (holder.pid, 2)


def test_a_device_is_one_under_every_name_of_this_computer(file, holder, tmp_path):
    copy = tmp_path / "copy.toml"
    text = file.text.replace("HPV41 on Modbus TCP", "another name")
    for name in ("localhost", "LOCALHOST", "127.0.0.1", "[::1]", "[::ffff:127.0.0.1]", "0.0.0.0"):
        copy.write_text(text.replace("127.0.0.1", name), encoding="utf-8")
        with pytest.raises(InUseError, match=f"in use by process {holder.pid}") as told, leased(read_bench(copy)):
            pass
        assert f"device at {name}:15502: in use" in str(told.value)


def test_a_board_with_a_driver_of_its_maker_is_known_by_its_name_there(tmp_path):
    text = benches()["hpv41-usb-6211"].read_text(encoding="utf-8")
    for name in ("one", "two"):
        (tmp_path / name).write_text(text.replace('name = "', f'name = "{name} ', 1), encoding="utf-8")
    one, two = (read_bench(tmp_path / name) for name in ("one", "two"))
    with leased(one), pytest.raises(InUseError, match="device at Dev1: in use by process"), leased(two):
        pass


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_lease_of_a_dead_program_is_free(file, holder, number):
    holder.send_signal(number)
    holder.wait()
    with leased(file), pytest.raises(InUseError, match=f"process {os.getpid()}"), leased(file):
        pass
    with leased(file):  # and again: nothing is left behind
        pass


def test_a_bench_that_begins_anew_with_each_run_needs_none():
    simulated = read_bench(benches()["brevini-hpv41"])
    with leased(simulated), leased(simulated):
        pass


def test_the_watchdog_leaves_a_bench_alone_that_another_program_has_taken_over(
    file, holder, tmp_path, capsys,
    monkeypatch,
):  # fmt: skip
    monkeypatch.setattr(watchdog, "GIVE_UP_S", 0.3)
    watchdog.take_over(
        watchdog.Reporter(file, tmp_path, os.getpid(), "ended"), StopService({}, "watchdog", lambda _wish: None)
    )
    told = json.loads((tmp_path / "watchdog.json").read_text(encoding="utf-8"))
    assert told["why"] == "ended" and f"in use by process {holder.pid}" in told["left_alone"]
    assert f"hil watchdog: process {os.getpid()} ended; bench" in capsys.readouterr().err
