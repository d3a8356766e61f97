"""How much events may leave of a misfit and still be all there is of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from hil.diagnosis.events import recognise
from hil.diagnosis.events.event import Events
from hil.diagnosis.events.recognise import recognised

COUNT = 10_000


def leaving(beyond: float) -> Events:
    """A tone that leaves so much beyond the noise."""
    residuals = np.full(COUNT, np.sqrt(1.0 + beyond))
    return Events("periodic_disturbance", "sensor", "sensor", (), {}, residuals, (), "", "", gives_way=True)


@pytest.mark.parametrize(
    ("misfit", "left", "whole", "part"),
    [
        (2.0, 0.15, True, False),  # a thirteenth
        (2.0, 0.3, False, True),  # a seventh
        (0.2, 0.028, True, False),  # a seventh, of no practical size
        (0.08, 0.028, False, True),  # a third, of no practical size: so was most of the misfit
        (2.0, 1.8, False, False),
    ],
)
def test_a_tone_is_all_there_is(
    monkeypatch: pytest.MonkeyPatch, misfit: float, left: float, whole: bool, part: bool
) -> None:
    monkeypatch.setattr(recognise, "tone", lambda _problem, _beside: leaving(left))
    monkeypatch.setattr(recognise, "held_outputs", lambda _problem, _beside: None)
    found = recognised(SimpleNamespace(size=COUNT), (None,), misfit, commands=False)  # type: ignore[arg-type]
    assert [events is not None for events in found] == [whole, part]
