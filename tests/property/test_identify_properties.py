import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.identification.frequency.frequency_response import from_table
from hil.identification.frequency.measuring_chain import MeasuringChain, corrected
from hil.identification.frequency.rational import Form
from hil.identification.frequency.transfer_function import fit_form
from hil.physics.transfer_function import from_factors, from_parameters

FREQUENCIES = np.geomspace(0.05, 10.0, 30)

times = st.floats(0.02, 1.0)
dampings = st.floats(0.1, 1.5)
gains = st.floats(0.05, 500.0).flatmap(lambda g: st.sampled_from([g, -g]))


@st.composite
def models(draw):
    """Stable models of one to four poles with a real zero or none, and a dead time or none."""
    lags = [(draw(times),)] if draw(st.booleans()) else []
    for _ in range(draw(st.integers(1 - len(lags), 1))):
        time_s = draw(times)
        lags.append((2 * draw(dampings) * time_s, time_s**2))
    leads = (
        [(draw(st.floats(0.01, 0.3).flatmap(lambda z: st.sampled_from([z, -z]))),)]
        if len(lags[-1]) == 2 and draw(st.booleans())
        else []
    )
    return from_factors(draw(gains), lags, leads, draw(st.sampled_from([0.0, 0.03])))


@settings(max_examples=80, deadline=None)
@given(model=models())
def test_parameters_of_the_plant_hold_the_whole_response(model):
    back = from_parameters(model.to_parameters())
    assert np.allclose(back.at(FREQUENCIES), model.at(FREQUENCIES), rtol=1e-7, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(model=models())
def test_a_step_ends_at_the_gain_and_starts_at_nothing(model):
    horizon = model.dead_time_s + 60.0 / np.min(np.abs(model.poles.real))
    step = model.step(np.linspace(0.0, horizon, 500))
    assert math.isclose(step[-1], model.dc_gain, rel_tol=1e-6)
    assert abs(step[0]) <= 1e-9 * abs(model.dc_gain)


@settings(max_examples=25, deadline=None)
@given(gain=gains, fast=st.floats(0.02, 0.2), ratio=st.floats(3.0, 10.0), delay=st.sampled_from([False, True]))
def test_exact_responses_are_fitted_exactly(gain, fast, ratio, delay):
    model = from_factors(gain, [(2 * 0.4 * fast, fast**2), (fast * ratio,)], [], 0.04 if delay else 0.0)
    h = model.at(FREQUENCIES)
    lines = from_table("exact", FREQUENCIES, 20 * np.log10(np.abs(h)), np.degrees(np.angle(h)))
    found = fit_form(lines, Form(3, 0, dead_time=delay))
    assert np.allclose(found.model.at(FREQUENCIES), h, rtol=1e-5)


@settings(max_examples=40, deadline=None)
@given(lag=st.floats(0, 0.05), skew=st.floats(0, 1e-3), hold=st.floats(0, 0.01), read=st.floats(0, 0.01))
def test_a_measuring_chain_taken_out_leaves_what_was_there(lag, skew, hold, read):
    chain = MeasuringChain(lag, skew, hold, read)
    response = from_table("r", FREQUENCIES, np.zeros(30), np.zeros(30))
    spoiled = response.divided_by(1.0 / chain.at(FREQUENCIES), "spoiled")
    assert np.allclose(corrected(spoiled, chain).response, response.response)
