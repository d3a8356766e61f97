"""The question where outputs stand does not hold back readings on a line that has just become slow."""

from __future__ import annotations

import time

import pytest

from drivers.modbus import LineSettings, ModbusLink
from hil.daq.device_link import ReadBackTimes
from tests.foreign_line import ForeignLine, Tables
from tests.modbus_pair import MODEL, WIRING

READS_OUTPUTS = 3


def test_readings_come_after_one_slow_answer_and_not_after_two() -> None:
    device, answer_s = Tables(inputs={0: 20}, holding={8: 0}), [0.0]

    def answer(frame: bytes) -> bytes:
        time.sleep(answer_s[0])
        return device.on_tcp(frame)

    with ForeignLine(answer) as line:
        link = ModbusLink(LineSettings(address=f"127.0.0.1:{line.port}"), WIRING, MODEL)
        link.drive({"q": 5.0})
        asked = []
        for slow_s, since_s in ((0.0, 0.6), (0.06, 0.6), (0.06, 2.1), (0.0, 0.6)):
            answer_s[0], link._checked_s = slow_s, time.monotonic() - since_s
            before = len(line.heard)
            assert link.read() == {"t": 20.0}
            asked.append(READS_OUTPUTS in [frame[7] for _, frame in line.heard[before:]])
        link.close()
    assert asked == [True, False, True, True]


@pytest.mark.parametrize("usual_s", [0.0005, 0.004, 0.1])
def test_a_line_that_was_always_that_slow_is_asked_twice_a_second(usual_s: float) -> None:
    times = ReadBackTimes()
    for _ in range(3):
        times.took(usual_s)
        assert times.is_due(time.monotonic() - 0.55) and not times.is_due(time.monotonic() - 0.3)
    times.took(max(5.0 * usual_s, 0.02))
    assert not times.is_due(time.monotonic() - 1.5)
