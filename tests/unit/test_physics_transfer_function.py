import numpy as np
import pytest

from hil.errors import InputError
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import from_factors, transfer_function

SHAPES = [
    transfer_function([2.0], [0.5, 1.0]),
    transfer_function([3.0, -2.0, 50.0], [1.0, 4.0, 30.0, 40.0], 0.05),
    transfer_function([2.0, -3.0, 1.0], np.poly([-1, -2, -3, -4])),
    transfer_function([1.0, 2.0, 30.0, 4.0, 5.0], np.poly([-1 + 3j, -1 - 3j, -2 + 8j, -2 - 8j, -3])),
]


@pytest.mark.parametrize("model", SHAPES)
def test_the_plant_simulates_what_the_transfer_function_says(model):
    definition = plant("transfer-function")
    values = definition.typical | model.to_parameters() | {"offset": 7.0}
    command = np.ones((1, 1500))
    command[0, 0] = 0.0
    for read_at, shift in ((0.0, 1), (1.0, 0)):
        simulated = simulate(definition, values, Drive(command, np.nan, 2e-3, read_at))[0]
        exact = model.step(np.arange(1500) * 2e-3)
        late = simulated[1:] if shift else simulated[1:-1]
        assert np.allclose(late - 7.0, exact[:1499] if shift else exact[1:1499], atol=1e-9)


def test_a_system_may_start_where_the_first_output_says():
    definition = plant("transfer-function")
    values = definition.typical | {"gain": 2.0, "offset": 1.0, "lag_time": 0.5}
    command = np.full((1, 500), 3.0)
    time_s = np.arange(500) * 0.01
    for start, first in ((0.0, 7.0), (1.0, 4.0)):
        y = simulate(definition, values | {"start_at_output": start}, Drive(command, 4.0, 0.01))[0]
        assert np.allclose(y, 7.0 + (first - 7.0) * np.exp(-time_s / 0.5), atol=1e-9)


def test_units_follow_the_channels():
    model = SHAPES[0].to_model("pump voltage [V]", "level [mm]")
    assert model.parameters["gain"].unit == "[mm]/[V]"
    assert model.parameters["offset"].unit == "mm"
    assert model.parameters["lag_time"].unit == "s"


def test_to_control_gives_the_same_response():
    model = SHAPES[1]
    made = model.to_control(pade_order=8)
    s = 2j * np.pi * 0.5
    assert np.allclose(made(s), model.at(np.array([0.5]))[0], rtol=1e-6)
    assert np.allclose(SHAPES[0].to_control()(s), SHAPES[0].at(np.array([0.5]))[0])


def test_step_of_a_double_pole_and_of_a_lead():
    time_s = np.linspace(0, 3, 301)
    double = transfer_function([4.0], [1.0, 4.0, 4.0])
    assert np.allclose(double.step(time_s), 1 - np.exp(-2 * time_s) * (1 + 2 * time_s), atol=1e-12)
    lead = transfer_function([2.0, 3.0], [1.0, 3.0])
    assert np.allclose(lead.step(time_s), 1 + np.exp(-3 * time_s), atol=1e-12)
    assert np.all(transfer_function([1.0], [1.0, 1.0], 5.0).step(time_s) == 0.0)


def test_from_factors():
    made = from_factors(2.0, [(0.5,), (0.2, 0.04)], [(-0.1,)], 0.03)
    assert made.dc_gain == pytest.approx(2.0)
    assert made.zeros[0] == pytest.approx(10.0)
    assert made.dead_time_s == 0.03


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: transfer_function([1.0, 0.0, 1.0], [1.0, 1.0]), "zeros may not outnumber poles"),
        (lambda: transfer_function([1.0], [1.0, 1.0], -0.1), "dead time"),
        (lambda: transfer_function([1.0], []), "no|zeros|poles"),
        (lambda: transfer_function([1.0], [1.0, -1.0]).to_parameters(), "stable poles"),
        (lambda: transfer_function([1.0, 0.0], [1.0, 2.0, 1.0]).to_parameters(), "no zero at 0"),
        (lambda: transfer_function([1.0, 1.0], [1.0, 2.0]).to_parameters(), "no place for zeros"),
        (lambda: transfer_function([1.0], np.poly([-1, -2, -3, -4, -5, -6])).to_parameters(), "up to five"),
    ],
)
def test_what_cannot_be_is_refused(made, said):
    with pytest.raises(InputError, match=said):
        made()
