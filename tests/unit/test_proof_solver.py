"""The truth's solver and nominal chains: converged, within physical limits, right where the answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from tests.studies.proof.truth.catalog import PLANTS
from tests.studies.proof.truth.excitation.shapes import steps
from tests.studies.proof.truth.simulate import SAMPLE_S, SUBSTEPS, Unit, respond, track

_RANGE = {
    "brevini-hpv41": (-100.0, 100.0),
    "cummins-efc": (0.95, 2.1),
    "hydraforce-sp08-47c": (65.0, 187.0),
    "linear-axis": (-100.0, 100.0),
}


def nominal(plant: str, **changed: float) -> Unit:
    return Unit(PLANTS[plant], {b.name: b.value for b in PLANTS[plant].base} | changed)


def random_steps(plant: str, duration_s: float = 10.0) -> np.ndarray:
    return steps(np.random.default_rng(7), *_RANGE[plant], (0.3, 1.5), duration_s)


@pytest.mark.parametrize("plant", PLANTS)
def test_halving_the_step_changes_nothing_that_a_sensor_could_see(plant):
    command, unit = random_steps(plant), nominal(plant)
    coarse, fine = respond(unit, command), respond(unit, command, substeps=2 * SUBSTEPS)
    assert np.abs(coarse - fine)[:, 0].max() < 1e-4 * PLANTS[plant].channels[0].noise
    assert np.ptp(coarse[:, 0]) > 100 * PLANTS[plant].channels[0].noise  # and there was something to see


@pytest.mark.parametrize("command", [-80.0, -10.0, 0.0, 35.0, 100.0])
def test_hpv41_at_rest_stands_on_its_flow_curve(command):
    flow = respond(nominal("brevini-hpv41"), np.full(50, command))
    opening = max(0.0, (abs(command) - 20.0) / 80.0)
    assert flow[-1, 0] == pytest.approx(np.sign(command) * 70.0 * opening**1.2, abs=1e-9)
    assert flow[-1, 1] == pytest.approx(command, abs=1e-9)  # the spool
    assert flow[-1, 2] == pytest.approx(100.0)  # the supply, in bar


def test_hpv41_dead_time_shifts_the_answer_and_nothing_else():
    command = random_steps("brevini-hpv41")
    early = respond(nominal("brevini-hpv41", dead_time=0.0213), command)[:, 0]
    late = respond(nominal("brevini-hpv41", dead_time=0.0213 + SAMPLE_S), command)[:, 0]
    assert np.abs(late[1:] - early[:-1]).max() < 1e-9


@pytest.mark.parametrize(("fraction", "worst"), [(0.5, 2e-5), (0.37, 2e-5)])
def test_a_dead_time_between_two_steps_of_the_solver_is_kept_on_average(fraction, worst):
    command = random_steps("brevini-hpv41")
    step_s = SAMPLE_S / SUBSTEPS
    between = respond(nominal("brevini-hpv41", dead_time=0.02 + fraction * step_s), command)[:, 0]
    ends = [respond(nominal("brevini-hpv41", dead_time=0.02 + k * step_s), command)[:, 0] for k in (0, 1)]
    assert np.abs(between - (1 - fraction) * ends[0] - fraction * ends[1]).max() < worst * 70.0


def test_efc_pressure_stays_between_closed_and_full():
    pressure = respond(nominal("cummins-efc"), random_steps("cummins-efc"))[:, 0]
    assert 3.0 <= pressure.min() < 20.0
    assert 190.0 < pressure.max() <= 210.0


def test_efc_at_its_centre_gives_half_the_span():
    assert respond(nominal("cummins-efc"), np.full(50, 1.58))[-1, 0] == pytest.approx(3.0 + 207.0 / 2)


def test_sp08_cylinder_is_no_faster_than_its_flow_allows():
    position = respond(nominal("hydraforce-sp08-47c"), np.repeat([65.0, 187.0, 65.0], 500))[:, 0]
    speed = np.diff(position) / SAMPLE_S
    assert 170.0 < speed.max() <= 180.0 * 1.05  # a spool of damping 0.7 overshoots by 5 %
    assert -264.0 * 1.05 <= speed.min() < -250.0


def test_sp08_arrives_at_what_is_requested():
    assert respond(nominal("hydraforce-sp08-47c"), np.repeat([65.0, 140.0], 1500))[-1, 0] == pytest.approx(
        140.0, abs=1e-4
    )


def test_axis_under_a_constant_force_follows_the_closed_solution():
    unit = nominal("linear-axis", dead_time=0.0)
    time_s = np.arange(500) * SAMPLE_S
    mass, damping = 95.0, 200.0
    expected = 20.0 / damping * (time_s - mass / damping * (1 - np.exp(-damping / mass * time_s)))
    assert respond(unit, np.full(500, 20.0))[:, 0] == pytest.approx(expected, abs=1e-12)


def test_axis_dissipates_what_it_was_given():
    unit = nominal("linear-axis", dead_time=0.0)
    force = np.concatenate([random_steps("linear-axis", 4.0), np.zeros(1)])
    position = respond(unit, force, substeps=400)[:, 0]
    given = float(np.sum(force[:-1] * np.diff(position)))
    speed = np.diff(position) / SAMPLE_S
    damped = 200.0 * float(np.sum(speed**2)) * SAMPLE_S
    kept = 0.5 * 95.0 * speed[-1] ** 2
    assert given == pytest.approx(damped + kept, rel=0.01)


def test_a_force_recorded_in_the_loop_gives_the_same_motion_without_it():
    unit = nominal("linear-axis")
    reference = 0.05 * np.sin(2 * np.pi * 0.5 * np.arange(1500) * SAMPLE_S)
    blur = 2e-5 * np.random.default_rng(3).standard_normal(1500)
    force, position = track(unit, reference, blur)
    assert np.abs(position[500:, 0] - reference[500:]).max() < 0.02
    assert respond(unit, force)[:, 0] == pytest.approx(position[:, 0], abs=1e-12)
