"""Two recordings of one test whose outputs differ by more than noise are said to, and how they differ."""

from __future__ import annotations

import numpy as np
import pytest

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.disagreement import disagreement
from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import plant
from hil.record.recording import recording

INTERVAL_S, LAG_S = 0.01, 0.1


def step_test(name: str, seed: int, *, gain=0.7, late=0, offset=0.0, colour=0.0, levels=5) -> Experiment:
    from scipy.signal import lfilter

    command = np.repeat(np.random.default_rng(levels).uniform(-80.0, 80.0, 25), 60)
    given = gain * np.concatenate((np.full(late, command[0]), command))[: len(command)]
    decay = np.exp(-INTERVAL_S / LAG_S)
    flow = lfilter([1.0 - decay], [1.0, -decay], given, zi=[decay * given[0]])[0] + offset
    noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], np.random.default_rng(seed).normal(0, 0.3, len(flow)))
    columns = {"command [%]": command, "flow [l/min]": flow + noise}
    made = recording(name, INTERVAL_S * np.arange(len(flow)), columns)
    return experiment(made, plant("transfer-function"), "command", "flow")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gain": 0.75}, {"% of gain": -6.9}),
        ({"offset": 3.0}, {"l/min of offset": -3.0}),
        ({"late": 3}, {"s of delay": -0.03}),
        ({"gain": 0.75, "offset": 3.0}, {"l/min of offset": -3.0, "% of gain": -6.9}),
    ],
)
def test_what_differs_is_said_with_its_size(change, said):
    (note,) = disagreement([step_test("first", 1), step_test("second", 2, **change)])
    assert note.startswith("first: the same command as second") and "repeat the first test" in note
    found = {
        text.partition(" ")[2].partition(" ")[2].partition(" ")[2]: float(text.split(" ")[0])
        for text in note.partition("differs: ")[2].partition(". No one")[0].split(", ")
    }
    assert found == pytest.approx(said, rel=0.05, abs=0.1 if "of offset" in str(said) else 0.0)


def test_repeats_and_other_tests_are_not_said_to_disagree():
    for seed in range(10):
        assert not disagreement([step_test("a", seed), step_test("b", 100 + seed)])
        assert not disagreement([step_test("a", seed, colour=0.9), step_test("b", 100 + seed, colour=0.9)])
    assert not disagreement([step_test("a", 1), step_test("b", 2, gain=0.75, levels=6)])


def test_an_identification_says_that_its_recordings_disagree():
    model = starting_model("transfer-function")
    found = fit_plant(model, [step_test("first", 1), step_test("second", 2, gain=0.75)])
    assert any("the same command as second" in note for note in found.notes)
