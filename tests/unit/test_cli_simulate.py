"""`hil simulate`, `hil compare`, `hil identify`: files in, files and figures out."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hil.identification.uncertainty.fit import fit_percent
from hil.physics.model import Model, Value, load_model, save_model, typical_model
from hil.physics.simulate import Drive, simulate
from hil.record.read import read_recording, write_recording
from hil.record.recording import Array, recording
from tests.binary_sequence import binary_sequence

RATE_HZ = 100.0
Run = Callable[..., str]


@pytest.fixture
def hil(monkeypatch, tmp_path, command_line):
    """Runs `hil …` in a folder of its own; gives stdout."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        found = command_line(*arguments)
        assert found.status == 0, found.err
        return found.out

    return run


def unit() -> Model:
    """An HPV41 that is not quite the typical one."""
    typical = typical_model("brevini-hpv41")
    changed = {"pilot_rate": 9.0, "dead_band": 17.0, "full_flow": 64.0}
    values = {name: Value(changed.get(name, v.value), v.unit) for name, v in typical.parameters.items()}
    return Model(typical.plant, values, input=typical.input, output=typical.output)


def command(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    switching = binary_sequence(-1.0, 1.0, 0.35, RATE_HZ, bits=7)[:1500]
    found: Array = 55.0 + 20.0 * switching * np.repeat(rng.uniform(0.3, 1.0, size=15), 100)
    return found


def record(path: Path, seed: int, noise: float = 0.2) -> Path:
    made = command(seed)
    flow = simulate(unit().definition, unit().values, Drive(made[None, :], np.nan, 1.0 / RATE_HZ))[0]
    flow = flow + noise * np.random.default_rng(seed).normal(size=len(flow))
    time_s = np.arange(len(made)) / RATE_HZ
    write_recording(recording(str(path), time_s, {"command [%]": made, "flow [l/min]": flow}), path)
    return path


def test_simulate_writes_time_and_output_on_the_same_rows(hil, tmp_path):
    save_model(unit(), tmp_path / "model.json")
    record(tmp_path / "in.csv", 1, noise=0.0)
    hil("simulate", "--model", "model.json", "--input", "in.csv", "--out", "out.csv")
    given, found = read_recording(tmp_path / "in.csv"), read_recording(tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text(encoding="utf-8").startswith("time [s],flow [l/min]\n")
    assert np.array_equal(found.time_s, given.time_s)
    assert np.allclose(found.values("flow"), given.values("flow"), rtol=0.0, atol=1e-9)


def test_a_missing_input_is_named_beside_those_that_the_file_has(tmp_path, refused):
    save_model(unit(), tmp_path / "model.json")
    (tmp_path / "other.csv").write_text("time [s],current [A]\n0,1\n1,1\n", encoding="utf-8")
    found = refused(
        "simulate", "--model", tmp_path / "model.json", "--input", tmp_path / "other.csv", "--out", tmp_path / "x.csv"
    )
    assert "it has: current [A]; name its channel with --input" in found


@pytest.mark.parametrize("name", ["brevini-hpv41", "cummins-efc", "hydraforce-sp08-47c", "linear-axis"])
def test_simulate_uses_of_the_output_its_first_sample_at_most(hil, tmp_path, name):
    model = typical_model(name)
    save_model(model, tmp_path / "model.json")
    plant = model.definition
    scale = plant.output.full_scale
    time_s = np.arange(300) / RATE_HZ
    inputs = plant.inputs[0].full_scale * (0.5 + 0.3 * np.sin(3.0 * time_s))
    outputs = np.random.default_rng(3).uniform(0.0, scale, size=(2, 300))
    outputs[:, 0] = 0.5 * scale
    for k, output in enumerate(outputs):
        columns = {plant.inputs[0].heading: inputs, plant.output.heading: output}
        write_recording(recording("x", time_s, columns), tmp_path / f"in{k}.csv")
        hil("simulate", "--model", "model.json", "--input", f"in{k}.csv", "--out", f"out{k}.csv")
    assert (tmp_path / "out0.csv").read_bytes() == (tmp_path / "out1.csv").read_bytes()


def test_uneven_stamps_give_what_even_ones_do(hil, tmp_path):
    save_model(unit(), tmp_path / "model.json")
    made = np.repeat(command(2), 4)
    time_s = 0.137 + np.cumsum(np.full(len(made), 0.004))
    kept = np.flatnonzero((np.arange(len(made)) < 2000) | (np.arange(len(made)) % 4 == 0))  # the second part is coarser
    for name, rows in (("even", np.arange(len(made))), ("uneven", kept)):
        columns = {"command [%]": made[rows]}
        write_recording(recording("x", time_s[rows], columns), tmp_path / f"{name}.csv")
        hil("simulate", "--model", "model.json", "--input", f"{name}.csv", "--out", f"{name}-out.csv")
    even, uneven = (read_recording(tmp_path / f"{name}-out.csv").values("flow") for name in ("even", "uneven"))
    assert np.abs(uneven - even[kept]).max() < 1e-3 * np.ptp(even)


def test_simulate_takes_other_names_and_units(hil, tmp_path):
    save_model(unit(), tmp_path / "model.json")
    made = command(2)
    for name, heading, values in (("a", "command [%]", made), ("b", "setpoint [1]", made / 100.0)):
        write_recording(recording("x", np.arange(len(made)) / RATE_HZ, {heading: values}), tmp_path / f"{name}.csv")
    hil("simulate", "--model", "model.json", "--input", "a.csv", "--out", "a-out.csv")
    hil("simulate", "--model", "model.json", "--input", "b.csv", "--out", "b-out.csv", "--input-name", "setpoint")
    a, b = read_recording(tmp_path / "a-out.csv"), read_recording(tmp_path / "b-out.csv")
    assert np.allclose(a.values("flow"), b.values("flow"), atol=1e-9)


def test_identify_then_compare_on_another_recording(hil, tmp_path):
    for seed in (1, 2):
        record(tmp_path / f"run{seed}.csv", seed)
    told = hil("identify", "run1.csv", "--plant", "brevini-hpv41", "--out", "model.json")
    assert "pilot_rate" in told
    found = load_model(tmp_path / "model.json")
    for name in ("pilot_rate", "dead_band", "full_flow"):
        value, std = found.parameters[name].value, found.parameters[name].std
        assert std is not None
        assert abs(value - unit().values[name]) < 4.0 * std
    judged = json.loads(hil("compare", "--model", "model.json", "run2.csv", "--json"))["recordings"][0]
    assert judged["fit"] > judged["ceiling"] - 1.0
    assert "the noise allows" in hil("compare", "--model", "model.json", "run2.csv")
    hil("simulate", "--model", "model.json", "--input", "run2.csv", "--out", "out.csv")
    measured = read_recording(tmp_path / "run2.csv").values("flow")
    simulated = read_recording(tmp_path / "out.csv").values("flow")
    assert fit_percent(measured, simulated) == pytest.approx(judged["fit"], abs=1e-6)


def test_convert_states_a_unit_and_keeps_the_samples(hil, tmp_path):
    record(tmp_path / "run.csv", 1)
    assert "1500 samples" in hil("convert", "run.csv", "copy.csv.gz", "--unit", "flow=gpm")
    copy = read_recording(tmp_path / "copy.csv.gz")
    assert copy.channel("flow").unit == "gpm"
    assert np.array_equal(copy.values("flow"), read_recording(tmp_path / "run.csv").values("flow"))


def test_check_says_what_a_bench_is(hil):
    told = hil("check", "brevini-hpv41")
    assert "no faults" in told
    assert "limits -100 … 100, safe at 0" in told
