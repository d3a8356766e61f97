"""Proof pressure: supply above rated with the ports A and B blocked, and whether the valve leaks more afterwards.

Needs outputs with the roles `supply pressure` and `load orifice`, and the channels `supply pressure` and `return flow`.
Leakage to the outside is for whoever stands beside it to see.
"""

from __future__ import annotations

import math

import numpy as np

from hil.record.measurement import Findings, Measurement
from hil.record.recording import Recording
from hil.rig import Rig
from procedures._characteristic import steady
from procedures._conditions import LOAD, SUPPLY, adjusted, adjusting, adjusting_s, check_within, usual
from procedures._definitions import PROOF, defined
from procedures._efc import SUPPLY_PRESSURE, channel_in, check_channels
from procedures._recorded import calibration_share, calibration_std, departures, parts_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import scale_of
from procedures._settings import NotNegative, Positive, PositivePercent
from procedures.internal_leakage import RETURN_FLOW

PRESSURE = Measurement("proof_pressure", "bar", "supply pressure while the proof pressure was held")
BEFORE = Measurement("leakage_before", "", "flow from supply to tank with blocked ports, before the proof pressure")
CHANGE = Measurement("leakage_change", "", "what that flow is more afterwards, at the same supply pressure")
MEASUREMENTS = defined(PROOF, PRESSURE, BEFORE, CHANGE)
KIND = "proof pressure"
_NEEDING = "a proof pressure"


def run(
    rig: Rig,
    *,
    pressure: PositivePercent = 130.0,
    hold_s: Positive = 30.0,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Hold the proof pressure at both ends of the command, and the usual supply at neutral before and after it.

    Args:
        rig: the bench.
        pressure: supply pressure that is held, in % of the bench's own.
        hold_s: time at each end of the command, and at neutral, in s.
        warm_up_s: time at neutral before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    blocked, supply = {LOAD: adjusting(rig, LOAD, _NEEDING).low}, adjusting(rig, SUPPLY, _NEEDING)
    check_channels(rig, (SUPPLY_PRESSURE, RETURN_FLOW), _NEEDING)
    proof = {SUPPLY: usual(supply) * pressure / 100.0}
    check_within(supply, "pressure", list(proof.values()))
    scale = scale_of(rig, full_command)
    held = max(2, round(hold_s * rate_hz))
    ends = scale.levels("commands", None)
    pieces = [np.full(held, level) for level in (scale.neutral, *ends, scale.neutral)]
    sequence = RunSequence(rig, rate_hz, joined(rig, rate_hz, warm_up_s, pieces), {"pressure_bar": proof[SUPPLY]},
                    adjusting_s(rig, [blocked, proof]))  # fmt: skip
    with adjusted(rig, blocked, rate_hz):
        sequence.warm_up(scale.neutral, warm_up_s)
        sequence.play(pieces[0], "leakage before", {"kind": KIND, "label": "before"})
        with adjusted(rig, proof, rate_hz):
            for piece in pieces[1:-1]:
                sequence.go_to(float(piece[0]))
                sequence.play(piece, f"{proof[SUPPLY]:.4g} {supply.unit} held", {"kind": KIND, "label": "held"})
            sequence.go_to(scale.neutral)
        sequence.play(pieces[-1], "leakage after", {"kind": KIND, "label": "after"})
        sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """The pressure that was held, and the leakage after it less that before."""
    parts = parts_of(recording, KIND)
    pressure, flow = channel_in(recording, SUPPLY_PRESSURE, "bar"), recording.channel(RETURN_FLOW)
    held = [steady(recording, part, pressure) for part in parts if part["label"] == "held"]
    least = min(held)
    before, after = (steady(recording, part, flow) for part in parts if part["label"] in ("before", "after"))
    change, share = after[0] - before[0], calibration_share(flow)
    measured = (
        PRESSURE.of(*least, calibration=calibration_std(pressure)),
        BEFORE.at(unit=flow.unit).of(*before, calibration=calibration_std(flow)),
        CHANGE.at(unit=flow.unit).of(change, math.hypot(before[1], after[1]), calibration=share * abs(change)),
    )
    return Findings(measured, deviations=departures(recording))
