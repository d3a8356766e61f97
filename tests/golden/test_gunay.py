"""Every number of the SP08-47C paper that can be recomputed, and where its equations contradict one another.

Numbers on the right are the paper's, or were recomputed independently of this code (in double precision, from
the printed coefficients).
"""

import math

import numpy as np
import pytest

from hil.identification.papers.closed_loop import closed, opened, opened_response
from hil.physics.published import gunay
from hil.physics.transfer_function import transfer_function

PER_RAD_S = 1.0 / (2.0 * math.pi)
AT_1_RAD_S = np.array([PER_RAD_S])


def test_equation_9_answers_a_5_v_sine_with_less_than_a_millivolt():
    model = gunay.CLOSED_LOOP_EQ_9
    assert np.allclose(model.poles.real, (-2.28e-4, -0.0740, -17.726), rtol=5e-3)
    assert model.poles.imag == pytest.approx([0, 0, 0])
    assert model.dc_gain == pytest.approx(8.917, abs=5e-4)
    (answer,) = model.at(AT_1_RAD_S)
    assert abs(answer) == pytest.approx(1.50e-4, abs=2e-6)
    assert 20 * math.log10(abs(answer)) == pytest.approx(-76.5, abs=0.05)
    assert math.degrees(np.angle(answer)) == pytest.approx(-179, abs=0.5)
    assert gunay.AMPLITUDE_V * abs(answer) == pytest.approx(7.5e-4, abs=5e-6)


def test_the_numerator_of_equation_9_as_printed_is_no_better():
    as_printed = transfer_function(
        (-2.842 * math.e - 0.14, -1.998 * math.e - 0.15, 0.002668), (1, 17.8, 1.316, 2.992e-4)
    )
    assert as_printed.zeros.real.max() > 0
    assert abs(as_printed.at(AT_1_RAD_S)[0]) == pytest.approx(0.5419, abs=5e-5)


def test_equation_11_is_an_integrator_with_a_lag():
    model = gunay.CLOSED_LOOP_EQ_11
    assert np.allclose(model.poles.real, (-2.6e-6, -3.853), rtol=1e-2)
    assert model.dc_gain == pytest.approx(77_517, abs=0.5)
    (answer,) = model.at(AT_1_RAD_S)
    assert abs(answer) == pytest.approx(0.1969, abs=5e-5)
    assert math.degrees(np.angle(answer)) == pytest.approx(-104.6, abs=0.06)
    (b0,), (_, a1, _) = model.numerator, model.denominator
    assert b0 / a1 == pytest.approx(0.2034, abs=5e-5)
    assert 1 / a1 == pytest.approx(0.26, abs=5e-4)
    # without the last coefficient nothing changes where it was measured
    integrator = transfer_function((b0,), (1.0, a1, 0.0))
    assert integrator.at(AT_1_RAD_S)[0] == pytest.approx(answer, rel=1e-5)


def test_equations_9_and_11_are_two_different_systems():
    nine, eleven = (m.at(AT_1_RAD_S)[0] for m in (gunay.CLOSED_LOOP_EQ_9, gunay.CLOSED_LOOP_EQ_11))
    assert len(gunay.CLOSED_LOOP_EQ_9.poles) != len(gunay.CLOSED_LOOP_EQ_11.poles)
    assert abs(eleven) / abs(nine) == pytest.approx(1314, abs=0.5)
    assert math.degrees(np.angle(eleven / nine)) == pytest.approx(74.4, abs=0.1)


def test_equation_12_to_the_digit_and_its_unstable_pole():
    found = opened(gunay.CLOSED_LOOP_EQ_11)
    assert np.array_equal(found.model.numerator, gunay.OPEN_LOOP_EQ_12.numerator)
    assert np.allclose(found.model.denominator, gunay.OPEN_LOOP_EQ_12.denominator, rtol=0, atol=1e-15)
    assert np.allclose(found.model.poles.real, (0.1937, -4.0467), atol=5e-5)
    assert found.unstable_poles.real == pytest.approx([0.1937], abs=5e-5)
    assert found.model.dc_gain == pytest.approx(-1.0000, abs=5e-5)
    assert not gunay.OPEN_LOOP_EQ_12.is_stable
    assert "+0.1937 rad/s" in found.notes[0]
    assert "T(0) is 77517" in found.notes[1]
    # left alone it doubles every 3.6 s
    assert math.log(2) / found.unstable_poles.real[0] == pytest.approx(3.58, abs=5e-3)


