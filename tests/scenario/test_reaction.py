"""A pressure beyond its limit, on a link whose answers become slow while the valve is driven: when outputs are safe."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import numpy as np
import pytest

from hil.clock import RealClock
from hil.daq.contract import Waveform
from hil.daq.polled import PolledDaq
from hil.errors import LinkError, StoppedError
from hil.safety.guard import Guard
from hil.safety.interlock import Band, Interlock
from hil.safety.protection import Protection
from tests.driven import played
from tests.stops import WIRING, Remote
from tests.waits import until

RATE_HZ, BLOCK_S, FOR_S = 100.0, 0.1, 0.02
BUSY_S = 0.1  # what a computer that does other things besides may add


class Slow(Remote):
    """Answers take as long as they are told to; it obeys at once."""

    answer_s, pressure = 0.0, 1.0

    def standing(self) -> Mapping[str, float]:
        time.sleep(self.answer_s)
        return super().standing()

    def drive(self, values: Mapping[str, float]) -> None:
        super().drive(values)
        time.sleep(self.answer_s)

    def read(self) -> Mapping[str, float]:
        time.sleep(self.answer_s)
        return {"in": self.pressure}


def driven(after_s: float, answer_s: float) -> tuple[float, Exception]:
    """Answers become slow, some time later the pressure rises: how long the output still stood, and what was raised."""
    remote = Slow()
    locks = [Interlock("pressure", "stop", Band("pressure", high=5.0), for_s=FOR_S)]
    guard = Guard(
        PolledDaq({"remote": remote}, {"remote": WIRING}),
        Protection(RATE_HZ, {}, {}, locks, BLOCK_S),
        None,
        RealClock(),
    )
    rose_s: list[float] = []

    def rise() -> None:
        time.sleep(0.3)
        remote.answer_s = answer_s
        time.sleep(after_s)
        rose_s.append(time.monotonic())
        remote.pressure = 9.0

    threading.Thread(target=rise).start()
    with pytest.raises((StoppedError, LinkError)) as ended:
        played(guard, Waveform(RATE_HZ, {"valve": np.full(1000, 5.0)}))
    guard.close()
    until(lambda: rose_s)
    (safe_s, _) = next(one for one, before in zip(remote.given[::-1], remote.given[-2::-1], strict=False) if before[1])
    return safe_s - rose_s[0], ended.value


@pytest.mark.alone
@pytest.mark.slow
@pytest.mark.parametrize("after_s", [0.0, 0.4])
@pytest.mark.parametrize("answer_s", [0.0, 0.02, 0.05, 0.1, 0.15])
def test_reaction_takes_a_block_or_a_sample_and_one_answer_however_slow(answer_s, after_s):
    took_s, ended = driven(after_s, answer_s)
    assert took_s < max(BLOCK_S, 2.0 * answer_s) + answer_s + FOR_S + BUSY_S
    assert isinstance(ended, StoppedError) and "interlock 'pressure'" in str(ended)


@pytest.mark.alone
@pytest.mark.slow
@pytest.mark.parametrize("answer_s", [0.05, 0.1, 0.15])
def test_link_that_stays_too_slow_has_ended_the_run_before(answer_s):
    took_s, ended = driven(2.0, answer_s)
    assert took_s < 0.0 and "the link has become too slow" in str(ended)
