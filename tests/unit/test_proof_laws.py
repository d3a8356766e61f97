"""Every concealed law: nothing at null, a change at strength, found at the size that is asked for, converged."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.studies.proof.cases.severity import Stand, stand, strengthened
from tests.studies.proof.truth.catalog import PLANTS, all_laws, effects
from tests.studies.proof.truth.excitation.programme import programme
from tests.studies.proof.truth.law import Hidden
from tests.studies.proof.truth.simulate import SUBSTEPS, Unit, respond

pytestmark = pytest.mark.xdist_group("laws of the proof")  # on one worker: stands are settled once for each plant

CONTRACT = {
    "friction", "backlash", "hysteresis", "deadband", "saturation", "rate_limit", "dead_time", "sensor_lag",
    "supply_droop", "leakage", "resonance", "periodic_disturbance", "coil_heating", "coil_lag", "asymmetry",
    "load_force", "end_stop", "overflow", "sensor_offset", "sensor_drift", "quantisation", "dropout",
}  # fmt: skip
ONE_PLACE_EACH = [
    (law, sorted(all_laws()[law].largest)[i % len(all_laws()[law].largest)]) for i, law in enumerate(all_laws())
]
WANTED_SIGMA = {"linear-axis": 30.0}


@cache
def short_stand(plant: str, samples: int = 2000) -> Stand:
    """Eight seconds of the plant's own programme that move it over its range, after half a second at rest."""
    changed = programme(plant, np.random.default_rng(11)).changed
    command = changed["step-response" if plant == "cummins-efc" else "steps"]
    command = command[:samples] if PLANTS[plant].tracked else command[3000 : 3000 + samples]
    short = replace(PLANTS[plant], settle_s=min(PLANTS[plant].settle_s, 0.5))
    healthy = Unit(short, {b.name: b.value for b in short.base})
    return stand(healthy, {"short": command}, 1000, SUBSTEPS // 2)


def conceal(law: str, plant: str, strength: float) -> Unit:
    healthy = short_stand(plant).healthy
    parameters = all_laws()[law].draw(np.random.default_rng(5), plant)
    return Unit(healthy.plant, healthy.parameters, (Hidden(law, (strength, *parameters)),))


@pytest.mark.parametrize("law", all_laws())
def test_null_strength_changes_nothing(law):
    shown = {plant: short_stand(plant, 750).sigma(conceal(law, plant, 0.0)) for plant in all_laws()[law].largest}
    assert [plant for plant, sigma in shown.items() if not sigma < 0.01] == [], shown


@pytest.mark.parametrize(("law", "plant"), ONE_PLACE_EACH)
def test_a_law_can_be_made_to_show_as_large_as_asked(law, plant):
    on, wanted = short_stand(plant), WANTED_SIGMA.get(plant, 3.0)
    hidden = strengthened(conceal(law, plant, 0.0).hidden[0], on, wanted)
    found = on.sigma(Unit(on.healthy.plant, on.healthy.parameters, (hidden,)))
    greatest = all_laws()[law].largest[plant]
    rough = 0.5 if all_laws()[law].before else 0.15  # a held step is lost or not: there is no size between
    assert found == pytest.approx(wanted, rel=rough) or (hidden.parameters[0] == greatest and found > 0.3)


@pytest.mark.parametrize("law", [name for name, law in all_laws().items() if law.equation is not None])
def test_halving_the_step_changes_less_than_a_tenth_of_the_noise(law):
    changed = {plant: by_halving(law, plant) / PLANTS[plant].channels[0].noise for plant in all_laws()[law].largest}
    assert [plant for plant, sigma in changed.items() if not sigma < 0.1] == [], changed


def by_halving(law: str, plant: str) -> float:
    """How much half the step changes, rms, in units of the output."""
    unit = conceal(law, plant, 0.1 * all_laws()[law].largest[plant])
    command = short_stand(plant).commands["short"][:750] * (
        500.0 if PLANTS[plant].tracked else 1.0
    )  # newtons, not metres
    coarse, fine = (respond(unit, command, substeps=n)[:, 0] for n in (SUBSTEPS, 2 * SUBSTEPS))
    return float(np.sqrt(np.mean((coarse - fine) ** 2)))


def test_every_name_of_the_contract_is_concealed_but_overflow_which_needs_a_tank():
    assert set(effects(listed=True)) == CONTRACT - {"overflow"}


def test_at_least_ten_effects_are_on_no_list():
    assert len(effects(listed=False)) >= 10
    assert not set(effects(listed=False)) & CONTRACT


@pytest.mark.parametrize("law", all_laws())
def test_a_law_acts_in_exactly_one_way_and_names_its_parameters(law):
    found = all_laws()[law]
    assert sum(way is not None for way in (found.equation, found.before, found.after)) == 1
    for plant in found.largest:
        assert len(found.draw(np.random.default_rng(1), plant)) + 1 == len(found.meaning)
        assert (found.slot(plant) is None) is (found.equation is None)
