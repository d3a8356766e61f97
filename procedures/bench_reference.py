"""Bench reference: flow curve and steps of a known valve or a loop-back; two minutes show a bench that has moved.

`hil check BENCH --reference SN` drives it and holds what it finds against the first such run of the same serial number.
"""

from __future__ import annotations

from hil.language.note import Note
from hil.record.measurement import Findings
from hil.record.recording import Recording
from hil.rig import Rig
from procedures import flow_curve, step_response
from procedures._sequence import SequencedTest, both_sides, drive, evaluated
from procedures._settings import Positive, PositivePercent

RESUMABLE = True
MEASUREMENTS = (*flow_curve.MEASUREMENTS, *step_response.MEASUREMENTS)


def run(
    rig: Rig,
    *,
    cycle_s: Positive = 20.0,
    step: PositivePercent = 50.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive a flow curve, and steps from neutral and back.

    Args:
        rig: the bench.
        cycle_s: time of one sweep of the flow curve up and down, in s.
        step: size of the steps, in % of full command; to both sides where it has two.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    common = {"full_command": full_command, "rate_hz": rate_hz}
    curve = SequencedTest(flow_curve, Note("flow curve"), {**common, "cycle_s": cycle_s})
    levels = both_sides(rig, "step", (step,), full_command)
    drive(rig, [curve, SequencedTest(step_response, Note("steps"), {**common, "levels": levels})])


def evaluate(recording: Recording) -> Findings:
    """The figures of both."""
    return evaluated(
        recording,
        [SequencedTest(flow_curve, Note("flow curve"), {}), SequencedTest(step_response, Note("steps"), {})],
    )
