"""What a report shows of a sine."""

from dataclasses import replace

import numpy as np

from hil.identification.frequency.sine_segments import Segment
from hil.record.recording import recording
from procedures._sine import overlay


def test_two_periods_are_shown_and_keep_no_view_of_their_whole_recording():
    time_s = np.arange(50_000) * 0.001
    sine = 10.0 * np.sin(2.0 * np.pi * time_s)
    made = recording("sine", time_s, {"command [%]": sine, "flow [l/min]": 0.5 * sine})
    made = replace(made, meta={"roles": {"command": "command", "response": "flow"}})

    shown = overlay(made, Segment(1.0, 0, 50_000, 10.0, 0.0))

    assert np.allclose(shown["measured"], shown["fitted"], atol=1e-9)
    assert [len(shown[name]) for name in ("measured", "fitted", "command")] == [1000] * 3
    assert all(shown[name].base is None for name in ("measured", "fitted", "command"))
