"""The one score beside today's decision: what of its fits is a hypothesis, and what it says of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.events.event import Events
from hil.diagnosis.measures import is_another
from hil.diagnosis.score import Hypothesis, Noise, table
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.terms import Term
from hil.diagnosis.shadow import as_dict, as_hypothesis, beside, there
from hil.identification.estimate import Unknown

COUNT = 20_000
NOISE = Noise(COUNT, 1.0, 1.06, COUNT, 25)
WIDTH = Unknown("width", "%", 1.0, 0.0, 10.0, 1.0)
PLAY = Term("effect", "backlash", "position", "spool", (WIDTH,), ((1.0,),), nulls=(0.0,))


def events(name: str, shows_as: str = "") -> Events:
    return Events(name, "sensor", "sensor", (), {}, np.zeros(0), (), "", "", shows_as=shows_as)


def test_there_leaves_out_what_ended_at_nothing() -> None:
    both = Fitted((PLAY, replace(PLAY, name="coil_lag")), ((0.0005,), (0.3,)), {}, 1.0, np.zeros(0))
    assert there(both).names == ("coil_lag",)
    assert there(replace(both, values=((0.3,), (0.3,)))).names == ("backlash", "coil_lag")


def test_as_hypothesis_counts_a_freed_parameter_as_a_cause() -> None:
    gain = replace(PLAY, kind="parameter", name="gain", nulls=())
    told = as_hypothesis(Fitted((PLAY, gain), ((0.3,), (2.0,)), {}, 7.0, np.zeros(0)))
    assert (told.names, told.changed, told.causes, told.unknowns) == (("backlash",), ("gain",), 2, 2)


@pytest.mark.parametrize(
    ("telling", "value", "other"),
    [("ends", 0.05, True), ("ends", 8.0, True), ("ends", 3.0, False), ("upper end", 0.05, False),
     ("upper end", 8.0, True), ("", 8.0, False)],
)  # fmt: skip
def test_is_another_where_the_telling_shape_ended_there(telling: str, value: float, other: bool) -> None:
    """A supply whose pressure falls at once bends the static curve, as a spring does that nobody has written down."""
    recovery = Unknown("recovery", "s", 1.0, 0.05, 8.0, 1.0)
    marks = (("recovery", telling),) if telling else ()
    droop = Term("effect", "supply_droop", "supply", "tank", (recovery,), ((1.0,),), nulls=(0.0,), telling=marks)
    assert is_another(Fitted((droop,), ((value,),), {}, 1.0, np.zeros(0))) is other


def test_beside_events_stand_first_and_hide_their_other_side() -> None:
    taken = [events("dropout"), events("quantisation", "sensor_offset")]
    friction, offset = Hypothesis(("friction",), 1.0, 1, 2), Hypothesis(("sensor_offset",), 1.0, 1, 1)
    assert beside(friction, []) == friction
    assert beside(friction, taken).names == ("dropout", "quantisation", "friction")
    assert beside(offset, taken).names == ("dropout", "quantisation")


def test_as_dict_parameters_beside_events_are_no_effects() -> None:
    gain, nothing = Hypothesis((), COUNT, 1, 1, changed=("gain",)), Hypothesis((), 6.0 * COUNT)
    said = as_dict(table(NOISE, [beside(h, [events("dropout")]) for h in (nothing, gain)]))
    assert (said["verdict"], said["names"]) == ("explained", ["dropout"])
    assert said["rows"][0]["name"] == "dropout + gain"


@pytest.mark.parametrize("colour", [1.0, 3.3])
def test_as_dict_what_slow_noise_does_is_no_cause(colour: float) -> None:
    """A healthy EFC whose noise had a memory of 100 samples: a slow tone gained 72 in χ²."""
    noise = Noise(33_294, 1.0, 1.06, 33_294 / colour, 25)
    rows = [Hypothesis((), 33_379.0), Hypothesis(("periodic_disturbance",), 33_307.0, 1, 3)]
    assert as_dict(table(noise, rows))["verdict"] == "consistent"
