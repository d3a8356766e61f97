"""Limits: range, slew, dwell, and tightening."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.errors import RangeError
from hil.safety.envelope import Dwell, Envelope, Past


def admit(envelope: Envelope, values: list[float], past: Past | None = None, rate_hz: float = 10.0) -> Past:
    return envelope.admit(np.array(values), rate_hz, past or envelope.start(0.0), name="command", unit="%")[1]


@pytest.mark.parametrize("bad", [10.001, -10.001, math.nan, math.inf])
def test_value_beyond_the_range_is_refused(bad):
    with pytest.raises(RangeError, match=r"output 'command', sample 2: .* % is outside -10 … 10 %"):
        admit(Envelope(-10.0, 10.0), [0.0, 10.0, bad])


def test_rounding_beyond_a_limit_is_trimmed():
    values, _ = Envelope(-10.0, 10.0).admit(np.array([10.0 + 1e-12]), 10.0, Past(0.0), name="a", unit="V")
    assert values[0] == 10.0


def test_slew_counts_from_the_value_before():
    envelope = Envelope(-10.0, 10.0, slew_per_s=20.0)
    past = admit(envelope, [2.0, 4.0, 2.0])
    assert past.value == 2.0
    with pytest.raises(RangeError, match=r"sample 0: from 2 to 4.5 % in 0.1 s is 25 %/s; allowed 20 %/s"):
        admit(envelope, [4.5], past)


def test_dwell_adds_up_over_waveforms_and_standstill():
    envelope = Envelope(-10.0, 10.0, dwells=(Dwell(8.0, 1.0),))
    past = admit(envelope, [0.0] + [9.0] * 4)
    assert past.beyond_s == (pytest.approx(0.4),)
    assert admit(envelope, [-9.0] * 6, past).beyond_s == (pytest.approx(1.0),)
    with pytest.raises(RangeError, match=r"sample 3: beyond ±8 % for 1.1 s; allowed 1 s"):
        admit(envelope, [-9.0] * 4, past.held_for(0.3))


def test_dwell_ends_with_one_sample_below_the_level():
    envelope = Envelope(-10.0, 10.0, dwells=(Dwell(8.0, 1.0),))
    assert admit(envelope, [9.0] * 10 + [8.0] + [9.0] * 10).beyond_s == (pytest.approx(1.0),)


def test_dwell_of_a_new_limit_starts_where_the_output_stands():
    wide = Envelope(-10.0, 10.0)
    past = admit(wide, [9.0] * 50)
    tight = wide.tightened(Envelope(-10.0, 10.0, dwells=(Dwell(8.0, 1.0),)))
    with pytest.raises(RangeError, match="beyond ±8"):
        admit(tight, [9.0] * 11, past)


def test_tightened_takes_the_narrower_of_everything():
    both = Envelope(-10.0, 5.0, 3.0, (Dwell(4.0, 1.0),)).tightened(Envelope(-2.0, 9.0, 7.0, (Dwell(1.0, 9.0),)))
    assert both == Envelope(-2.0, 5.0, 3.0, (Dwell(4.0, 1.0), Dwell(1.0, 9.0)))


def test_limits_without_a_common_value_are_refused():
    with pytest.raises(RangeError, match="leave nothing"):
        Envelope(0.0, 1.0).tightened(Envelope(2.0, 3.0))
