"""Opening and closing a loop: there and back, what is refused, what is said."""

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.papers.closed_loop import closed, closed_with_gain, opened, opened_response
from hil.physics.transfer_function import transfer_function

AXIS = transfer_function((2.0,), (1.0, 5.0, 0.0))
LAG = transfer_function((1.0,), (0.01, 1.0))
HZ = np.geomspace(0.01, 10.0, 7)


@pytest.mark.parametrize("place", ["forward", "feedback"])
def test_there_and_back(place):
    loop = closed(AXIS, LAG, place)
    found = opened(loop, LAG, place)
    assert found.model.at(HZ) == pytest.approx(AXIS.at(HZ), rel=1e-9)
    assert opened_response(loop.at(HZ), LAG.at(HZ), place) == pytest.approx(AXIS.at(HZ), rel=1e-9)
    assert found.rest == pytest.approx(1.0)


def test_a_healthy_loop_is_not_complained_of():
    found = opened(closed(AXIS))
    assert found.unstable_poles.size == 0
    assert found.notes == ()


def test_a_gain_at_rest_below_one_is_told_without_an_unstable_pole():
    found = opened(transfer_function((0.9,), (0.5, 1.0)))
    assert found.unstable_poles.size == 0
    assert found.notes == ("T(0) is 0.9; a position loop without steady error has 1.",)
    assert found.model.dc_gain == pytest.approx(9.0)


def test_sensor_gain_decides_what_the_loop_must_have_at_rest():
    double = transfer_function((2.0,), (1.0,))
    assert opened(closed(AXIS, double, "feedback"), double, "feedback").notes == ()
    wrong = opened(closed(AXIS, double, "feedback"), double, "forward")
    assert wrong.rest == pytest.approx(0.5)
    assert "T(0) is 0.5" in wrong.notes[-1]


@pytest.mark.parametrize(
    ("loop", "sensor", "told"),
    [
        (transfer_function((1.0,), (1.0, 1.0), 0.1), LAG, "T has a dead time of 0.1 s"),
        (LAG, transfer_function((1.0,), (1.0, 1.0), 0.2), "C has a dead time of 0.2 s"),
        (transfer_function((1.0,), (1.0,)), LAG, "T is 1 at every frequency"),
        (LAG, transfer_function((1.0,), (1.0, 1.0, 1.0)), "zeros"),
    ],
)
def test_what_cannot_be_opened_is_refused(loop, sensor, told):
    with pytest.raises(InputError, match=told):
        opened(loop, sensor)


def test_a_loop_with_dead_time_is_not_closed():
    with pytest.raises(InputError, match="dead time"):
        closed(transfer_function((1.0,), (1.0, 1.0), 0.1))


def test_a_loop_over_a_transducer_gain_is_its_inverse_at_rest():
    gain, frequency, damping, transducer = 40.0, 75.0, 0.7, 0.1  # K_q/A, ω, ζ, K_tk of eq 8
    plant = transfer_function([gain * frequency**2], [1.0, 2.0 * damping * frequency, frequency**2, 0.0])
    loop, notes = closed_with_gain(plant, transducer)
    below = [1.0, 2.0 * damping * frequency, frequency**2, transducer * gain * frequency**2]
    np.testing.assert_allclose(loop.denominator / loop.denominator[0], below)
    assert loop.dc_gain == pytest.approx(1.0 / transducer) and not notes
    limit = 2.0 * damping * frequency / gain  # Hurwitz: K_tk·K_q/A < 2ζω
    assert not closed_with_gain(plant, 0.99 * limit)[1]
    assert "a smaller gain is needed" in closed_with_gain(plant, 1.01 * limit)[1][0]
    with pytest.raises(InputError, match="closes none"):
        closed_with_gain(plant, 0.0)
