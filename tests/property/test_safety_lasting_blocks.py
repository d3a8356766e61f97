"""How long a condition has held does not depend on how samples are cut into blocks."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.safety.lasting import lasting_s

flags = st.lists(st.booleans(), min_size=1, max_size=40)


def one_by_one(active: list[bool], time_s: np.ndarray) -> list[float]:
    since, held = None, []
    for flag, now in zip(active, time_s, strict=True):
        since = (now if since is None else since) if flag else None
        held.append(now - since if since is not None else -1.0)
    return held


@given(flags, st.lists(st.integers(1, 9), max_size=40), st.lists(st.floats(0.01, 2.0), min_size=40, max_size=40))
def test_cut_as_you_like(active, cuts, steps):
    time_s = np.cumsum(steps)[: len(active)]
    found = []
    since, first = None, 0
    while first < len(active):
        last = first + (cuts.pop() if cuts else len(active))
        held, since = lasting_s(np.array(active[first:last]), time_s[first:last], since)
        found += held.tolist()
        first = last
    assert found == one_by_one(active, time_s)
    assert (since is not None) == active[-1]
