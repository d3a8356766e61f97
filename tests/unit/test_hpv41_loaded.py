"""The HPV41 under commanded pressures and load: the plain HPV41 where these are ample, and what is known at rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hil
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array
from tests.hpv41_lab_simulator import Valve

LOADED, PLAIN = plant("hpv41-loaded"), plant("brevini-hpv41")
AMPLE = {"supply": 200.0, "load": 100.0, "tank": 0.0, "oil_c": 40.0}
NAMES = ("flow", "spool", "load_pressure", "returned")


def responses(command: Array, conditions: dict[str, float], **changed: float) -> Array:
    rows = [command, *(np.full(len(command), value) for value in conditions.values())]
    return simulate(LOADED, LOADED.typical | changed, Drive(np.array(rows), math.nan, 1e-3))


def test_with_ample_pressure_it_is_the_plain_valve():
    command = np.repeat([0.0, 50.0, 90.0, -70.0, 30.0], 800)
    flow, spool, *_ = responses(command, AMPLE, compensator_lag=0.001)
    plain, plain_spool, _ = simulate(PLAIN, PLAIN.typical, Drive(command[None], math.nan, 1e-3))
    assert np.abs(spool - plain_spool).max() < 1e-6
    assert np.abs(flow - plain).max() < 0.01 * np.abs(plain).max()


@pytest.mark.parametrize("command", [-90.0, -30.0, 8.0, 55.0, 100.0])
@pytest.mark.parametrize(
    "conditions",
    [
        {"supply": 100.0, "load": 100.0, "tank": 2.0, "oil_c": 40.0},
        {"supply": 30.0, "load": 20.0, "tank": 8.0, "oil_c": 60.0},  # the load takes all: the compensator is open
        {"supply": 150.0, "load": 0.0, "tank": 2.0, "oil_c": 20.0},  # ports A and B blocked
    ],
)
def test_at_rest_it_shows_what_its_balances_have_as_roots(command, conditions):
    changed = {"give": 1.0, "null": 0.8, "null_supply": 0.45, "null_tank": -0.3, "null_temperature": 1.6}
    seen = dict(zip(NAMES, responses(np.full(3000, command), conditions, **changed)[:4, -1], strict=True))
    known = Valve(**changed).at_rest(command, **conditions)
    names = ("spool", "load_pressure", "returned") if conditions["load"] == 0.0 else ("spool", "flow", "load_pressure")
    for name in names:
        assert seen[name] == pytest.approx(known[name], abs=1e-3), name


def test_a_leakage_without_a_peak_is_its_level_and_has_no_place(tmp_path):
    """Within the overlap it is the same everywhere: the largest of noisy values is too large, and lies anywhere."""
    run = hil.run("internal_leakage", "hpv41-lab", tmp_path / "run", settings={"rate_hz": 200.0})
    found = {one.name: one for one in run.findings.measured}
    level, meter = 0.2 * (100.0 - 2.0) / 100.0, found["leakage_peak"].calibration_std
    beside_meter = math.sqrt(found["leakage_peak"].std ** 2 - meter**2)
    assert abs(found["leakage_peak"].value - level) < 3.0 * beside_meter
    assert found["leakage_peak_at"].value is None
