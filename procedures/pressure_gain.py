"""Pressure gain: load pressure over command with the ports A and B blocked, slowly up and down about neutral.

One sweep, and one at half speed. The gain is the slope within ± 40 % of the supply pressure. Needs an output with the
role `load orifice`, and the channels `load pressure` and `supply pressure`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hil.identification.steady.characteristic import Read, level_at, over_all, polyline
from hil.identification.steady.sweep_estimate import SweepEstimate
from hil.language.note import Note
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from procedures._blocked import BlockedSweep, drive_blocked
from procedures._characteristic import steady, swept
from procedures._conditions import LOAD, adjusting
from procedures._definitions import PRESSURE_GAINS, defined
from procedures._efc import SUPPLY_PRESSURE, channel_in, check_channels
from procedures._pressure_drop import LOAD_PRESSURE
from procedures._recorded import calibration_share, calibration_std, departures, parts_of, roles_of, rows_of
from procedures._run_sequence import check_cycle
from procedures._scale import scale_of
from procedures._settings import NotNegative, Positive, PositivePercent

GAIN = Measurement("pressure_gain", "% per %", "slope of the load pressure, % of supply per % of command")
NULL = Measurement("pressure_null", "%", "command at which the load pressure is zero, from neutral, in % of full")
SUPPLY = Measurement("supply_pressure", "bar", "pressure before the valve, mean of the sweeps")
MEASUREMENTS = defined(PRESSURE_GAINS, GAIN, NULL, SUPPLY)
KIND = "blocked sweep"
_WITHIN = 40.0  # % of supply: the definition
_NEEDING = "a pressure gain"


def run(
    rig: Rig,
    *,
    reach: PositivePercent = 15.0,
    cycle_s: Positive = 40.0,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Block the ports and drive the sweeps.

    Args:
        rig: the bench.
        reach: of the sweeps to both sides of neutral, in % of full command; beyond it the load pressure is saturated.
        cycle_s: time of the first sweep up and down, in s; the second takes twice as long.
        warm_up_s: time at the beginning of the sweep before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    adjusting(rig, LOAD, _NEEDING)
    check_channels(rig, (LOAD_PRESSURE, SUPPLY_PRESSURE), _NEEDING)
    check_cycle(rig, cycle_s, rate_hz)
    scale = scale_of(rig, full_command)
    bottom, top = (scale.level("reach", sign * reach) for sign in (-1.0, 1.0))
    sweeps = [BlockedSweep(bottom, top, time_s, f"sweep of {time_s:g} s") for time_s in (cycle_s, 2.0 * cycle_s)]
    drive_blocked(rig, scale, sweeps, KIND, {"from": bottom, "to": top}, warm_up_s, rate_hz)


def evaluate(recording: Recording) -> Findings:
    """Gain and null of the curve between the branches, and the supply pressure that it counts in."""
    parts = parts_of(recording, KIND)
    command, _ = roles_of(recording)
    load, supply = (channel_in(recording, name, "bar") for name in (LOAD_PRESSURE, SUPPLY_PRESSURE))
    reads = np.array([steady(recording, part, supply) for part in parts])
    supply_bar, supply_std = float(reads[:, 0].mean()), float(reads[:, 1].max())
    share_read = replace(load, unit="%", values=100.0 * load.values / supply_bar)
    estimate = swept(recording, parts, share_read).estimate
    percent, neutral = 100.0 / float(parts[0]["full"]), float(parts[0]["neutral"])
    gain, gain_std = _gain(command.values, share_read.values, parts, estimate)
    smooth, null_std = over_all(estimate, lambda response, _slope: level_at(estimate.command, response, 0.0))
    # overlapped edges make a kink at the null, which the smooth curve rounds off: what the two differ by is granted
    null = float(np.mean([level_at(estimate.command, estimate.completed_branch(side), 0.0) for side in (1, -1)]))
    null_std = math.hypot(null_std, null - smooth)
    gain_std = math.hypot(gain_std, gain * supply_std / supply_bar)
    share = math.hypot(*(calibration_share(one) for one in (load, supply, command)))
    notes = []
    if math.isfinite(gain_std):
        gain_found = GAIN.of(gain / percent, gain_std / percent, calibration=share * abs(gain) / percent)
    else:
        gain_found = GAIN.of(None)
        notes.append(Note(
            "The load pressure does not pass ± {within:g} % of the supply pressure. A larger reach may show it.",
            within=_WITHIN,
        ))  # fmt: skip
    if math.isfinite(null_std) and math.isfinite(gain_std):
        level = math.hypot(100.0 * calibration_std(load) / supply_bar / abs(gain), calibration_std(command))
        null_found = NULL.of(percent * (null - neutral), percent * null_std, calibration=percent * level)
    else:
        null_found = NULL.of(None)
    at = polyline()
    curve = {
        "label": f"{supply_bar:.3g} bar", "command_unit": command.unit, "response_unit": "%",
        "command": estimate.command[at], "rising": estimate.completed_branch(1)[at],
        "falling": estimate.completed_branch(-1)[at],
    }  # fmt: skip
    return Findings(
        (gain_found, null_found, SUPPLY.of(supply_bar, supply_std, calibration=calibration_std(supply))),
        {"pressure_gain": [curve]}, tuple(notes), departures(recording),
    )  # fmt: skip


def _gain(
    command: Array, percent_of_supply: Array, parts: Sequence[Mapping[str, Any]], estimate: SweepEstimate
) -> Read:
    """Slope of the straight line through all samples where the curve is within the limits; NaN where it passes none.

    Each branch has a level of its own: what is late or sticks shifts it, and its slope stays.
    """
    ends = sorted(level_at(estimate.command, estimate.response, limit) for limit in (-_WITHIN, _WITHIN))
    if any(map(math.isnan, ends)):
        return math.nan, math.inf
    pushed = pulled = 0.0
    for part, half in zip(parts, estimate.half_widths, strict=True):
        rows = rows_of(part)
        driven, read = command[rows], percent_of_supply[rows]
        for side in (1.0, -1.0):
            place = driven - side * half
            mine = (side * np.gradient(driven) > 0.0) & (place >= ends[0]) & (place <= ends[1])
            late = driven[mine] - driven[mine].mean()
            pushed, pulled = pushed + float(late @ late), pulled + float(late @ read[mine])
    noise = float(np.median(estimate.std * np.sqrt(estimate.points.count)))
    return pulled / pushed, noise / math.sqrt(pushed)
