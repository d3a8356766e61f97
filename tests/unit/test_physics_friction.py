"""Friction sticks, slides and breaks away as it should, however stiff it is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.physics.compose import plant
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Array

AXIS, VALVE = plant("linear-axis"), plant("brevini-hpv41")
COULOMB_N = 30.0


def friction(**given: float) -> ActiveEffect:
    rest = {"coulomb": COULOMB_N, "stiction": 1.0, "stribeck": 0.02, "presliding": 0.0}
    return ActiveEffect("friction", "force", rest | given)


def axis(force_n: Array, effect: ActiveEffect, factor: float = 1.0) -> tuple[Array, Array]:
    """Position and velocity of the carriage for a force, at 1 kHz."""
    drive = Drive(np.asarray(force_n, dtype=float)[None, :], 0.0, 1e-3)
    place, speed = simulate(AXIS, AXIS.typical, drive, [effect], factor=factor)
    return place, speed


def test_below_breakaway_it_truly_sticks():
    force = 0.99 * COULOMB_N * np.sin(2 * np.pi * np.arange(4000) * 1e-3)
    place, speed = axis(force, friction())
    assert np.abs(place).max() < 1e-18
    assert np.abs(speed).max() < 1e-15


@pytest.mark.parametrize("presliding_m", [1e-9, 1e-6, 1e-4])
def test_bristles_hold_within_their_give_and_without_creep(presliding_m):
    force = 0.5 * COULOMB_N * np.sin(2 * np.pi * np.arange(8000) * 1e-3)
    place, _ = axis(force, friction(presliding=presliding_m))
    assert 0.0 < np.abs(place).max() < 3.0 * presliding_m + 0.5e-6  # the rest is one step of 1 ms
    last, one_before = place[-1000:], place[-2000:-1000]
    assert np.abs(last - one_before).max() < 0.2 * presliding_m  # no walking away from period to period


@pytest.mark.parametrize("factor", [1.0, 4.0])
@pytest.mark.parametrize("presliding_m", [0.0, 1e-9, 1e-6, 1e-4])
def test_when_it_slides_it_takes_the_coulomb_force(presliding_m, factor):
    force_n = 80.0
    _, speed = axis(np.full(6000, force_n), friction(presliding=presliding_m), factor)
    assert speed[-1] == pytest.approx((force_n - COULOMB_N) / AXIS.typical["viscous"], rel=1e-3)


@pytest.mark.parametrize("presliding_m", [0.0, 1e-9, 1e-6])
def test_at_standstill_it_does_not_chatter(presliding_m):
    force = np.where(np.arange(6000) < 1000, 80.0, 0.0)
    place, speed = axis(force, friction(presliding=presliding_m))
    assert place[-1] > 0.05
    assert np.ptp(place[-1000:]) == 0.0
    assert np.abs(speed[-1000:]).max() < 1e-20


def test_breaking_away_takes_the_static_force():
    force = np.linspace(0.0, 60.0, 12000)
    _, speed = axis(force, friction(stiction=1.5, stribeck=0.005))
    started = force[np.flatnonzero(speed > 1e-9)[0]]
    assert started == pytest.approx(1.5 * COULOMB_N, rel=2e-3)


@pytest.mark.parametrize("coulomb", [0.5, 5.0, 20.0])
@pytest.mark.parametrize("presliding", [1e-3, 0.2, 5.0])
def test_the_valve_stays_stable_at_every_stiffness(coulomb, presliding):
    time_s = np.arange(6000) * 1e-3
    command = 50.0 + 12.0 * np.sin(2 * np.pi * 0.5 * time_s)
    effect = friction(coulomb=coulomb, stiction=1.3, stribeck=10.0, presliding=presliding)
    drive = Drive(command[None, :], math.nan, 1e-3)
    spool = simulate(VALVE, VALVE.typical, drive, [effect])[1]
    fine = simulate(VALVE, VALVE.typical, drive, [effect], factor=8.0)[1]
    assert np.ptp(spool) < 2.0 * 12.0 * 1.05
    assert np.sqrt(np.mean((spool - fine) ** 2)) < 0.02 * 12.0


def test_small_commands_look_slower_and_the_spool_sticks_at_reversals():
    time_s = np.arange(8000) * 1e-3
    effect = friction(coulomb=2.0, stiction=1.2, stribeck=10.0, presliding=0.05)
    ratios = []
    for amplitude in (2.5, 20.0):
        command = 50.0 + amplitude * np.sin(2 * np.pi * 0.5 * time_s)
        spool = simulate(VALVE, VALVE.typical, Drive(command[None, :], math.nan, 1e-3), [effect])[1]
        ratios.append(np.ptp(spool[4000:]) / (2.0 * amplitude))
    assert ratios[0] < 0.6 < 0.75 < ratios[1]


@pytest.mark.parametrize("factor", [0.5, 1.0])
def test_a_part_that_slips_as_soon_as_it_moves_is_simulated_as_with_fine_steps(factor):
    """Stiction is gone at 1 %/s: the force falls to a half within a step."""
    time_s = np.arange(0.0, 8.0, 0.004)
    command = 45.0 + 12.0 * np.sin(2.0 * np.pi * 0.8 * time_s)
    slippery = ActiveEffect("friction", "force", {"coulomb": 6.0, "stiction": 2.0, "stribeck": 1.0, "presliding": 0.01})
    drive = Drive(command[None, :], 0.0, 0.004)
    found, truth = (simulate(VALVE, VALVE.typical, drive, [slippery], factor=f)[0] for f in (factor, 64.0))
    assert np.sqrt(np.mean((found - truth) ** 2)) < 0.05  # l/min; noise is 0.3
