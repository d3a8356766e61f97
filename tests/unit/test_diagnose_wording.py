"""Numbers in words: as many digits as the uncertainty supports, shares in percent."""

from __future__ import annotations

import re
from typing import get_args

import pytest

from hil.diagnosis.diagnosis import ChangedParameter, DiagnosisVerdict, Finding, Left, Quantity
from hil.diagnosis.evidence.locate import Where
from hil.diagnosis.search.terms import Term
from hil.diagnosis.wording import (
    confounded,
    drifted,
    headline,
    nothing_identifiable,
    quantity_text,
    sentence,
    unlikely,
)
from hil.language.note import translated
from hil.language.words import speaking
from hil.physics.compose import effect, effects, plant


@pytest.mark.parametrize(
    ("value", "std", "unit", "text"),
    [
        (2.7076, 0.00163, "%", "2.7076 ± 0.0032 %"),
        (3.0, 5.6, "1", "3 ± 11"),
        (173.3, None, "mm", "173 mm"),
        (0.0041, float("inf"), "s", "0.0041 s"),
    ],
)
def test_as_many_digits_as_the_uncertainty_supports(value, std, unit, text):
    assert quantity_text(value, std, unit) == text


def test_a_share_is_told_in_percent():
    droop = effect("supply_droop")
    term = Term("effect", "supply_droop", "supply", "supply", (), ())
    said = sentence(droop, term, {"droop": Quantity(0.2792, 0.00097, "1", "share of supply pressure lost")})
    assert said == "The supply gives way: at full flow its pressure falls by 27.92 ± 0.19 %."


def test_a_stop_that_was_not_reached_is_not_told():
    term = Term("effect", "end_stop", "load", "carriage", (), ())
    lower, upper = Quantity(-0.0994, 0.00002, "m", "lower stop"), Quantity(0.314, float("inf"), "m", "upper stop")
    said = sentence(effect("end_stop"), term, {"lower": lower, "upper": upper})
    assert said == "It runs against a stop: below at -0.099400 ± 0.000039 m, above at none that was reached."


def test_where_each_of_several_would_do_the_library_is_not_said_to_have_nothing():
    left = Left(0.145, 0.029, 0.3, "l/min", None, (), 2.5)
    several = headline("unexplained", (), (), left, alike=("dead_time", "sensor_lag"))
    assert several.endswith("Dead time and sensor lag come nearest, and something unknown explains it as well.")
    assert headline("unexplained", (), (), left).endswith("and nothing in the library explains it.")
    cut = headline("unexplained", (), (), left, is_cut=True)
    assert cut.endswith("Not finished: the budget was spent before all causes were looked at.")


def test_a_parameter_that_has_grown_into_an_effect_is_told_once():
    where, late = Where("", (), (0.0, 1.0), "", {}), Quantity(0.0396, 0.00003, "s", "pilot transport")
    delay = Finding("dead_time", "dead time", 0.99, "command", "command", {"dead_time": late}, where, "", "", "")
    same = ChangedParameter("dead_time", 0.0166, 0.0396, 0.00003, "s", "pilot transport", at_bound=False)
    text = headline("explained", (delay,), (same,), Left(0.0, 0.0, 0.3, "l/min", None, (), 2.5))
    assert text == (
        "The model leaves out dead time (command). With it the recordings are explained down to what noise allows."
    )


def test_what_stays_of_a_large_misfit_is_told_beside_the_noise_and_not_as_nothing():
    where = Where("", (), (0.0, 1.0), "", {})
    stop = Finding("end_stop", "end stop", 0.9, "carriage", "load", {}, where, "", "", "")
    text = headline("partly_explained", (stop,), (), Left(0.0, 2.3e-5, 2.0e-5, "m", None, (), 0.093))
    assert text.endswith("Something more is missing: 2.3e-05 m (rms) stay beside noise of 2e-05 m.")


@pytest.mark.parametrize(
    ("verdict", "then"),
    [
        ("parameter_change", ""),
        ("explained", " With it 96.3 % of the change is explained."),
        ("partly_explained", " Something more has changed: 3.7 % of the change stays."),
    ],
)
def test_a_changed_parameter_is_in_the_headline_of_every_verdict_that_names_it(verdict, then):
    seal = ChangedParameter("coulomb", 25.9, 1425.8, 22.5, "N", "Coulomb friction of the seal", at_bound=False)
    left = Left(0.037, 0.3, 0.1, "mm", None, (), 2.5)
    changed = "The unit has changed since identification. Coulomb friction of the seal is 1426 ± 44 N instead of 26 N."
    text = headline(verdict, (), (seal,), left, is_change=True)
    assert text == f"{changed}{then}"


