"""The rehearsal: what would trip or leave the envelope is refused before the bench is touched."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit

from hil.archive.archive import Search, find_runs
from hil.archive.place import archive_place
from hil.bench.fault import BenchError
from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.bench.rehearsal import twin_of
from hil.errors import HilError, RehearsalError, SettingError
from hil.session.procedure import load_procedure
from hil.session.run import rehearse_procedure
from tests.bench_files import bench_file

LOW_FLOW = {"dead-flow-meter": {"stale_s": None, "high": 10.0}}


@pytest.fixture
def tiny(stranger):
    assert stranger.is_dir()
    return load_procedure("tiny_step")


def bench(tmp_path: Path, name: str, **tables: Any) -> BenchFile:
    return read_bench(bench_file(tmp_path / f"{name}.toml", name, **tables))


@pytest.mark.parametrize("name", sorted(benches()))
def test_every_bench_has_a_twin_in_virtual_time(name):
    file = read_bench(benches()[name])
    twin = twin_of(file)
    daq = twin.open()
    try:
        assert twin.is_simulated
        assert daq.promises.timing == "virtual"
        assert set(daq.outputs) | set(daq.inputs) == set(file.bench.channels)
        assert daq.actual_rate_hz(file.bench.sample_rate_hz) == file.bench.sample_rate_hz
    finally:
        daq.close()


def test_nothing_is_asked_of_the_devices_themselves(tiny, tmp_path):
    unreachable = bench(tmp_path, "hpv41-modbus-tcp")
    said = []
    shown = rehearse_procedure(tiny, unreachable, {"levels": "40"}, lambda _done, text: said.append(text))
    assert 2.0 <= shown.bench_s < 4.0
    assert shown.indications == ()
    assert any(text.startswith("rehearsal: round 1; command 40.0 %") for text in said)
    assert all(text.startswith("rehearsal: ") for text in said)
    assert not list(tmp_path.glob("runs*"))


@pytest.mark.parametrize(
    ("locks", "settings", "says"),
    [
        ({"over-pressure": {"high": 90.0}}, {}, r"interlock 'over-pressure': .* allowed: supply pressure ≤ 90 at"),
        ({}, {"levels": "120"}, r"output 'command', sample 0: 120 % is outside -100 … 100 %"),
        (
            {"dead-flow-meter": {"stale_s": None, "high": 10.0}},
            {"levels": "80"},
            r"interlock 'dead-flow-meter': .* flow ≤ 10 at",
        ),
        ({}, {"limit": "20", "levels": "30"}, r"output 'command', sample 0: 30 % is outside -20 … 20 %"),
    ],
)
@pytest.mark.parametrize("name", ["brevini-hpv41", "hpv41-modbus-tcp"])
def test_refused_with_the_reason(tiny, tmp_path, name, locks, settings, says):
    file = bench(tmp_path, name, interlocks=locks)
    with pytest.raises(RehearsalError, match=rf"refused: in the rehearsal on the simulated .*, {says}") as refused:
        rehearse_procedure(tiny, file, settings)
    assert str(refused.value).endswith("nothing was driven")
    assert "--reset" not in str(refused.value)
    assert refused.value.exit_status == 2


def test_a_refused_rehearsal_is_no_run(tmp_path, command_line):
    file = bench(tmp_path, "brevini-hpv41", interlocks={"over-pressure": {"high": 90.0}})
    out, archive = tmp_path / "kept", tmp_path / "runs"
    asked = ["--bench", file.path, "--rehearse-only", "--out", out, "--archive", archive]
    assert command_line("run", "step_response", *asked).status == 2
    assert not out.exists()
    assert find_runs(archive_place(str(archive)), Search()) == []


def test_an_indication_is_told(tiny, tmp_path):
    told = {"dead-flow-meter": {**LOW_FLOW["dead-flow-meter"], "action": "indicate"}}
    file = bench(tmp_path, "brevini-hpv41", interlocks=told)
    (text,) = rehearse_procedure(tiny, file, {"levels": "80"}).indications
    assert text.startswith("interlock 'dead-flow-meter'")


def test_a_channel_that_the_plant_does_not_have_is_named(tmp_path):
    file = bench(tmp_path, "hpv41-modbus-tcp")
    content = tomllib.loads(file.text)
    for table in (content["channels"], content["simulation"]["instruments"]):
        table["oil temperature"] = table.pop("spool position")
    file.path.write_text(tomlkit.dumps(content), encoding="utf-8")
    with pytest.raises(SettingError, match=r"there is no twin of this bench: .*no signal 'oil temperature'"):
        twin_of(read_bench(file.path))


def test_the_seed_can_be_chosen(tiny):
    def noise(seed):
        from hil.daq.contract import Waveform

        daq = twin_of(read_bench(benches()["hpv41-modbus-tcp"]), seed).open()
        (block,) = daq.play(Waveform(100.0, {"command": np.zeros(50)}))
        return block.inputs["flow"]

    assert np.array_equal(noise(3), noise(3))
    assert not np.array_equal(noise(3), noise(4))


def test_other_faults_stay_what_they_are(tiny):
    with pytest.raises(HilError, match="no setting 'level'"):
        rehearse_procedure(tiny, read_bench(benches()["brevini-hpv41"]), {"level": "5"})


def test_a_watchdog_process_needs_three_blocks(tmp_path):
    with pytest.raises(BenchError, match=r"watchdog_s 0\.2: at least three times block_s = 0\.1, or 0"):
        bench(tmp_path, "hpv41-modbus-tcp", protection={"watchdog_s": 0.2})
