"""Cases of the proof that several tests read: what takes seconds to draw is drawn once in a process."""

from __future__ import annotations

from functools import cache, partial

from tests.once import once
from tests.studies.proof.cases.draw import draw
from tests.studies.proof.cases.label import Label
from tests.studies.proof.cases.truth import Truth

SEED = 5
LEAK = Label("leakage", "cummins-efc", "full", 0)


@cache
def drawn(label: Label) -> Truth:
    """The truth of a case of this seed."""
    return once(f"case-{label}", partial(draw, SEED, label))
