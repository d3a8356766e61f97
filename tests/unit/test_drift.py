"""Base parameters may drift a little: what is told of it, and from where on the unit has changed."""

import numpy as np
import pytest

from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.intake.problem import pose
from hil.physics.model import typical_model
from tests.answers import answer
from tests.concealed import bound, nominal, records


@pytest.mark.parametrize(("share", "verdict"), [(1.004, "consistent"), (1.025, "parameter_change")])
def test_the_corrected_model_has_what_drifted_and_far_is_a_change(share, verdict):
    """That all fits with one parameter moved is no reason to call the model consistent with it where it was."""
    model = nominal()
    flow = model.values["full_flow"]
    of = diagnose(model, bound(model, records(parameters={"full_flow": share * flow}, seed=5)))
    told = of.diagnosis
    assert told.verdict == verdict
    assert told.effects == ()
    assert of.corrected.values["full_flow"] == pytest.approx(share * flow, rel=1e-3)
    assert all(fit.corrected > fit.ceiling - 0.1 for fit in told.recordings.values())
    said = any("how units drift" in text and "full_flow is" in text for text in told.warnings)
    assert said is (verdict == "consistent")
    assert [c.name for c in told.changed_parameters] == ([] if said else ["full_flow"])


def test_a_place_on_a_steep_curve_may_drift_less_than_its_size_says():
    model = typical_model("cummins-efc")
    time_s = np.arange(0.0, 8.0, 0.004)
    current = 1.6 + 0.4 * np.sin(time_s)
    made = answer(model.definition, current, 0.004, noise=np.random.default_rng(1).normal(0.0, 0.5, 2000))
    problem = pose(model, bound(model, [made]))
    allowed = dict(zip([p.name for p in problem.base], problem.prior.std, strict=True))
    assert allowed["curve_centre"] == pytest.approx(0.002)
    assert allowed["curve_width"] == pytest.approx(0.005 * model.values["curve_width"])
    near = {**model.values, "curve_centre": model.values["curve_centre"] + allowed["curve_centre"]}
    assert 0.3 < np.sqrt(np.mean((problem.residuals(near, ()) - problem.nominal_residuals) ** 2)) < 3.0
