"""Tests under adjusted conditions over links: the figures are those of the same bench without one."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import hil
from tests.links import served

SETTINGS = {"commands": (100.0,), "supplies": (50.0, 100.0, 150.0), "hold_s": 2.0}


@pytest.mark.slow
@pytest.mark.parametrize(("link", "watchdog"), [("modbus", "watchdog_s = 1.0\n"), ("can", "watchdog_s = 0.5\n")])
def test_figures_over_a_link_are_those_without_it(link: str, watchdog: str, tmp_path: Path) -> None:
    direct = hil.run("flow_over_pressure_drop", "four-way-lab", settings=SETTINGS, out=tmp_path / "direct")
    with served(f"four-way-lab-{link}", tmp_path, (watchdog, "watchdog_s = 10.0\n")) as (file, _):
        linked = hil.run("flow_over_pressure_drop", file, settings=SETTINGS, out=tmp_path / "linked")
    assert len(direct.findings.measured) >= 4
    for here, there in zip(direct.findings.measured, linked.findings.measured, strict=True):
        assert here.name == there.name
        assert abs(here.value - there.value) < math.hypot(here.std, there.std), here.name
