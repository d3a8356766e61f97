"""The menu of next tests is made of installed procedures and settings that they take."""

from __future__ import annotations

import numpy as np
import pytest

from hil.diagnosis.answer.next_test import Span, menu
from hil.diagnosis.diagnose import diagnose
from hil.identification.preparation.experiment import Experiment, for_model
from hil.session.procedure import load_procedure
from hil.session.setting import parse_settings
from tests.answers import answer
from tests.concealed import NOISE, RATE_HZ, nominal

BOTH_WAYS, ONE_WAY = Span(0.0, 100.0, -90.0, 90.0), Span(0.0, 2.0, 1.1, 1.9)


@pytest.mark.parametrize("span", [BOTH_WAYS, ONE_WAY], ids=["both ways", "one way"])
def test_every_test_of_the_menu_can_be_run_and_stays_in_its_span(span):
    for test in menu(span):
        settings = parse_settings(load_procedure(test.procedure).settings, {**test.settings, "full_command": span.full})
        assert settings["full_command"] == span.full
        driven = span.neutral + span.full * test.shape(RATE_HZ)
        assert driven.min() >= span.low - 1e-3 * span.full
        assert driven.max() <= span.high + 1e-3 * span.full


def small_sine() -> Experiment:
    """The paper's practice: a small sine about half opening."""
    model = nominal()
    time_s = np.arange(0.0, 20.0, 1.0 / RATE_HZ)
    command = (50.0 + 5.0 * np.sin(2.0 * np.pi * 0.5 * time_s)) * (1.0 + 7.6e-6)  # as a converter gives it
    noise = NOISE * np.random.default_rng(3).standard_normal(len(command))
    return for_model(model, answer(model.definition, command, 1.0 / RATE_HZ, noise=noise, factor=4.0, **model.values))


def test_a_small_sine_shows_little_and_says_so():
    found = diagnose(nominal(), [small_sine()]).diagnosis
    assert found.verdict == "consistent"
    hidden = {limit.effect for limit in found.limits if not limit.visible}
    assert {"deadband", "rate_limit", "saturation"} & hidden
    assert found.next_test is not None
    assert found.next_test.bench_s <= 60.0
    assert found.next_test.settings["full_command"] == 55.0
