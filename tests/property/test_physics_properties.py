"""What holds for any parameters within bounds, any command, any split into blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.catalog import entries
from hil.physics.compose import kernel, plant
from hil.physics.plant import Plant
from hil.physics.simulate import ActiveEffect, Drive, Twin, simulate
from hil.physics.transfer_function import from_parameters
from hil.record.recording import Array

INTERVAL_S = 2e-3
PLANTS = [plant(entry.name) for entry in entries("plants")]
for_every_plant = pytest.mark.parametrize("definition", PLANTS, ids=lambda definition: definition.name)


@st.composite
def drawn(draw: st.DrawFn, definition: Plant) -> tuple[dict[str, float], Array, tuple[ActiveEffect, ...]]:
    """Parameters within their bounds, inputs of steps within full scale, and up to two effects."""
    values = {
        p.name: draw(st.floats(max(p.low, -10.0 * p.scale), min(p.high, 10.0 * p.scale))) for p in definition.parameters
    }
    levels = draw(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=6))
    steps = np.repeat(levels, 60)
    inputs = np.array([signal.full_scale * np.roll(steps, 25 * k) for k, signal in enumerate(definition.inputs)])
    active = {}
    for site in draw(st.lists(st.sampled_from(kernel(definition.name).sites), max_size=2)):
        inside = {p.name: draw(st.floats(p.low, p.high)) for p in site.effect.parameters_at(site.hook)}
        active[site.key] = ActiveEffect(*site.key, inside)
    return values, inputs, tuple(active.values())


@for_every_plant
@settings(max_examples=25)
@given(data=st.data())
def test_finite_repeatable_and_the_same_in_blocks(definition, data):
    values, command, active = data.draw(drawn(definition))
    whole = simulate(definition, values, Drive(command, math.nan, INTERVAL_S), active)
    assert np.isfinite(whole).all()
    cut = data.draw(st.integers(1, command.shape[1] - 1))
    twin = Twin(definition, values, INTERVAL_S, active)
    parts = [twin.advance(command[:, :cut].copy()), twin.advance(command[:, cut:].copy())]
    assert np.array_equal(np.hstack(parts), whole)


seconds = st.floats(0.01, 1.0)
zeros = st.floats(0.02, 1.0) | st.floats(-1.0, -0.02)


@settings(max_examples=60)
@given(
    gain=st.floats(0.1, 5.0),
    lag=seconds,
    time1=seconds,
    time2=seconds,
    damping1=st.floats(0.1, 3.0),
    damping2=st.floats(0.1, 3.0),
    zero1=zeros,
    zero2=zeros,
    late=st.integers(0, 40),
)
def test_any_linear_plant_is_stepped_exactly(
    gain, lag, time1, time2, damping1, damping2, zero1, zero2,
    late,
):  # fmt: skip
    from scipy.signal import lsim

    definition = plant("transfer-function")
    shape = {"gain": gain, "lag_time": lag, "dead_time": late * 0.01, "pair1_time": time1, "pair1_damping": damping1,
             "pair1_zero": zero1, "pair2_time": time2, "pair2_damping": damping2, "pair2_zero": zero2}  # fmt: skip
    values = definition.typical | shape
    command = np.random.default_rng(5).normal(size=200)
    command[0] = 0.0
    found = simulate(definition, values, Drive(command[None, :].copy(), math.nan, 0.01))[0]
    model = from_parameters(values)
    held = np.concatenate((np.zeros(late), command))[:200]
    exact = lsim((model.numerator, model.denominator), held, np.arange(200) * 0.01, interp=False)[1]
    assert np.abs(found - exact).max() <= 1e-6 * max(np.abs(exact).max(), 1.0)


@settings(max_examples=60)
@given(
    coulomb=st.floats(0.5, 200.0),
    stiction=st.floats(1.0, 3.0),
    stribeck=st.floats(1e-4, 1.0),
    presliding=st.just(0.0) | st.floats(1e-9, 1e-4),
    push=st.floats(1.0, 500.0),
)
def test_friction_only_ever_takes_energy(coulomb, stiction, stribeck, presliding, push):
    axis = plant("linear-axis")
    given_values = {"coulomb": coulomb, "stiction": stiction, "stribeck": stribeck, "presliding": presliding}
    force = np.where(np.arange(1500) < 300, push, 0.0)[None, :]
    effect = ActiveEffect("friction", "force", given_values)
    place, speed = simulate(axis, axis.typical, Drive(force, 0.0, 1e-3), [effect])
    free_place, free_speed = simulate(axis, axis.typical, Drive(force, 0.0, 1e-3))
    assert np.all(speed <= free_speed + 1e-12)
    assert np.all(place <= free_place + 1e-12)
    coasting = np.abs(speed[302:])
    stored_m_s = math.sqrt(coulomb * stiction * presliding / axis.typical["mass"])  # what the bristles can give back
    assert np.all(np.diff(coasting) <= stored_m_s + 1e-12)
    if push < 0.4 * coulomb:  # a step swings to twice its force on the bristles
        assert np.abs(place).max() <= 3.0 * presliding * stiction + 1e-5
