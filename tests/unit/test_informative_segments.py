"""Recordings too long to be fitted whole are fitted where their command tells most, and that is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation import informative_segments as module
from hil.identification.preparation.criteria import Effort
from hil.identification.preparation.experiment import Experiment, experiment
from hil.identification.preparation.informative_segments import experiments_of, informative_segments
from hil.physics.model import Model
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array, Recording, recording
from tests.answers import answer

INTERVAL_S = 0.01


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(module, "EFFORT", Effort(most_samples=6000, segment_samples=1000))


def long_command(count: int = 40_000) -> Array:
    """At rest but for two places: small steps at one, large ones at another."""
    rng = np.random.default_rng(1)
    command = np.zeros(count)
    command[8000:12_000] = np.repeat(rng.uniform(-5.0, 5.0, 80), 50)
    command[30_000:33_000] = np.repeat(rng.uniform(-60.0, 90.0, 30), 100)
    return command


def made(command: Array) -> Recording:
    plant = starting_model("brevini-hpv41").definition
    noise = 0.2 * np.random.default_rng(2).standard_normal(len(command))
    return answer(plant, command, INTERVAL_S, noise=noise, name="long", dead_band=12.0, full_flow=60.0)


def bound(start: Model, one: Recording) -> tuple[list[Experiment], tuple[str, ...]]:
    return experiments_of(start, [one], lambda _: "command", lambda part: experiment(part, start.definition))


def test_stretches_are_taken_where_the_command_tells():
    found = informative_segments(long_command(), 5000, 1000)
    taken = {first for s in found for first in range(*s, 1000)}
    assert len(taken) == 5 and {30_000, 31_000, 32_000} <= taken
    assert all(8000 <= first < 12_000 or 30_000 <= first < 33_000 for first in taken)


def test_a_command_that_is_short_enough_is_taken_whole():
    assert informative_segments(long_command()[8000:8900], 1000, 100) == [(0, 900)]


def test_a_long_recording_is_identified_from_a_part_of_it_and_that_is_said(few):
    start, whole = starting_model("brevini-hpv41"), made(long_command())
    experiments, said = bound(start, whole)
    assert "40000 samples are more than a fit needs; 6000 (60 s) in informative segments (2) are used" in said[0]
    assert sum(len(e.output) for e in experiments) <= 6000
    for e in experiments:
        assert e.invalid["output"][0] and not e.invalid["output"][-1]
    steps: list[float] = []
    found = fit_plant(start, experiments, progress=lambda done, _text: steps.append(done)).model.parameters
    assert steps == sorted(steps) and steps[-1] == 1.0
    for name, true in (("dead_band", 12.0), ("full_flow", 60.0)):
        std = found[name].std
        assert std is not None and abs(found[name].value - true) < 4.0 * std < 0.1 * true


def test_a_recording_that_is_no_longer_than_that_is_used_as_it_is(few):
    start, short = starting_model("brevini-hpv41"), made(long_command()[29_000:34_000])
    (e,), said = bound(start, short)
    assert (e.name, len(e.output), said) == ("long", 5000, ())


def test_a_stretch_says_nothing_of_a_warmth_that_came_before_it(monkeypatch):
    monkeypatch.setattr(module, "EFFORT", Effort(most_samples=900, segment_samples=300))
    start = starting_model("efc-drive")
    command = np.concatenate((np.full(1800, 1.9), np.tile(np.repeat([1.2, 1.7, 1.45], 40), 20)))
    true = start.definition.typical | {"warming_time": 60.0}
    rows = simulate(start.definition, true, Drive(command[None, :], 0.0, INTERVAL_S))
    rows += np.array([[0.5], [0.002], [0.02], [0.1], [0.5], [0.5]]) * np.random.default_rng(3).standard_normal(
        rows.shape
    )
    names = [f"{s.name} [{s.unit}]" for s in (start.definition.output, *start.definition.observed)]
    channels = {"current [A]": command} | dict(zip(names, rows, strict=True))
    warm = recording("warm", INTERVAL_S * np.arange(len(command)), channels)
    model = replace(start, parameters={n: replace(v, value=true[n]) for n, v in start.parameters.items()})
    found, _ = experiments_of(model, [warm], lambda _: "current", lambda part: experiment(part, model.definition))
    row = 1 + [signal.name for signal in model.definition.observed].index("coil temperature")
    for e in found:
        if "coil temperature" in e.observed:
            told = e.valid_in("coil temperature")
            off = (e.respond(model.definition, model.values)[row] - e.observed["coil temperature"])[told]
            assert told.any() and abs(float(off.mean())) < 0.05
    cold = [e for e in found if "coil temperature" not in e.observed or not e.valid_in("coil temperature").all()]
    assert cold and all({"coil current", "coil voltage"} & e.observed.keys() for e in found)
