"""Six faults of a four-way valve at two sizes each: which figures of the certificate leave their limits."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.record.measurement import Limit
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure

OWN = "parameters = { null = 0.8, "
TESTS = ("flow_curve", "step_response", "pressure_gain", "internal_leakage", "flow_over_pressure_drop")
SETTINGS = {"tests": TESTS, "steps": (25.0,), "cycle_s": 40.0}
LIMITS = {
    "rated_flow, +100 %": Limit(26.0, 30.0), "rated_flow, -100 %": Limit(-30.0, -26.0), "lap": Limit(-1.2, 0.0),
    "hysteresis": Limit(high=0.2), "rise, 0 → 25 %": Limit(high=25.0), "settling, 0 → 25 %": Limit(high=42.0),
    "pressure_gain": Limit(low=40.0), "pressure_null": Limit(-2.7, -1.7), "leakage_peak": Limit(high=0.8),
}  # fmt: skip
"""Such as a buyer writes for this unit; docs/explanation/standard.md has the table."""

PLAY = '{{ name = "backlash", hook = "opening", parameters = {{ half_width = {} }} }}'
FAULTS = [
    ("none", {}, "", set()),
    ("worn edge", {"radius_pa": 15.0}, "", {"lap", "pressure_null"}),
    ("worn edge", {"radius_pa": 40.0}, "", {"lap", "pressure_null", "pressure_gain", "leakage_peak"}),
    ("blocked orifice", {"rated_flow": 26.0}, "", {"rated_flow, -100 %"}),
    ("blocked orifice", {"rated_flow": 22.4}, "", {"rated_flow, +100 %", "rated_flow, -100 %"}),
    ("weak torque motor", {"motor_frequency": 350.0}, "", set()),
    ("weak torque motor", {"motor_frequency": 150.0}, "", {"settling, 0 → 25 %"}),
    ("stuck feedback", {}, PLAY.format(0.25), {"hysteresis"}),
    ("stuck feedback", {}, PLAY.format(1.0), {"hysteresis"}),
    ("contaminated pilot", {"pilot_rate": 120.0}, "", {"rise, 0 → 25 %", "settling, 0 → 25 %"}),
    ("contaminated pilot", {"pilot_rate": 50.0}, "", {"rise, 0 → 25 %", "settling, 0 → 25 %"}),
    ("wrong shim", {"null": 2.3}, "", {"pressure_null"}),
    ("wrong shim", {"null": 4.8}, "", {"pressure_null"}),
]


@pytest.mark.slow
@pytest.mark.usefixtures("unprinted")
@pytest.mark.parametrize(
    ("fault", "changed", "effect", "missed"), FAULTS, ids=[f"{name}-{k}" for k, (name, *_) in enumerate(FAULTS)]
)
def test_a_fault_leaves_the_limits_that_it_touches_and_a_healthy_unit_none(
    tmp_path: Path, fault: str, changed: dict[str, float], effect: str, missed: set[str]
) -> None:
    text = benches()["four-way-lab"].read_text(encoding="utf-8")
    assert OWN in text
    own = {"null": 0.8, **changed}
    text = text.replace(OWN, "parameters = { " + "".join(f"{key} = {value}, " for key, value in own.items()))
    path = tmp_path / "bench.toml"
    path.write_text(text.replace("seed = 1\n", f"seed = 1\neffects = [{effect}]\n"), encoding="utf-8")
    found = run_procedure(
        load_procedure("iso_10770_1"), read_bench(path), SETTINGS, tmp_path / "run", limits=LIMITS
    ).findings
    judged = {one.name: one for one in found.measured if one.verdict is not None}
    assert set(judged) == set(LIMITS)
    assert {name for name, one in judged.items() if one.verdict == "fail"} == missed
    if fault == "none":
        assert {one.verdict for one in judged.values()} == {"pass"}
