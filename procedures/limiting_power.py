"""Limiting power: steady flow of several commands while the valve pressure drop rises with the supply pressure.

The hydraulic power of a valve is its flow times its pressure drop. Where flow forces or a starved pilot close it, the
flow rises no further. Needs an output with the role `supply pressure`, and the channels `supply pressure` and
`return pressure`; a `load pressure` is taken off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.errors import SettingError
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.signals.interval import CERTAIN
from hil.units import is_convertible
from procedures._definitions import LIMITING_POWERS, defined
from procedures._efc import channel_in
from procedures._recorded import departures, parts_of, roles_of
from procedures._scale import scale_of
from procedures._settings import NotNegative, Percent, Positive, PositivePercent
from procedures._supplies import KIND, Points, by_command, drive_supplies

POWER = Measurement("limiting_power", "kW", "largest hydraulic power of the valve at a command")
DROP = Measurement("limiting_drop", "bar", "valve pressure drop at which that power was reached")
SATURATED = Measurement("saturation_drop", "bar", "valve pressure drop from which the flow rises no further")
MEASUREMENTS = defined(LIMITING_POWERS, POWER, DROP, SATURATED)
_FLOW_UNIT, _KW = "l/min", 1.0 / 600.0  # kW of a bar and an l/min
_SATURATED = 0.25  # half the slope of log flow over log drop that a sharp edge has
# A flow with a kink has a slope that jumps between two points; the straight line through the slopes between points
# crosses a quarter no farther from the kink than this share of their distance, wherever between them it lies.
_KINK = 0.086


def run(
    rig: Rig,
    *,
    commands: tuple[Percent, ...] | None = None,
    supplies: tuple[PositivePercent, ...] = (25.0, 50.0, 75.0, 100.0, 125.0, 150.0, 175.0, 200.0),
    hold_s: Positive = 2.0,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive every command at every supply pressure.

    Args:
        rig: the bench.
        commands: in % of full command from neutral; the ends of its range, and halfway there, when not given.
        supplies: supply pressures, in % of the bench's own.
        hold_s: time at each command; the second half is measured, in s.
        warm_up_s: time at the first command before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    if not is_convertible(rig.response.unit, _FLOW_UNIT):
        raise SettingError(f"'{rig.response.name}' is in {rig.response.unit}; a limiting power needs a flow")
    scale = scale_of(rig, full_command)
    levels = scale.levels("commands", commands)
    if commands is None:
        levels = sorted([*levels, *scale.levels("commands", None, 0.5)], reverse=True)
    drive_supplies(rig, scale, levels, supplies, "a limiting power", hold_s, warm_up_s, rate_hz)


def evaluate(recording: Recording) -> Findings:
    """The largest power of each command, and where its flow saturates."""
    _, response = roles_of(recording)
    flow = channel_in(recording, response.name, _FLOW_UNIT)
    measured: list[Measured] = []
    curves: list[dict[str, Any]] = []
    for label, parts in by_command(parts_of(recording, KIND)).items():
        read = Points.of(recording, parts, flow).rising
        measured += _figures(label, read)
        curves.append({
            "label": label, "drop_unit": "bar", "response_unit": _FLOW_UNIT, "drop": read.drop[:, 0],
            "measured": read.flow[:, 0],
        })  # fmt: skip
    return Findings(tuple(measured), {"limiting_power": curves}, deviations=departures(recording))


def _figures(label: str, read: Points) -> list[Measured]:
    power, at, saturated = (what.at(label) for what in (POWER, DROP, SATURATED))
    if not read.have_a_law:
        return [one.of(None) for one in (power, at, saturated)]
    (flow, flow_std), (drop, drop_std) = read.flow.T, read.drop.T
    powers = _KW * np.abs(flow) * drop
    k = int(np.argmax(powers))

    def both(of_flow: float, of_drop: float) -> float:
        return float(powers[k]) * math.hypot(of_flow / flow[k], of_drop / drop[k])

    figures = [
        power.of(float(powers[k]), both(flow_std[k], drop_std[k]), calibration=both(read.meter, read.gauges)),
        at.of(float(drop[k]), float(drop_std[k]), calibration=read.gauges),
    ]
    found = _saturation(read)
    if found is None:
        return [*figures, saturated.of(float(drop[-1]), float(drop_std[-1]), relation=">", calibration=read.gauges)]
    return [*figures, saturated.of(*found, calibration=read.gauges)]


@dataclass(frozen=True, slots=True)
class _Slopes:
    """Slopes of log flow over log drop between neighbouring points, with standard uncertainties, and where they are."""

    at: Array
    values: Array
    stds: Array

    @classmethod
    def of(cls, read: Points) -> _Slopes:
        logs = np.log(np.abs(read.flow[:, 0])), np.log(read.drop[:, 0])
        apart = np.diff(logs[1])
        values = np.diff(logs[0]) / apart
        shares = np.hypot(read.flow[:, 1] / read.flow[:, 0], _SATURATED * read.drop[:, 1] / read.drop[:, 0])
        return cls(logs[1][:-1] + apart / 2.0, values, np.hypot(shares[1:], shares[:-1]) / apart)


def _saturation(read: Points) -> tuple[float, float] | None:
    """Drop from which the slope stays below a quarter, and its standard uncertainty; None where it does not for sure.

    Where the lowest drops are saturated already it is below them: the lowest is given, and the way down to nothing.
    """
    slopes = _Slopes.of(read)
    low = slopes.values < _SATURATED
    first = len(low) - int(np.argmin(low[::-1])) if not low.all() else 0
    if first == len(low) or slopes.values[-1] > _SATURATED - CERTAIN * slopes.stds[-1]:
        return None
    if first == 0:
        lowest = float(read.drop[0, 0])
        return lowest, lowest / math.sqrt(3.0)
    before, after = first - 1, first
    fall = slopes.values[before] - slopes.values[after]
    share = (slopes.values[before] - _SATURATED) / fall
    apart = slopes.at[after] - slopes.at[before]
    place = math.exp(slopes.at[before] + share * apart)
    noise = math.hypot((1.0 - share) * slopes.stds[before], share * slopes.stds[after]) / fall
    return place, place * float(apart) * math.hypot(noise, _KINK)