def test_the_headline_says_what_stays_beside_the_noise():
    where = Where("", (), (0.0, 1.0), "", {})
    droop = Finding("supply_droop", "drooping supply", 0.9, "supply", "supply", {}, where, "", "", "")
    lag = Finding("sensor_lag", "lag of the sensor", 0.9, "sensor", "sensor", {}, where, "", "", "")
    explained = headline("explained", (droop,), (), Left(0.001, 0.05, 0.3, "l/min", None, (), 2.5))
    assert explained.endswith(". With it the recordings are explained down to what noise allows.")
    rough = headline("explained", (droop, lag), (), Left(0.022, 4.3, 0.3, "l/min", None, (), 2.5))
    assert rough == (
        "The model leaves out drooping supply (supply) and lag of the sensor (sensor). With them 97.8 % of the misfit "
        "is explained: 4.3 l/min (rms) stay beside noise of 0.3 l/min."
    )
    new = headline("partly_explained", (lag,), (), Left(0.022, 4.3, 0.3, "l/min", None, (), 2.5), is_change=True)
    assert new.startswith(
        "New since identification: lag of the sensor (sensor). Something more has changed: 2.2 % of the "
    )
    three = headline("explained", (droop, lag, droop), (), Left(0.001, 0.05, 0.3, "l/min", None, (), 2.5))
    assert "drooping supply (supply), lag of the sensor (sensor) and drooping supply (supply)" in three


@pytest.mark.parametrize(("after", "said"), [(10.0, True), (0.1, True), (2.0, False), (0.4, False)])
def test_a_parameter_that_changed_beyond_wear_brings_a_word_about_units(after, said):
    changed = ChangedParameter("spool_frequency", 33.0, 33.0 * after, 0.1, "rad/s", "natural frequency of the spool")
    word = f"spool_frequency is {after:g} times what it was: if that cannot be, look at the units of the channels"
    assert [text.startswith(word) for text in unlikely([changed])] == [True] * said


def longest(text: str) -> int:
    """Words of the longest sentence; a number with its interval and unit counts as what it is written as."""
    return max(len(part.split()) for part in re.split(r"(?<=[.!?])\s", text))


def is_german(note: str) -> bool:
    """Whether a page in German has no English word of it, and no decimal point."""
    with speaking("de"):
        return not re.search(r"\b(the|of|is|and|with|it|not)\b|\d\.\d", translated(note))


@pytest.mark.parametrize("each", effects(), ids=lambda each: each.name)
def test_an_effect_is_told_in_sentences_that_can_be_read(each):
    told = {p.name: Quantity(1.2345, 0.05, p.unit.format(value="l/min", motion="mm"), "") for p in each.parameters}
    said = sentence(each, Term("effect", each.name, "", "", (), ()), told)
    assert longest(said) <= 25
    assert is_german(said)


@pytest.mark.parametrize("is_change", [False, True])
@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("verdict", get_args(DiagnosisVerdict))
def test_a_verdict_is_told_in_sentences_that_can_be_read(verdict, count, is_change):
    where = Where("", (), (0.0, 1.0), "", {})
    found = [Finding("friction", "friction with sticking", 0.9, "spool", "force", {}, where, "", "", "")] * count
    changed = [ChangedParameter("mass", 3.0, 4.0, 0.1, "kg", "moved mass, motor and screw included")] * count
    left = Left(0.022, 4.3, 0.3, "l/min", None, (), 2.5)
    said = headline(verdict, found, changed, left, is_change=is_change)
    assert max(longest(said), longest(nothing_identifiable(4.0))) <= 25
    assert is_german(said) and is_german(nothing_identifiable(4.0))


def test_warnings_are_told_in_sentences_that_can_be_read():
    changed = ChangedParameter("speed_extend", 100.0, 700.0, 0.1, "mm/s", "extension at full opening")
    axis = plant("linear-axis")
    moved = drifted(axis.parameters[:2], axis.typical, {p.name: 1.01 * p.typical for p in axis.parameters})
    for text in (*unlikely([changed]), confounded(changed, ["loop_gain"], 90.0), moved):
        assert longest(text) <= 25
        assert is_german(text)
