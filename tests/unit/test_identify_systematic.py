"""Intervals of identified parameters where a model lacks something, and where calibrations are stated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hil.identification.grey_box.identify import GreyBoxFit, fit_plant, starting_model
from hil.identification.preparation.experiment import Experiment
from hil.physics.model import typical_model
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Recording, recording
from hil.signals.recursion import filtered
from tests.answers import answer
from tests.concealed import bound

pytestmark = pytest.mark.xdist_group("fits with and without friction")  # on one worker: it is fitted once

TYPICAL = typical_model("brevini-hpv41")
FRICTION = ActiveEffect("friction", "force", {"coulomb": 1.5, "stiction": 1.2, "stribeck": 10.0, "presliding": 0.2})
LEVELS = (0.0, 80.0, -60.0, 40.0, -90.0, 55.0, 0.0)
COMMAND = np.concatenate((np.repeat(LEVELS, 1000), 70.0 * np.sin(1.3 * (0.001 * np.arange(9000)))))


def driven(*effects: ActiveEffect) -> Recording:
    """Steps and a slow wave, read with noise."""
    noise = 0.1 * np.random.default_rng(4).standard_normal(len(COMMAND))
    return answer(TYPICAL.definition, COMMAND, 0.001, *effects, noise=noise, name="driven")


def fitted(made: Recording) -> GreyBoxFit:
    (e,) = bound(TYPICAL, [made])
    assert isinstance(e, Experiment)
    return fit_plant(TYPICAL, [e])


@cache
def without_friction() -> GreyBoxFit:
    return fitted(driven())


def off(found: GreyBoxFit) -> dict[str, float]:
    """How many standard uncertainties each parameter lies from the truth."""
    told = {name: value for name, value in found.model.parameters.items() if value.std is not None}
    return {name: abs(value.value - TYPICAL.values[name]) / (value.std or np.inf) for name, value in told.items()}


def repeated_and_stated(found: GreyBoxFit) -> tuple[np.ndarray, np.ndarray]:
    """Standard uncertainties of the covariance, which is that of repeats, and of the parameters."""
    assert found.model.covariance is not None
    stds = [found.model.parameters[name].std for name in found.model.covariance.names]
    return np.sqrt(np.diag(np.array(found.model.covariance.matrix))), np.array(stds, dtype=np.float64)


def test_coloured_noise_is_no_lack_of_the_model():
    """It was told as missing physics where nothing tells which of the two it is."""
    made, noise = driven(), np.random.default_rng(5).standard_normal(16_000)
    flow = made.channels["flow"].values + 0.3 * filtered([0.6], [1.0, -0.8], noise)
    found = fitted(
        recording("coloured", made.time_s, {"command [%]": made.channels["command"].values, "flow [l/min]": flow})
    )
    assert not any("the residuals are no noise" in note for note in found.notes)
    assert max(off(found).values()) < 3.5


def test_intervals_hold_the_truth_where_the_model_lacks_friction_and_a_note_says_so():
    found = fitted(driven(FRICTION))
    assert max(off(found).values()) < 2.5
    assert any("the model lacks something, most likely at its" in note for note in found.notes)
    repeated, stated = repeated_and_stated(found)
    assert np.all(repeated <= stated)  # repeats lack the same


def test_what_is_only_noise_widens_nothing():
    found = without_friction()
    assert max(off(found).values()) < 3.0
    assert not any("lacks" in note for note in found.notes)
    repeated, stated = repeated_and_stated(found)
    assert np.all(stated < 1.2 * repeated)


def test_a_stated_calibration_is_kept_apart():
    made = driven()
    flow = replace(made.channels["flow"], calibration={"uncertainty": 1.4})
    found = fitted(replace(made, channels={**made.channels, "flow": flow}))
    full, plain = found.model.parameters["full_flow"], without_friction().model.parameters["full_flow"]
    assert full.std == pytest.approx(plain.std, rel=0.01)
    share = 0.7 / float(np.abs(flow.values).max())
    assert full.calibration_std == pytest.approx(share * full.value, rel=0.05)
    assert full.std_with_calibration == pytest.approx(np.hypot(full.std or 0.0, full.calibration_std or 0.0))
    assert found.model.parameters["dead_time"].calibration_std == pytest.approx(0.0, abs=1e-5)
    assert "with calibration ±" in found.summary()
    assert "with calibration" not in without_friction().summary()


def test_finer_steps_of_the_solver_move_an_effects_parameter_as_they_move_the_plants():
    start = starting_model("hpv41-identified", ("friction.coulomb",))
    noise = 0.003 * np.random.default_rng(4).standard_normal(len(COMMAND))
    made = answer(start.definition, COMMAND, 0.001, *start.active_effects, noise=noise, **start.values)

    found = fit_plant(start, bound(start, [made]), ("friction.coulomb",))

    (friction,) = found.model.effects
    covariance = found.model.covariance
    assert covariance is not None
    scatter = covariance.matrix[-1][-1] ** 0.5
    assert covariance.names[-1] == "friction.coulomb"
    assert (friction.parameters["coulomb"].std or np.inf) < 10.0 * scatter
