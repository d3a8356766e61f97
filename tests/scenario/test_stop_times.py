"""A hundred stops of each kind, and how long each took until an observer read the safe value at the device."""

import numpy as np
import pytest

from tests.stop_times import distribution, stops

STOPS = 100


@pytest.mark.alone
@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "viewers", "p99_s"),
    [("work", 20, 0.1), ("killed", 20, 0.1), ("hung", 20, 0.3)],
    ids=["with 20 viewers", "with the web server killed", "with the run hung"],
)
def test_stop_is_read_back_at_the_device_in_time(how, viewers, p99_s, capsys):
    found = stops(STOPS, how, viewers)
    with capsys.disabled():
        print(f"\nstop, {how}, {viewers} viewers: {distribution(found)}")
    # a run that hung may have had a command under way: what is read back at once is confirmed `late_s` later
    assert {one.answer["state"] for one in found} == {"unconfirmed" if how == "hung" else "confirmed"}
    assert {one.answer["by"] for one in found} == {"watchdog" if how == "hung" else "run"}
    assert max(one.answered_s for one in found) < 1.0
    assert float(np.percentile([one.safe_s for one in found], 99)) <= p99_s
