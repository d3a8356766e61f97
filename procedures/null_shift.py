"""Null shift: how far supply pressure, tank pressure and oil temperature move the null of a valve, and oil its flow.

A slow sweep over the whole range under the bench's own conditions, and one with each condition adjusted. The null is
`null_bias` of `flow_curve`. Needs outputs with the roles `supply pressure`, `tank pressure` and `oil temperature`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from hil.errors import SettingError
from hil.identification.steady.null import null_of
from hil.language.words import marked
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import ConditionRole, Rig
from procedures._characteristic import Swept, null_bias, swept
from procedures._conditions import OIL, SUPPLY, TANK, Values, adjusted, adjusting, adjusting_s, check_within, usual
from procedures._definitions import NULL_SHIFTS, defined
from procedures._efc import SUPPLY_PRESSURE, channel_in, check_channels
from procedures._pressure_drop import RETURN_PRESSURE
from procedures._recorded import calibration_share, departures, parts_of, roles_of, rows_of
from procedures._run_sequence import RunSequence, check_cycle, joined, sweep, sweep_part
from procedures._scale import check_stands, scale_of
from procedures._settings import NotNegative, Positive, PositivePercent

NULL = Measurement("null", "%", "command at which nothing flows, from neutral, in % of full command")
SHIFTS: Mapping[ConditionRole, Measurement] = {
    SUPPLY: Measurement("null_shift_supply", "%", "change of the null for 10 % of the supply pressure"),
    TANK: Measurement("null_shift_tank", "%", "change of the null for a tank pressure of 10 % of the supply pressure"),
    OIL: Measurement("null_shift_temperature", "%", "change of the null for 40 K"),
}
FLOW_SHIFT = Measurement("flow_shift_temperature", "", "change of the response at an end of the command for 40 K")
MEASUREMENTS = defined(NULL_SHIFTS, NULL, *SHIFTS.values(), FLOW_SHIFT)
KIND = "null sweep"
_READ: Mapping[ConditionRole, str] = {SUPPLY: SUPPLY_PRESSURE, TANK: RETURN_PRESSURE}
_NEEDING = "a null shift"
_SHARE, _KELVIN = 0.1, 40.0  # of the supply pressure, and of temperature, for which a shift is stated

_Role = Literal["supply pressure", "tank pressure", "oil temperature"]


def run(
    rig: Rig,
    *,
    conditions: tuple[_Role, ...] = ("supply pressure", "tank pressure", "oil temperature"),
    supply_change: PositivePercent = 20.0,
    tank_change: PositivePercent = 10.0,
    temperature_change: Positive = 20.0,
    cycle_s: Positive = 20.0,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive a sweep under each condition.

    Args:
        rig: the bench.
        conditions: which are adjusted, one after another.
        supply_change: of the supply pressure to both sides, in % of the bench's own.
        tank_change: of the tank pressure, upward, in % of the supply pressure.
        temperature_change: of the oil to both sides, in K.
        cycle_s: time of each sweep up and down, in s.
        warm_up_s: time at the beginning of the first sweep before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    if not conditions or len(set(conditions)) < len(conditions):
        raise SettingError(f"setting conditions: {', '.join(conditions) or 'none'}; at least one, and each once")
    for role in conditions:
        adjusting(rig, role, _NEEDING)
    if {SUPPLY, TANK} & {*conditions}:
        check_channels(rig, (SUPPLY_PRESSURE, *(_READ[role] for role in conditions if role in _READ)), _NEEDING)
    check_cycle(rig, cycle_s, rate_hz)
    scale = scale_of(rig, full_command)
    check_stands(scale, _NEEDING)
    ways = _ways(rig, conditions, supply_change, tank_change, temperature_change)
    bottom, top = rig.command.low, rig.command.high
    path = sweep(rig, bottom, top, cycle_s, rate_hz)
    first, once = (joined(rig, rate_hz, warm_s, [path]) for warm_s in (warm_up_s, 0.0))
    whole = np.concatenate([first, *[once] * (len(ways) - 1)])
    sequence = RunSequence(rig, rate_hz, whole, {"conditions": list(conditions)}, adjusting_s(rig, ways))
    for number, way in enumerate(ways):
        with adjusted(rig, way, rate_hz):
            sequence.warm_up(bottom, 0.0 if number else warm_up_s)
            label = ", ".join(
                f"{role} {value:.4g} {rig.adjustable[role].unit.replace('degC', '°C')}" for role, value in way.items()
            )
            part = {"kind": KIND, "label": label or marked("as the bench stands"), "at": {
                role: way.get(role, usual(rig.adjustable[role])) for role in conditions
            }}  # fmt: skip
            sequence.play(path, f"null, {part['label']}", {**part, **sweep_part(rig, scale, bottom, top, cycle_s)})
            sequence.finish()


def _ways(
    rig: Rig, conditions: Sequence[_Role], supply_change: float, tank_change: float, temperature_change: float
) -> list[Values]:
    """Nothing adjusted, then each condition by itself."""
    supply = rig.adjustable.get(SUPPLY)
    pressure = (
        float(rig.conditions["conditions"].get("supply_pressure_bar") or 0.0) if supply is None else usual(supply)
    )
    changes = {
        SUPPLY: ("supply_change", [sign * supply_change / 100.0 * pressure for sign in (-1.0, 1.0)]),
        TANK: ("tank_change", [tank_change / 100.0 * pressure]),
        OIL: ("temperature_change", [-temperature_change, temperature_change]),
    }
    ways: list[Values] = [{}]
    for role in conditions:
        channel, (setting, sizes) = rig.adjustable[role], changes[role]
        if not any(sizes):
            raise SettingError(f"setting {setting}: the bench says no supply pressure of which it is a part")
        levels = [usual(channel) + size for size in sizes]
        check_within(channel, setting, levels)
        ways += [{role: level} for level in levels]
    return ways


def evaluate(recording: Recording) -> Findings:
    """The null under each condition, and the slope of the line through those of one condition; of the flow over oil."""
    parts = parts_of(recording, KIND)
    sweeps = [swept(recording, [part]) for part in parts]
    nulls = []
    for part, found in zip(parts, sweeps, strict=True):
        null, of = null_of(found.estimate, found.low.response, found.high.response), NULL.at(str(part["label"]))
        if null is None or not math.isfinite(null.centre[1]):
            nulls.append(of.of(None))
        else:
            nulls.append(null_bias(found, null, float(part["neutral"]), float(part["full"]), of))
    usual_at, shifts, curves = parts[0]["at"], [], []
    for role in usual_at:
        mine = [pair for pair in zip(parts, nulls, strict=True)
                if pair[0] is parts[0] or pair[0]["at"][role] != usual_at[role]]  # fmt: skip
        shift, curve = _shift(recording, role, mine)
        shifts.append(shift)
        curves += [curve] if curve else []
    flows = _flow_shifts(recording, parts, sweeps) if OIL in usual_at else ()
    return Findings((*shifts, *flows, *nulls), {"null_shift": curves}, deviations=departures(recording))


def _shift(
    recording: Recording, role: ConditionRole, found: Sequence[tuple[Mapping[str, Any], Measured]]
) -> tuple[Measured, dict[str, Any]]:
    """Slope of the null over a condition, for the change that the definition names, and the nulls over it."""
    if len(found) < 2 or any(null.value is None for _, null in found):
        return SHIFTS[role].of(None), {}
    command, _ = roles_of(recording)
    shares = [calibration_share(command)]
    if role == OIL:
        places, change, unit = np.array([float(part["at"][OIL]) for part, _ in found]), _KELVIN, "degC"
        shares.append(calibration_share(recording.channel(recording.meta["roles"][OIL])))
    else:
        places, unit = np.array([_mean(recording, part, _READ[role]) for part, _ in found]), "bar"
        change = _SHARE * _mean(recording, found[0][0], SUPPLY_PRESSURE)
        if role == TANK:
            shares += [calibration_share(recording.channel(name)) for name in (RETURN_PRESSURE, SUPPLY_PRESSURE)]
    nulls = np.array([null.value for _, null in found], dtype=np.float64)
    stds = np.array([null.repeatability for _, null in found], dtype=np.float64)
    value, std = _slope(places, nulls, stds, change)
    rising = np.argsort(places)
    curve = {
        "label": role, "condition_unit": unit, "response_unit": "%", "condition": places[rising],
        "measured": nulls[rising], "std": stds[rising],
        "fitted": (nulls.mean() + value / change * (places - places.mean()))[rising],
    }  # fmt: skip
    return SHIFTS[role].of(value, std, calibration=math.hypot(*shares) * abs(value)), curve


def _flow_shifts(
    recording: Recording, parts: Sequence[Mapping[str, Any]], sweeps: Sequence[Swept]
) -> Iterator[Measured]:
    """Slope of the response at both ends of the command over the oil's temperature."""
    _, response = roles_of(recording)
    usual_at = parts[0]["at"]
    mine = [pair for pair in zip(parts, sweeps, strict=True) if all(
        pair[0]["at"][role] == usual for role, usual in usual_at.items() if role != OIL)]  # fmt: skip
    temperatures = np.array([float(part["at"][OIL]) for part, _ in mine])
    share = math.hypot(calibration_share(response), calibration_share(recording.channel(recording.meta["roles"][OIL])))
    for label, ends in (("high", [one.high for _, one in mine]), ("low", [one.low for _, one in mine])):
        if len(mine) < 2:
            yield FLOW_SHIFT.at(label, response.unit).of(None)
            continue
        stds = np.hypot([end.std for end in ends], [math.hypot(one.rounding, one.drifted) for _, one in mine])
        value, std = _slope(temperatures, np.array([end.response for end in ends]), stds, _KELVIN)
        yield FLOW_SHIFT.at(label, response.unit).of(value, std, calibration=share * abs(value))


def _slope(places: Array, values: Array, stds: Array, change: float) -> tuple[float, float]:
    """Of the line through values over places, for a change of place, with its standard uncertainty."""
    late = places - places.mean()
    by = change * late / (late @ late)
    return float(by @ values), float(np.hypot.reduce(by * stds))


def _mean(recording: Recording, part: Mapping[str, Any], name: str) -> float:
    """Of a pressure over a part, in bar."""
    rows = rows_of(part)
    return float(channel_in(recording, name, "bar").values[rows].mean())
