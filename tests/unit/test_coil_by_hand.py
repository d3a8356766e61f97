"""Readings typed in: judged with the uncertainty of their instrument, refused without one."""

from __future__ import annotations

from pathlib import Path

import pytest

import hil
from hil.errors import SettingError

pytestmark = pytest.mark.usefixtures("unprinted")

GIVEN = {"cold": 7.2, "hot": 9.1, "resistance_uncertainty": 0.5, "instrument": "meter 7"}


def by_name(tmp_path: Path, limits: list[str] | None = None, **settings: object):
    return hil.run(
        "coil_by_hand", "brevini-hpv41", tmp_path / "run", settings={**GIVEN, **settings}, limits=limits or []
    ).findings


def test_readings_are_judged_with_their_uncertainty(tmp_path):
    findings = by_name(tmp_path, ["coil_resistance_cold=7.1..7.6", "insulation_resistance=100.."], insulation=150)
    found = {m.name: m for m in findings.measured}
    cold, rise = found["coil_resistance_cold"], found["coil_temperature_rise"]
    assert (cold.value, cold.verdict) == (7.2, "pass")
    assert 2.0 * cold.std == pytest.approx(0.036)
    assert found["insulation_resistance"].verdict == "cannot tell"  # its uncertainty was not given
    # IEC 60034-1: Δθ = (R₂ − R₁) / R₁ · (235 + θ₁) for copper
    assert rise.value == pytest.approx((9.1 - 7.2) / 7.2 * (235.0 + 20.0), rel=0.005)
    assert 2.0 * rise.std == pytest.approx(2.0**0.5 * 0.005 * 9.1 / 7.2 * 255.0, rel=0.01)
    assert findings.notes == ("Read by hand from meter 7.",)
    assert not findings.deviations


def test_a_hot_reading_that_came_late_is_a_deviation(tmp_path):
    (text,) = by_name(tmp_path, switched_off_s=3).deviations
    assert text == "Hot resistance read 3 s after switching off; 1 s is allowed."


@pytest.mark.parametrize(
    ("settings", "named"), [({"cold": None, "hot": None}, "cold, hot"), ({"instrument": " "}, "instrument")]
)
def test_nothing_read_and_no_instrument_are_refused(tmp_path, settings, named):
    with pytest.raises(SettingError, match=named):
        by_name(tmp_path, **settings)
    assert not (tmp_path / "run").exists()
