"""Endurance: figures by formula, stops at the stated rate and no earlier, and a run that was broken off thrice."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.bench.read import BenchFile, read_bench
from hil.errors import SettingError, StoppedError
from hil.record.folder import read
from hil.session.outcome import Outcome
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from hil.session.setting import parse_settings
from procedures.endurance import FIGURES, Block, along, figures_of, of_newest
from tests.bench_files import bench_file

pytestmark = pytest.mark.usefixtures("unprinted")

RATE_HZ = 100.0
SETTINGS = {"cycles": "60", "keep_every": "5", "rate_hz": f"{RATE_HZ:g}", "amplitude": "80"}
SAMPLES = 100  # of a cycle of 1 s
CREEP_L_MIN_S = 0.1


def bench_of(folder: Path, **tables: Any) -> BenchFile:
    return read_bench(bench_file(folder / "bench.toml", "brevini-hpv41", **tables))


def driven(file: BenchFile, out: Path, say: Callable[[float, str], None] = lambda *_: None, **more: str) -> Outcome:
    return run_procedure(load_procedure("endurance"), file, {**SETTINGS, **more}, out, say)


@pytest.mark.parametrize("cycles", [1, 7])
def test_figures_are_those_of_the_formula(cycles):
    phase = 2.0 * math.pi * np.arange(500) / 500
    command = np.tile(20.0 - 8.0 * np.cos(phase), (cycles, 1))
    response = 3.0 - 4.0 * np.cos(phase - math.radians(30.0)) + 0.6 * np.cos(3.0 * phase)
    found = figures_of(command, np.tile(response, (cycles, 1)))
    expected = np.array([0.5, -30.0, 3.0, 0.6 / math.sqrt(2.0), 4.0])
    np.testing.assert_allclose(found, np.tile(expected[:, None], cycles), atol=1e-9)


def blocks_of(values: np.ndarray, cycles: int = 10) -> list[Block]:
    std = dict.fromkeys(FIGURES, 0.0)
    means = [{"gain": 1.0, "phase": -20.0, "residual": 0.1, "amplitude": 50.0, "offset": float(v)} for v in values]
    return [Block(cycles * i, cycles, mean, std) for i, mean in enumerate(means)]


def test_a_drift_is_held_as_often_as_its_interval_states():
    noise = np.random.default_rng(1).normal(size=(400, 12))
    ramp = (np.arange(12) + 0.5) / 12.0  # of the whole run, in the middle of each block
    changes = [along(blocks_of(2.0 * ramp + row), "offset") for row in noise]
    held = sum(change.chance(0.0) >= 0.0 and abs(change.percent - 4.0) <= 2.228 * change.std for change in changes)
    assert {change.freedom for change in changes} == {10}  # Student's t of 10 at 95 %
    assert 367 <= held <= 392


@pytest.mark.parametrize("change_of", [along, of_newest])
def test_a_figure_at_rest_is_taken_for_moved_no_more_often_than_stated(change_of):
    noise = np.random.default_rng(2).normal(size=(2000, 10))
    chances = np.array([change_of(blocks_of(row), "offset").chance(0.0) for row in noise])
    assert 70 <= np.count_nonzero(chances < 0.05) <= 132
    assert max(change_of(blocks_of(row), "offset").chance(20.0) for row in noise[:20]) == 1.0


def test_a_break_shows_in_the_newest_block_and_wear_along_the_line():
    values = 0.01 * np.random.default_rng(3).normal(size=40)
    broken, worn = values + 10.0 * (np.arange(40) == 39), values + 0.01 * np.arange(40)
    assert of_newest(blocks_of(broken), "offset").chance(5.0) < 1e-9 < along(blocks_of(broken), "offset").chance(5.0)
    assert along(blocks_of(worn), "offset").chance(0.5) < 1e-9
    assert of_newest(blocks_of(worn), "offset").chance(0.5) > 1e-3


def test_a_phase_that_passes_180_degrees_does_not_jump():
    blocks = [Block(10 * i, 10, {"gain": 1.0, "phase": phase, "amplitude": 1.0}, {})
              for i, phase in enumerate([179.0, -180.0, -179.0, -178.0])]  # fmt: skip
    assert along(blocks, "phase").percent == pytest.approx(100.0 * math.radians(4.0))


def test_a_run_that_was_broken_off_thrice_finds_what_an_unbroken_one_finds(tmp_path):
    file = bench_of(tmp_path)
    whole = driven(file, tmp_path / "whole")
    folder: Path | None = None
    for k, stop in enumerate(("10 of 60", "25 of 60", "45 of 60")):
        out = tmp_path / f"broken{k}"

        def say(_done, text, stop=stop):
            if text.startswith(stop):
                raise StoppedError("somebody opened the door")

        given = {} if folder else SETTINGS
        with pytest.raises(StoppedError):
            run_procedure(load_procedure("endurance"), file, given, out, say, resume=folder)
        folder = out
    found = run_procedure(load_procedure("endurance"), file, {}, tmp_path / "resumed", resume=folder)

    expected = {one.name: one for one in whole.findings.measured}
    assert {one.name for one in found.findings.measured} == set(expected)
    for one in found.findings.measured:
        other = expected[one.name]
        assert one.value == pytest.approx(other.value, abs=4.0 * math.hypot(one.repeatability, other.repeatability))
    assert expected["cycles"].value == 60
    kept = [part for part in read(tmp_path / "resumed").meta["parts"] if part["kind"] == "cycle"]
    assert [part["after"] for part in kept] == list(range(0, 60, 5))
    assert len({part["mean"]["gain"] for part in kept}) == 12  # noise of before does not come again


def test_intervals_of_driven_runs_hold_what_a_run_without_noise_finds(tmp_path):
    quiet = {"devices": {"daq": {"noise_v": 1e-6}}, "simulation": {"instruments": {"flow": {"noise": 0.002}}}}
    clean = driven(bench_of(tmp_path / "clean", **quiet), tmp_path / "clean" / "run")
    truth = {one.name: one.value for one in clean.findings.measured}
    held = dict.fromkeys(("gain", "phase", "offset", "gain_drift", "phase_drift", "offset_drift"), 0)
    for seed in range(20):
        file = bench_of(tmp_path / str(seed), simulation={"seed": 100 + seed})
        for one in driven(file, tmp_path / str(seed) / "run").findings.measured:
            if one.name in held:
                held[one.name] += abs(one.value - truth[one.name]) <= 2.2 * one.repeatability  # Student's t, 95 %
    assert 106 <= sum(held.values()) <= 120  # of 120; fewer at 95 % by chance in 1 of 500
    assert min(held.values()) >= 16


def test_of_each_block_the_first_cycle_stays_at_the_full_rate(tmp_path):
    driven(bench_of(tmp_path), tmp_path / "run")
    recording = read(tmp_path / "run")
    cycles = [part for part in recording.meta["parts"] if part["kind"] == "cycle"]
    assert [part["count"] for part in cycles] == [SAMPLES] * 12
    command, begins_s = recording.values("command"), []
    for part in cycles:
        rows = slice(part["first"], part["first"] + part["count"])
        assert command[rows][[0, 25, 50]] == pytest.approx([-80.0, 0.0, 80.0], abs=0.01)
        begins_s.append(recording.time_s[part["first"]])
    assert np.diff(begins_s) == pytest.approx(np.full(11, 5.0))  # the four between were driven
    assert len(recording) < 12 * SAMPLES + 1200


def test_an_instrument_that_creeps_stops_the_run_where_it_has_crept_too_far(tmp_path):
    creep = {"name": "sensor_drift", "parameters": {"rate": CREEP_L_MIN_S, "settling": 0.0}}
    no_witness = {"command": {"witness": None}}  # it would say, rightly, that flow is not back at rest
    file = bench_of(tmp_path, simulation={"effects": [creep]}, channels=no_witness)
    found = driven(file, tmp_path / "run", stop_at="10", cycles="2000")
    measured = {one.name: one for one in found.findings.measured}
    amplitude = 2.0 * 0.1 * 80.0 * measured["gain"].value / 0.2  # of the response: gain times that of the command
    crept = 100.0 * CREEP_L_MIN_S * measured["cycles"].value / amplitude
    drift = measured["offset_drift"]
    assert abs(drift.value - crept) < 3.0 * drift.std + 0.01 * crept
    assert 10.0 < drift.value < 20.0
    assert any("offset had moved by more than 10 %" in note for note in found.findings.notes)
    assert read(tmp_path / "run").values("command")[-1] == 0.0
    still = driven(file, tmp_path / "still", stop_at="", cycles="100")
    assert next(one for one in still.findings.measured if one.name == "cycles").value == 100


def test_a_sound_valve_is_driven_to_the_end_however_closely_it_is_watched(tmp_path):
    found = driven(bench_of(tmp_path), tmp_path / "run", stop_at="0")
    assert found.findings.measured[0].value == 60
    assert not [note for note in found.findings.notes if "Stopped" in note]


@pytest.mark.parametrize(
    ("setting", "value"), [("cycles", "1"), ("keep_every", "1"), ("false_stop", "0"), ("frequency_hz", "0")]
)
def test_settings_out_of_range_are_refused_by_name(setting, value):
    with pytest.raises(SettingError, match=setting):
        parse_settings(load_procedure("endurance").settings, {setting: value})


@pytest.mark.parametrize(("setting", "value"), [("frequency_hz", "20"), ("amplitude", "120"), ("bias", "70")])
def test_what_this_bench_cannot_do_is_refused_before_anything_moves(tmp_path, setting, value):
    with pytest.raises(SettingError, match=r"frequency_hz|amplitude"):
        driven(bench_of(tmp_path), tmp_path / "run", **{setting: value})
    assert not (tmp_path / "run").exists()


def test_a_dead_valve_has_no_drift():
    blocks = [Block(10 * i, 10, dict.fromkeys((*FIGURES, "amplitude"), 0.0), {}) for i in range(4)]
    assert math.isnan(along(blocks, "offset").percent)
    assert not along(blocks, "gain").chance(1.0) < 1.0
