"""Limits: range, slew, dwell, and tightening."""

from __future__ import annotations

import numpy as np
import pytest

from hil.errors import RangeError
from hil.safety.envelope import Dwell, Envelope, Past


def admit(envelope: Envelope, values: list[float], past: Past | None = None, rate_hz: float = 10.0) -> Past:
    return envelope.admit(np.array(values), rate_hz, past or envelope.start(0.0), name="command", unit="%")[1]


def test_rounding_beyond_a_limit_is_trimmed():
    values, _ = Envelope(-10.0, 10.0).admit(np.array([10.0 + 1e-12]), 10.0, Past(0.0), name="a", unit="V")
    assert values[0] == 10.0


def test_dwell_ends_with_one_sample_below_the_level():
    envelope = Envelope(-10.0, 10.0, dwells=(Dwell(8.0, 1.0),))
    assert admit(envelope, [9.0] * 10 + [8.0] + [9.0] * 10).beyond_s == (pytest.approx(1.0),)


def test_dwell_of_a_new_limit_starts_where_the_output_stands():
    wide = Envelope(-10.0, 10.0)
    past = admit(wide, [9.0] * 50)
    tight = wide.tightened(Envelope(-10.0, 10.0, dwells=(Dwell(8.0, 1.0),)))
    with pytest.raises(RangeError, match="beyond ±8"):
        admit(tight, [9.0] * 11, past)


def test_limits_without_a_common_value_are_refused():
    with pytest.raises(RangeError, match="leave nothing"):
        Envelope(0.0, 1.0).tightened(Envelope(2.0, 3.0))
