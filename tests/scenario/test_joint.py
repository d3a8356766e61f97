"""Two causes of which neither alone explains half are found at once."""

from __future__ import annotations

from hil.diagnosis.causes import Causes
from hil.diagnosis.measures import Measures
from hil.diagnosis.problem import pose
from hil.diagnosis.search.fitted import nothing
from hil.diagnosis.search.joint import joint
from hil.diagnosis.search.polish import roughly
from hil.diagnosis.search.terms import all_terms
from hil.physics.simulate import ActiveEffect
from tests.concealed import bound, nominal, records

NAMES = ("deadband", "supply_droop", "asymmetry", "load_force", "sensor_offset", "leakage", "saturation")


def test_two_causes_of_which_neither_explains_half_are_found_at_once() -> None:
    deadband = ActiveEffect("deadband", "opening", {"width": 3.0, "ratio": 1.17})
    droop = ActiveEffect(
        "supply_droop", "supply", {"droop": 0.19, "recovery": 1.0, "power": 2.4, "line": 0.0, "lean": 0.05}
    )
    problem = pose(nominal(), bound(nominal(), records((deadband, droop), seed=21)))
    baseline = roughly(problem, nothing(problem))
    m = Measures(problem, baseline)
    causes = Causes(m, tuple(t for t in all_terms(problem, baseline.residuals) if t.name in NAMES))
    alone = causes.alone()
    assert m.left(alone.fitted[0]) > 0.5

    proposed = joint(alone.place, alone.screened, alone.fitted, most=5)
    assert set(proposed[0].names) == {"deadband", "supply_droop"}
    assert [f.chi2 for f in proposed] == sorted(f.chi2 for f in proposed)

    (both,) = causes.couples(alone, causes.polished(alone.fitted)[0])
    assert set(both.names) == {"deadband", "supply_droop"}
    assert m.left(both) < 0.03