def test_the_same_from_equation_9_is_unstable_too():
    found = opened(gunay.CLOSED_LOOP_EQ_9)
    assert np.allclose(found.model.poles.real, (0.00176, -0.0760, -17.726), rtol=2e-3)
    assert found.unstable_poles.real == pytest.approx([0.00176], abs=5e-6)
    assert found.model.dc_gain == pytest.approx(-1.126, abs=5e-4)


def test_equation_10_holds_for_a_sensor_in_the_forward_path_only():
    plant = transfer_function((0.7837,), (1.0, 3.853, 0.0))
    lvdt = transfer_function((40.0,), (1.0, 100.0))
    for place, other in (("forward", "feedback"), ("feedback", "forward")):
        loop = closed(plant, lvdt, place)
        found = opened(loop, lvdt, place)
        at = np.array([0.01, 0.1, 1.0])
        assert found.model.at(at) == pytest.approx(plant.at(at), rel=1e-9)
        assert not np.allclose(opened(loop, lvdt, other).model.at(at), plant.at(at), rtol=0.1)
    # T(0) is 1 with C in the forward path, 1/C(0) in the feedback
    assert closed(plant, lvdt, "forward").dc_gain == pytest.approx(1.0)
    assert closed(plant, lvdt, "feedback").dc_gain == pytest.approx(2.5)


def test_equation_11_is_the_open_loop_already():
    loop = closed(gunay.CLOSED_LOOP_EQ_11)
    assert loop.is_stable
    assert np.allclose(loop.poles.real, (-0.2154, -3.6376), atol=5e-5)
    assert loop.dc_gain == pytest.approx(1.0, abs=2e-5)
    assert opened(loop).model.at(AT_1_RAD_S) == pytest.approx(gunay.CLOSED_LOOP_EQ_11.at(AT_1_RAD_S), rel=1e-9)


def test_opening_a_loop_magnifies_errors_where_the_loop_is_good():
    loop = closed(transfer_function((0.7837,), (1.0, 3.853, 0.0)))
    slow, fast = 1 / np.abs(1 - loop.at(np.array([0.001, 1.0])))
    assert slow == pytest.approx(0.2034 / (2 * math.pi * 0.001), rel=0.01)
    assert fast == pytest.approx(1.0, abs=0.03)
    # 1 % on T near rest makes a third of G; the formula follows the definition
    at = np.array([0.001])
    t = loop.at(at)
    off = abs(opened_response(1.01 * t)[0] / opened_response(t)[0] - 1.0)
    assert off == pytest.approx(0.01 * slow, rel=0.1)


def test_geometry_speeds_and_forces():
    cylinder = gunay.CYLINDER
    assert cylinder.head_area_mm2 == pytest.approx(1963.5, abs=0.05)
    assert cylinder.rod_area_mm2 == pytest.approx(1256.6, abs=0.05)
    assert cylinder.area_ratio == pytest.approx(1.5625)
    extending, retracting = cylinder.speeds_mm_per_s(gunay.FULL_FLOW_LPM)
    assert (extending, retracting) == pytest.approx((96.77, 151.20), abs=5e-3)
    assert cylinder.stroke_mm / extending == pytest.approx(2.58, abs=5e-3)
    assert cylinder.stroke_mm / retracting == pytest.approx(1.65, abs=5e-3)
    assert gunay.VALVE_PRESSURE_BAR * 0.1 * cylinder.head_area_mm2 == pytest.approx(47_100, abs=50)


def test_the_published_sine_needs_more_stroke_than_there_is():
    cylinder = gunay.CYLINDER
    extending, _ = cylinder.speeds_mm_per_s(gunay.FULL_FLOW_LPM)
    needed = extending / 2.0 * 2.0 * math.pi / gunay.FREQUENCY_RAD_S  # a sine between nothing and the full flow
    assert needed == pytest.approx(304.0, abs=0.05)
    assert cylinder.stroke_mm / (extending / 2) == pytest.approx(5.2, abs=0.05)
    assert cylinder.stroke_mm / (extending / 2) < 2 * math.pi / gunay.FREQUENCY_RAD_S
    assert needed > gunay.LVDT_RANGE_MM


def test_the_current_that_does_nothing_is_a_third_of_the_range():
    assert pytest.approx(0.36, abs=5e-3) == gunay.FIRST_FLOW_A / gunay.FULL_FLOW_A
