"""Internal leakage: flow from supply to tank over the command with the ports A and B blocked.

A slow sweep over the whole range, and one about neutral, where the leakage has its peak. Needs an output with the role
`load orifice`, and the channel `return flow`. What a pilot stage takes is in it.
"""

from __future__ import annotations

import math

import numpy as np

from hil.identification.steady.characteristic import Read, over_all, polyline
from hil.identification.steady.sweep_estimate import SweepEstimate
from hil.identification.uncertainty.parametric_bootstrap import about
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.crossing import crossing
from hil.signals.interval import CERTAIN
from hil.signals.rounding import mean_rounding_std
from procedures._blocked import BlockedSweep, drive_blocked
from procedures._characteristic import swept
from procedures._conditions import LOAD, adjusting
from procedures._definitions import LEAKAGES, defined
from procedures._efc import check_channels
from procedures._recorded import calibration_std, departures, parts_of, reading_step, roles_of
from procedures._run_sequence import check_cycle
from procedures._scale import scale_of
from procedures._settings import NotNegative, Positive, PositivePercent

PEAK = Measurement("leakage_peak", "", "largest flow from supply to tank with blocked ports")
PEAK_AT = Measurement("leakage_peak_at", "%", "middle of the peak, from neutral, in % of full command")
HIGH = Measurement("leakage_high", "", "flow from supply to tank at the upper end of the command")
LOW = Measurement("leakage_low", "", "flow from supply to tank at the lower end of the command")
MEASUREMENTS = defined(LEAKAGES, PEAK, PEAK_AT, HIGH, LOW)
RETURN_FLOW = "return flow"
KIND = "leakage sweep"
_NEEDING = "the internal leakage"


def run(
    rig: Rig,
    *,
    reach: PositivePercent = 10.0,
    cycle_s: Positive = 60.0,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Block the ports and drive both sweeps.

    Args:
        rig: the bench.
        reach: of the sweep about neutral, to both sides, in % of full command.
        cycle_s: time of each sweep up and down, in s.
        warm_up_s: time at the beginning of the sweep before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    adjusting(rig, LOAD, _NEEDING)
    check_channels(rig, (RETURN_FLOW,), _NEEDING)
    check_cycle(rig, cycle_s, rate_hz)
    scale = scale_of(rig, full_command)
    near = scale.level("reach", -reach), scale.level("reach", reach)
    ranges = ((rig.command.low, rig.command.high), near)
    sweeps = [BlockedSweep(bottom, top, cycle_s, f"{bottom:.4g} … {top:.4g} {rig.command.unit}")
              for bottom, top in ranges]  # fmt: skip
    drive_blocked(rig, scale, sweeps, KIND, {"near": list(near)}, warm_up_s, rate_hz)


def evaluate(recording: Recording) -> Findings:
    """The peak from the sweep about neutral, the ends from that over the whole range, and both as a map."""
    parts = parts_of(recording, KIND)
    command, _ = roles_of(recording)
    flow = recording.channel(RETURN_FLOW)
    found = [swept(recording, [part], flow) for part in parts]
    level, percent = calibration_std(flow), 100.0 / float(parts[0]["full"])
    whole, measured = found[0], []
    if len(found) > 1:
        near = found[1].estimate
        noise_std = float(np.median(near.std * np.sqrt(near.points.count)))
        coded = mean_rounding_std(noise_std, reading_step(recording, flow))
        peak, peak_std = _peak(near)
        at, at_std = over_all(near, lambda response, _slope: 0.5 * sum(_flanks(near.command, response)))
        steep = np.interp(_flanks(near.command, near.response), near.command, near.slope)
        at_std = math.hypot(at_std, *(0.5 * coded / steep))
        stands_out = peak - max(near.response[0], near.response[-1]) > CERTAIN * math.hypot(peak_std, coded)
        neutral, is_there = float(parts[0]["neutral"]), stands_out and math.isfinite(at_std)
        measured += [
            PEAK.at(unit=flow.unit).of(peak, math.hypot(peak_std, coded), calibration=level),
            PEAK_AT.of(percent * (at - neutral), percent * at_std, calibration=percent * calibration_std(command))
            if is_there else PEAK_AT.of(None),
        ]  # fmt: skip
    for what, end in ((HIGH, whole.high), (LOW, whole.low)):
        std = math.hypot(end.std, whole.rounding, whole.drifted)
        measured.append(what.at(unit=flow.unit).of(end.response, std, calibration=level))
    curves = [
        {
            "label": label, "command_unit": command.unit, "response_unit": flow.unit,
            "command": one.estimate.command[polyline()], "measured": one.estimate.response[polyline()],
            "std": np.std(one.estimate.responses, axis=0)[polyline()],
        }
        for label, one in zip(("whole range", "about neutral"), found, strict=False)
    ]  # fmt: skip
    return Findings(tuple(measured), {"internal_leakage": curves}, deviations=departures(recording))


def _peak(near: SweepEstimate) -> Read:
    """The largest leakage, less what noise adds to a largest value (bootstrap: Efron, Tibshirani, 1993, ch. 10)."""
    value, again = float(near.response.max()), near.responses.max(axis=1)
    return 2.0 * value - float(again.mean()), about(again, value)


def _flanks(command: Array, leakage: Array) -> tuple[float, float]:
    """Between which commands the curve is above halfway from its larger end to its peak; NaN where an end is.

    Two edges that overlap make two peaks with a dip between them: where the largest value is, noise decides.
    """
    half = 0.5 * (leakage.max() + max(leakage[0], leakage[-1]))
    above = np.flatnonzero(leakage >= half)
    first, last = int(above[0]), int(above[-1])
    if first == 0 or last == len(command) - 1:
        return math.nan, math.nan
    return crossing(command, leakage, half, first - 1, first), crossing(command, leakage, half, last, last + 1)
