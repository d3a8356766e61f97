"""What is kept back, what is not excluded, and where a false-alarm rate holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hil.diagnosis.evidence import cross_validation as rooms
from hil.diagnosis.evidence.coverage import limits
from hil.diagnosis.evidence.cross_validation import folds_of, predicted
from hil.diagnosis.false_alarms import false_alarms
from hil.diagnosis.intake.problem import Problem, pose
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import Fitted, evaluated, nothing
from hil.diagnosis.search.linearization import linearized
from hil.diagnosis.search.terms import all_terms
from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import plant
from hil.physics.model import typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import recording
from tests.answers import answer


def problem(
    name: str, seconds: Sequence[float], *concealed: ActiveEffect, interval_s: float = 0.02, hz: float = 0.3
) -> Problem:
    definition = plant(name)
    made = []
    for k, duration_s in enumerate(seconds):
        time_s = np.arange(0.0, duration_s, interval_s)
        command = 0.4 * definition.inputs[0].full_scale * np.sin(2.0 * np.pi * hz * (1.0 + 0.3 * k) * time_s)
        noise = 1e-3 * definition.output.full_scale * np.random.default_rng(k).standard_normal(len(command))
        read = answer(definition, command, interval_s, *concealed, noise=noise, start=math.nan, name=f"r{k}")
        made.append(experiment(read, definition))
    return pose(typical_model(name), made)


def test_recordings_are_short_by_what_they_hold_and_not_by_the_clock(monkeypatch):
    """The answer would depend on what else the machine is at: a fleet on a cluster was told otherwise than here."""
    short, long = problem("brevini-hpv41", (30.0,)), problem("brevini-hpv41", (20.0, 25.0))
    monkeypatch.setattr(Experiment, "respond", lambda *_, **__: pytest.fail("a simulation was timed"))
    assert short.is_short and not long.is_short


@pytest.mark.parametrize(
    ("name", "seconds", "interval_s", "said"),
    [
        ("throttle-flap", (8.0, 9.0), 0.02, rooms.OTHER_RECORDINGS),
        ("throttle-flap", (8.0,), 0.02, rooms.OTHER_HALVES),
        ("linear-axis", (8.0,), 0.02, rooms.SECOND_HALF),
        ("flow-loop", (50.0,), 1.0, rooms.NOTHING),
    ],
)
def test_what_is_kept_back(name, seconds, interval_s, said):
    asked = problem(name, seconds, interval_s=interval_s)
    kept = folds_of(asked, nothing(asked))
    assert kept.basis == said
    assert len(kept.fold) == len(kept.scored) == len(asked.nominal_residuals)


def test_what_the_plant_remembers_of_the_other_half_is_not_judged():
    asked = problem("throttle-flap", (8.0,))
    kept = folds_of(asked, nothing(asked))
    unjudged = np.flatnonzero(~kept.scored)
    middle = np.searchsorted(asked.experiments[0].time_s, 4.0)
    assert middle <= unjudged[0] <= middle + 1
    assert 3 <= len(unjudged) < 100


def test_a_prediction_is_of_a_fit_without_what_it_predicts():
    """A constant that the second recording alone has is not foretold."""
    asked = problem("throttle-flap", (8.0, 8.0))
    shifted = asked.experiments[1].output + 0.5
    object.__setattr__(asked.experiments[1], "output", shifted)
    term = next(t for t in all_terms(asked, nothing(asked).residuals) if t.name == "sensor_offset")
    start = Fitted((term,), (term.starts[0],), asked.model.values, 0.0, asked.nominal_residuals)
    fitted = fit(asked, start)
    told = predicted(asked, fitted, folds_of(asked, fitted))
    assert told @ told > 1.5 * fitted.residuals @ fitted.residuals


@pytest.mark.parametrize(
    ("changed", "said"),
    [((1,), rooms.OTHER_HALVES), ((0, 1), rooms.OTHER_RECORDINGS), ((), rooms.OTHER_RECORDINGS)],
)
def test_what_shows_in_one_recording_alone_is_judged_within_it(changed, said):
    """A limit of rate that only the steps reach was refused: a fit of the slow recordings cannot foretell it."""
    asked = problem("throttle-flap", (8.0, 9.0))
    term = next(t for t in all_terms(asked, asked.nominal_residuals) if t.name == "rate_limit")
    without = asked.nominal_residuals.copy()
    for k in changed:
        without[asked.output_slices()[k]] += 3.0
    f = Fitted((term,) if changed else (), (term.starts[0],) if changed else (), asked.model.values, 0.0, without)
    kept = folds_of(asked, f)
    assert kept.basis == said
    by_recording = [np.unique(kept.fold[part]).tolist() for part in asked.output_slices()]
    assert by_recording == ([[0, 1], [0, 1]] if said == rooms.OTHER_HALVES else [[0], [1]])
    assert len(kept.fold) == len(kept.scored) == len(without)


@pytest.mark.parametrize(
    ("pressures", "said"), [((3.0, 7.0), rooms.OTHER_HALVES), ((3.0, 3.5, 7.0, 6.5), rooms.OTHER_RECORDINGS)]
)
def test_values_that_only_both_recordings_tell_are_judged_within_each(pressures, said):
    """Friction with and without pressure: at one pressure nothing tells them apart, so that it foretells no other."""
    cylinder = plant("pneumatic-cylinder")
    friction = ActiveEffect("seal_friction", "seal", {"share": 0.05, "constant": 5.0, "presliding": 0.5})
    time_s = np.arange(0.0, 20.0, 0.02)
    made = []
    for k, bar in enumerate(pressures):
        moved, pressure = 15.0 * np.sin(2.0 * np.pi * 0.2 * time_s), np.full(len(time_s), bar)
        drive = Drive(np.vstack([moved, pressure]), math.nan, 0.02)
        force = simulate(cylinder, cylinder.typical, drive, [friction])[0]
        force = force + np.random.default_rng(k).standard_normal(len(force))
        channels = {"displacement [mm]": moved, "pressure [bar]": pressure, "force [N]": force}
        made.append(experiment(recording(f"{bar:g} bar", time_s, channels), cylinder))
    asked = pose(typical_model(cylinder.name), made)
    term = next(t for t in all_terms(asked, asked.nominal_residuals) if t.name == "seal_friction")
    found = fit(asked, replace(nothing(asked), terms=(term,), values=(term.starts[0],)))
    assert folds_of(asked, found).basis == said


def test_no_cause_is_excluded_that_would_do_as_well():
    friction = ActiveEffect("friction", "force", {"coulomb": 3.0, "stiction": 1.2, "stribeck": 5.0, "presliding": 0.05})
    asked = problem("throttle-flap", (10.0,), friction)
    terms = all_terms(asked, asked.nominal_residuals)
    term = next(t for t in terms if t.name == "friction")
    twin = evaluated(asked, Fitted((term,), ((7.0, 1.2, 5.0, 0.05),), asked.model.values, 0.0, asked.nominal_residuals))
    place = linearized(asked, nothing(asked))
    alone = {limit.effect: limit for limit in limits(place, [term])}
    beside = {limit.effect: limit for limit in limits(place, [term], [twin])}
    assert alone["friction"].upper < 7.0
    assert beside["friction"].upper == 7.0
    told = SimpleNamespace(std=np.array([0.5, 0.0, 0.0, 0.0]), unknowns=range(4))
    fitted = {limit.effect: limit for limit in limits(place, [term], [replace(twin, estimate=told)])}
    assert fitted["friction"].upper == pytest.approx(7.0 + 1.645 * 0.5)  # it may be larger than it was fitted


def test_beside_what_nobody_explains_an_effect_may_be_all_that_is_left():
    """Of a unit called unexplained a heating coil was excluded at a hundred thousandth of what it had."""
    offset = ActiveEffect("sensor_offset", "sensor", {"offset": 0.5})
    upper = {}
    for concealed in ((), (offset,)):
        asked = problem("throttle-flap", (10.0,), *concealed)
        term = next(t for t in all_terms(asked, asked.nominal_residuals) if t.name == "sensor_offset")
        (limit,) = limits(linearized(asked, nothing(asked)), [term])
        upper[len(concealed)] = limit.upper
    assert upper[0] < 0.05
    assert upper[1] == pytest.approx(0.5, rel=0.2)


def test_a_rate_of_false_alarms_is_that_of_a_plant_that_was_counted():
    known, unknown = false_alarms("cummins-efc", "changed"), false_alarms("throttle-flap", "changed")
    assert known.rate is not None and 0.05 < known.rate < 0.15  # 0 of 30
    assert "cummins-efc" in known.scope
    assert unknown.rate is None and "not counted" in unknown.scope


def test_what_a_model_leaves_out_has_no_rate_of_false_alarms():
    assert false_alarms("cummins-efc", "left_out").rate is None
