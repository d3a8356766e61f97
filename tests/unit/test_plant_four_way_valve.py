"""The four-way valve against a simulator of another structure: SI, oil that is compressed, gaps solved by bisection."""

import math
import time

import numpy as np
import pytest
from four_way_simulator import Valve
from scipy.integrate import solve_ivp

from hil.physics.compose import plant
from hil.physics.simulate import Drive, Twin, simulate

VALVE = plant("four-way-valve")
OPEN = {"supply": 70.0, "load": 100.0, "tank": 2.0, "oil_c": 40.0}
SEEN = ("flow", "spool", "pressure_a", "pressure_b", "load_pressure", "returned", "supply", "tank")


def simulated(commands, supply=70.0, load=100.0, tank=2.0, oil_c=40.0, interval_s=1e-3, **changed):
    """Every output over the samples, by name."""
    held = [np.full(len(commands), one) for one in (supply, load, tank, oil_c)]
    inputs = np.vstack([commands, *held])
    found = simulate(VALVE, VALVE.typical | changed, Drive(inputs, math.nan, interval_s))
    return dict(zip(SEEN, found, strict=True))


def settled(command, **conditions):
    return {name: values[-1] for name, values in simulated(np.full(400, float(command)), **conditions).items()}


WORN = {"lap_pa": 12.0, "radius_pa": 40.0, "lap_bt": -8.0, "lap_pb": 30.0, "radius_at": 0.0, "clearance": 6.0}


@pytest.mark.parametrize("changed", [{}, WORN], ids=["new", "worn"])
@pytest.mark.parametrize(
    "conditions",
    [OPEN, {**OPEN, "load": 0.0}, {**OPEN, "load": 0.0, "oil_c": 70.0, "supply": 210.0}, {**OPEN, "load": 20.0}],
    ids=["open", "blocked", "hot", "throttled"],
)
@pytest.mark.parametrize("spool", [-60.0, -2.0, 0.0, 0.7, 5.0, 100.0])
def test_pressures_and_flows_are_those_of_compressed_oil_at_rest(spool, conditions, changed):
    found, expected = settled(spool, **conditions, **changed), Valve(**changed).come_to_rest(spool, **conditions)
    assert found["spool"] == pytest.approx(spool, abs=1e-9)
    for name, value in expected.items():
        full = 28.0 if name in ("flow", "returned") else conditions["supply"]
        assert found[name] == pytest.approx(value, abs=1e-5 * full), name


def test_rated_flow_is_that_of_half_the_valve_pressure_drop_at_each_edge():
    found = settled(100.0, supply=70.0, tank=0.0, load=100.0, load_flow=500.0)
    drop_bar = 70.0 - found["load_pressure"]
    assert found["flow"] == pytest.approx(28.0 * math.sqrt(drop_bar / 70.0), rel=2e-3)


def test_an_overlapped_land_leaks_as_the_oil_is_thin_and_an_open_edge_does_not_care():
    laps = {f"lap_{edge}": 150.0 for edge in ("pa", "at", "pb", "bt")}
    cold, warm = (settled(0.0, load=0.0, oil_c=oil_c, pilot_flow=0.0, **laps)["returned"] for oil_c in (20.0, 60.0))
    assert warm / cold == pytest.approx(math.exp(0.03 * 40.0), rel=0.02)
    open_cold, open_warm = (settled(100.0, oil_c=oil_c)["flow"] for oil_c in (20.0, 60.0))
    assert open_warm / open_cold == pytest.approx(1.0, abs=2e-3)


def test_null_moves_with_supply_tank_and_oil_as_stated():
    shifts = {"null": 1.0, "null_supply": 0.4, "null_tank": -0.3, "null_temperature": 2.0}
    for conditions, expected in (
        ({"supply": 210.0, "tank": 0.0}, 1.0), ({"supply": 189.0, "tank": 0.0}, 0.6),
        ({"supply": 210.0, "tank": 21.0}, 0.7), ({"supply": 210.0, "tank": 0.0, "oil_c": 80.0}, 3.0),
    ):  # fmt: skip
        assert settled(0.0, **conditions, **shifts)["spool"] == pytest.approx(-expected, abs=1e-6)


@pytest.mark.parametrize(("supply", "share"), [(210.0, 1.0), (52.5, 0.5)])
def test_the_spool_moves_as_the_supply_lets_its_pilot(supply, share):
    commands = np.where(np.arange(700) < 300, 0.0, 50.0)
    found = simulated(commands, supply=supply, tank=0.0, interval_s=2.5e-4)["spool"][300:]
    p = VALVE.typical
    rate = p["pilot_rate"] * share

    def motion(_time_s, state):
        flapper, speed, spool = state
        pull = p["motor_frequency"] ** 2 * (50.0 - flapper) - 2.0 * p["motor_damping"] * p["motor_frequency"] * speed
        return speed, pull, rate * (flapper - spool)

    time_s = 2.5e-4 * np.arange(400)
    expected = solve_ivp(motion, (0.0, 0.1), (0.0, 0.0, 0.0), t_eval=time_s, rtol=1e-9, atol=1e-9).y[2]
    assert np.abs(found - expected).max() < 0.01 * 50.0


def test_a_sample_costs_no_more_than_five_of_the_hpv41():
    count = 100_000
    commands = 80.0 * np.sin(2e-3 * math.pi * np.arange(count))

    def cost_s(name, *held):
        definition = plant(name)
        inputs = np.vstack([commands, *(np.full(count, one) for one in held)])
        twin = Twin(definition, definition.typical, 1e-3)
        twin.advance(inputs[:, :10])
        took_s = []
        for _ in range(7):
            began_s = time.process_time()
            twin.advance(inputs)
            took_s.append(time.process_time() - began_s)
        return min(took_s)

    assert cost_s("four-way-valve", 210.0, 50.0, 5.0, 40.0) < 5.0 * cost_s("brevini-hpv41")
