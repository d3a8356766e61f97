"""Which command knows more of a recording than a fit to all of its samples: one of sines, of a sweep or of steps."""

from __future__ import annotations

import numpy as np

from hil.identification.frequency.sine_segments import found_segments
from hil.identification.steady.own_sweeps import branches
from hil.identification.step.step_estimate import jumps
from hil.language.note import Note
from hil.record.recording import Recording

_MOST_SAMPLES = 200_000  # of which a look takes no longer than a glance
_MOST_STEPS = 20
_MOSTLY = 0.5  # of the samples


def command_for(recording: Recording, input_name: str) -> Note | None:
    """A sentence that names the command; None where the signal is none that has its own."""
    command = recording.values(input_name)
    if len(command) > _MOST_SAMPLES or not np.all(np.isfinite(command)):
        return None
    edges = jumps(command)
    if 0 < len(edges) <= _MOST_STEPS and len(np.unique(command)) <= len(edges) + 1:
        return Note("its command makes steps: `hil analyse step` reads rise and settling times of each")
    ramps = branches(recording.time_s, command)
    both_ways = len({one.speed_per_s > 0.0 for one in ramps}) > 1
    if both_ways and sum(one.last - one.first for one in ramps) > _MOSTLY * len(command):
        return Note(
            "its command sweeps slowly up and down: `hil analyse flow` reads dead band, hysteresis and the curve"
        )
    sines = found_segments(recording.time_s, command)
    if sum(one.count for one in sines) > _MOSTLY * len(command):
        return Note(
            "its command is made of sines ({count}): `hil analyse sines` makes a frequency response, with uncertainty",
            count=len(sines),
        )
    return None
