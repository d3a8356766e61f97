"""Readings that stand on one code of a converter: a mean of them is known to what rounding hides, step/√12."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers import modbus
from drivers.modbus import Model, Register
from hil.record.recording import Recording, recording
from procedures import cylinder_drift
from procedures._recorded import reading_step
from procedures.electrical_check import judged


def read(columns: dict[str, Any], **meta: Any) -> Recording:
    count = len(next(iter(columns.values())))
    return replace(recording("run", np.arange(count) / 1000.0, columns), meta=meta)


def coil(temperature: str, at: float, step: float) -> Recording:
    demand = np.tile(np.repeat([0.0, 0.5], 600), 5)
    return read(
        {
            "current [A]": demand, "coil current [A]": demand, "coil voltage [V]": 2.1 * demand,
            f"coil temperature [{temperature}]": np.full(len(demand), at),
        },
        roles={"command": "current", "response": "coil current"}, read={"coil temperature": {"step": step}},
    )  # fmt: skip


@pytest.mark.parametrize(("unit", "at", "step"), [("degC", 40.0, 0.39), ("degF", 104.0, 1.8 * 0.39)])
def test_a_temperature_on_one_code_repeats_to_the_step_over_the_root_of_twelve(unit, at, step):
    (found,) = (m for m in judged(coil(unit, at, step), {"voltage": "12"}, {}).measured if m.name == "coil_temperature")
    assert found.value == pytest.approx(40.0)
    assert found.repeatability == pytest.approx(0.39 / math.sqrt(12.0), rel=0.03)


def test_a_position_on_one_code_may_have_moved_within_it():
    made = read(
        {"command [mm]": np.zeros(20_000), "position [mm]": np.full(20_000, 0.1)},
        roles={"command": "command", "response": "position"}, read={"position": {"step": 0.25}},
        parts=[{"kind": "drift", "level": 0.0, "first": 0, "count": 20_000, "start_s": 0.0, "stop_s": 20.0}],
        settings={}, conditions={},
    )  # fmt: skip
    found = {m.name.partition(",")[0]: m for m in cylinder_drift.evaluate(made).measured}
    assert found["offset"].repeatability == pytest.approx(0.25 / math.sqrt(12.0), rel=0.03)
    assert found["drift_rate"].repeatability == pytest.approx(60.0 / 20.0 * 0.25 / math.sqrt(6.0), rel=0.03)
    assert found["drift"].relation == "<" and found["drift"].value >= 0.2


def test_codes_that_are_seen_count_more_than_what_is_said_and_nothing_is_made_up():
    values = np.array([0.0, 0.5, 0.0, 1.0])
    made = read({"flow [l/min]": values, "still [l/min]": np.ones(4)}, read={"flow": {"step": 0.1}})
    assert reading_step(made, made.channel("flow")) == 0.5
    assert reading_step(made, made.channel("still")) == 0.0


def test_a_register_says_what_one_count_more_means():
    def step(**more):
        model = Model({"x": Register("in", "value", "bar", 0.0, 400.0, more.pop("table", "input"), 0, **more)})
        return model.terminals["x"].step

    assert step(slope=-0.1) == pytest.approx(0.1)
    assert step(format="f32", slope=0.1) == 0.0
    assert step(table="discrete") == 0.0
    described = modbus.terminals(modbus.Settings(address="127.0.0.1:502", model="wago-750"))
    assert all(port.step == pytest.approx(20.0 / 65534.0) for port in described.values())
