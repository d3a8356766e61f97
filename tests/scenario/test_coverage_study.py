"""What procedures print holds the truth: every declared figure has one, and a few seeds of each are held against it."""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.catalog import entries
from hil.record.measurement import Measured
from hil.session.procedure import load_procedure
from sim_devices._simulation import Simulation, model_of
from tests.bench_files import bench_file
from tests.studies.coverage.cases import BY_HAND, CASES, MADE_OF, SAME_AS, WITHOUT_TRUTH, Case
from tests.studies.coverage.recordings import driven, driven_on, noisy
from tests.studies.coverage.score import Tally
from tests.studies.coverage.situations import HPV41, SITUATIONS, without_noise
from tests.studies.coverage.study import Outcome, tried
from tests.studies.coverage.table import summary

AS_INSTALLED = SITUATIONS[0]
FIRST, SEEDS = 5000, 4
PROCEDURES = (
    "flow_curve", "step_response", "multisine_response", "large_sine", "velocity_steps", "cylinder_drift",
    "pressure_current", "leakage_check", "electrical_check", "threshold", "fail_safe",
    "pressure_gain", "internal_leakage", "flow_over_pressure_drop", "limiting_power", "null_shift", "load_step",
    "proof_pressure",
)  # fmt: skip
QUICK = [next(case for case in CASES if case.procedure == name) for name in PROCEDURES]


def name_of(case: Case) -> str:
    return f"{case.procedure}-{case.bench}"


def test_the_study_counts_what_holds_and_what_a_limit_at_the_truth_would_judge_wrongly():
    tally = Tally(10.0)
    for value in (9.0, 9.9, 10.1, 11.0, 12.0):
        tally.add(Measured("rise", value, "s", std=0.4))
    tally.add(Measured("rise", 9.5, "s", std=0.1, relation="<"))
    tally.add(Measured("rise", None, "s"))
    assert (tally.held, tally.stated, tally.bounds, tally.bounds_held, tally.untold) == (2, 5, 1, 0, 1)
    assert tally.beside == (1 / 7, 2 / 7)


def test_the_summary_counts_what_holds_too_seldom_and_what_is_stated_too_widely():
    narrow, right, wide = (Tally(0.0) for _ in range(3))
    for k in range(100):
        for tally, std in ((narrow, 0.2), (right, 0.5), (wide, 3.0)):
            tally.add(Measured("rise", 1.05 if k < 6 else (-1.0) ** k * 0.5, "s", std=std))
    made = summary([Outcome(CASES[0], AS_INSTALLED, 100, {"a": narrow, "b": right, "c": wide})])
    assert made.splitlines()[-1] == "| as installed | 3 | 1 | 1 | 1 | 1 |"


@pytest.mark.parametrize("case", QUICK, ids=name_of)
def test_a_few_seeds_of_the_bench_as_installed_hold_the_truth(case, tmp_path):
    outcome = tried(case, AS_INSTALLED, range(FIRST, FIRST + SEEDS), tmp_path)
    assert [name for name, tally in outcome.tallies.items() if 2 * tally.held < tally.stated] == []
    assert [name for name, tally in outcome.tallies.items() if 2 * tally.bounds_held < tally.bounds] == []
    assert {name.partition(", ")[0] for name in outcome.strange} <= WITHOUT_TRUTH.keys()


def test_every_declared_figure_has_a_truth(tmp_path):
    told: dict[str, set[str]] = {}
    for case in CASES:
        clean = driven(
            load_procedure(case.procedure), case.bench, case.settings, AS_INSTALLED, tmp_path / name_of(case)
        )
        found = {name.partition(", ")[0] for name in case.truths(clean, AS_INSTALLED)}
        told[case.procedure] = told.get(case.procedure, set()) | found
    for whole, parts in MADE_OF.items():
        told[whole] = set().union(*(told[part] for part in parts))
    declared = {
        entry.name: {m.name for m in load_procedure(entry.name).measurements}
        for entry in entries("procedures") if entry.name not in BY_HAND
    }  # fmt: skip
    missing = {name: figures - told.get(name, set()) - WITHOUT_TRUTH.keys() for name, figures in declared.items()}
    assert {name: figures for name, figures in missing.items() if figures} == {}


@pytest.mark.parametrize("situation", [one for one in SITUATIONS if one.effects], ids=lambda one: one.name)
def test_a_situation_has_the_effects_that_its_truths_believe(situation, tmp_path):
    for bench, effects in situation.effects.items():
        file = tmp_path / f"{bench}.toml"
        file.write_text(without_noise(bench, situation), encoding="utf-8")
        told = read_bench(file).bench
        asked = {
            "plant": told.valve.plant,
            **{k: told.simulation[k] for k in ("plant", "effects") if k in told.simulation},
        }
        model = model_of(Simulation.model_validate(asked))
        acting = {e.name: e.parameters for e in {e.key: e for e in model.active_effects}.values()}
        assert sorted(acting) == sorted(effect.name for effect in effects), bench
        for effect in effects:
            assert effect.parameters.items() <= acting[effect.name].items()


def test_every_shipped_bench_is_in_the_study_or_like_one_that_is():
    tried_on = {case.bench for case in CASES}
    assert set(benches()) - tried_on - SAME_AS.keys() == set()
    assert set(SAME_AS.values()) <= tried_on
    assert SAME_AS.keys() <= set(benches())


def test_a_recording_made_from_one_without_noise_is_that_of_the_bench(tmp_path):
    procedure = load_procedure("step_response")
    made = noisy(driven(procedure, HPV41, {}, AS_INSTALLED, tmp_path / "quiet"), HPV41, AS_INSTALLED, 17)
    text = bench_file(tmp_path / "bench.toml", HPV41, simulation={"seed": 17}).read_text(encoding="utf-8")
    real = driven_on(procedure, text, {}, tmp_path / "loud")
    apart = made.values("flow") - real.values("flow")
    assert np.abs(apart).max() <= 1.01 * 10.0 * 20.0 / 2**16  # a code of the converter
    assert np.mean(apart == 0.0) > 0.85  # the command's converter is a finer one there


def test_the_response_without_noise_is_that_of_the_published_equations(tmp_path):
    clean = driven(load_procedure("step_response"), HPV41, {}, AS_INSTALLED, tmp_path / "quiet")
    every, interval_s = 10, 1e-4
    command = np.repeat(clean.values("command"), every)
    late = np.concatenate((np.zeros(200), command[:-200]))
    pilot = filtered([7.0], [1.0, 7.0], late, interval_s)
    spool = filtered([33.0**2], [1.0, 33.0, 33.0**2], pilot, interval_s)
    flow = np.sign(spool) * 70.0 * (np.maximum(np.abs(spool) - 20.0, 0.0) / 80.0) ** 1.2
    read = filtered([1.0], [0.008, 1.0], flow, interval_s)[::every]
    assert np.abs(read - clean.values("flow")).max() < 0.1


def filtered(numerator: list[float], denominator: list[float], values: np.ndarray, interval_s: float) -> np.ndarray:
    from scipy.signal import cont2discrete, lfilter

    b, a, _ = cont2discrete((numerator, denominator), interval_s, method="zoh")
    return lfilter(np.ravel(b), a, values)
