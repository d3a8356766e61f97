"""What tests under adjusted conditions must find: a simulator of another structure, read by the written definitions."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

from hil.bench.find import benches
from hil.physics.compose import plant
from hil.record.recording import Array, Recording
from tests.coverage_study.situations import Situation
from tests.coverage_study.truth_static import Truths
from tests.four_way_simulator import curve

_NEAR = tuple(np.linspace(-6.0, 6.0, 1201))
_WHOLE = tuple(np.concatenate((np.linspace(-100.0, -6.0, 48), np.linspace(-5.0, 5.0, 41), np.linspace(6.0, 100.0, 48))))
_POINTS = 40_001
_SUPPLY_BAR, _TANK_BAR, _OIL_C = 70.0, 2.0, 40.0


def _read(bench: str, name: str, commands: tuple[float, ...], **conditions: float) -> Array:
    told: Mapping[str, Any] = tomllib.loads(benches()[bench].read_text(encoding="utf-8"))["simulation"]
    return curve(name, commands, tuple(sorted(conditions.items())), tuple(sorted(told.get("parameters", {}).items())))


def _dense(commands: tuple[float, ...], values: Array) -> tuple[Array, Array]:
    places = np.linspace(commands[0], commands[-1], _POINTS)
    return places, PchipInterpolator(commands, values)(places)


def of_pressure_gain(_clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The straight line through the blocked curve within ± 40 % of supply."""
    command, load = _dense(_NEAR, _read(bench, "load_pressure", _NEAR, load=0.0) / _SUPPLY_BAR * 100.0)
    body = np.abs(load) <= 40.0
    return {
        "pressure_gain": float(np.polyfit(command[body], load[body], 1)[0]),
        "pressure_null": float(np.interp(0.0, load, command)), "supply_pressure": _SUPPLY_BAR,
    }  # fmt: skip


def of_internal_leakage(_clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The largest return flow, the middle of its peak, and those at the ends."""
    near = tuple(np.linspace(-10.0, 10.0, 401))
    command, leak = _dense(near, _read(bench, "returned", near, load=0.0))
    above = command[leak >= 0.5 * (leak.max() + max(leak[0], leak[-1]))]
    low, high = _read(bench, "returned", (-100.0, 100.0), load=0.0)
    return {
        "leakage_peak": float(leak.max()), "leakage_peak_at": 0.5 * float(above[0] + above[-1]),
        "leakage_high": float(high), "leakage_low": float(low),
    }  # fmt: skip


def of_flow_over_pressure_drop(clean: Recording, bench: str, _situation: Situation) -> Truths:
    """Flow and drop at each supply pressure, and the straight line through their logarithms."""
    rated_bar = float(clean.meta["settings"]["rated_drop"])
    found: Truths = {}
    supplies = (35.0, 52.5, 70.0, 105.0, 140.0)
    for label, command in (("+100 %", 100.0), ("-100 %", -100.0)):
        flows, drops = _points(bench, command, supplies)
        for supply, flow, drop in zip(supplies, flows, drops, strict=True):
            found[f"flow, {label}, supply {supply:.4g} bar"] = flow
            found[f"pressure_drop, {label}, supply {supply:.4g} bar"] = drop
        exponent, level = np.polyfit(np.log(drops / rated_bar), np.log(np.abs(flows)), 1)
        found[f"flow_exponent, {label}"] = float(exponent)
        found[f"rated_flow, {label}"] = float(np.sign(command) * np.exp(level))
    return found


def of_limiting_power(_clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The largest of flow times drop; the flow of these edges rises as far as the supply does."""
    found: Truths = {}
    for command in (100.0, 50.0, -50.0, -100.0):
        flows, drops = _points(bench, command, tuple(np.linspace(17.5, 140.0, 8)))
        label, powers = f"{command:+.0f} %", np.abs(flows) * drops / 600.0
        found[f"limiting_power, {label}"] = float(powers.max())
        found[f"limiting_drop, {label}"] = float(drops[powers.argmax()])
        found[f"saturation_drop, {label}"] = float(drops[-1])
    return found


def _points(bench: str, command: float, supplies: tuple[float, ...]) -> tuple[Array, Array]:
    """Flow and valve pressure drop at each supply pressure."""
    names = ("flow", "load_pressure")
    read = np.array([[_read(bench, name, (command,), supply=supply)[0] for name in names] for supply in supplies])
    return read[:, 0], np.array(supplies) - _TANK_BAR - np.abs(read[:, 1])


def of_null_shift(_clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The null under each condition by the lines through 20 to 80 % of each side, and its slope over the condition."""
    ways = {
        "null_shift_supply": ("supply", "supply pressure {:.4g} bar", (56.0, 84.0), 0.1 * _SUPPLY_BAR),
        "null_shift_tank": ("tank", "tank pressure {:.4g} bar", (9.0,), 0.1 * _SUPPLY_BAR),
        "null_shift_temperature": ("oil_c", "oil temperature {:.4g} °C", (20.0, 60.0), 40.0),
    }
    usual = {"supply": _SUPPLY_BAR, "tank": _TANK_BAR, "oil_c": _OIL_C}
    stands = _null(bench)
    found: Truths = {"null, as the bench stands": stands}
    for figure, (condition, label, levels, change) in ways.items():
        nulls = [stands]
        for level in levels:
            nulls.append(_null(bench, **{condition: level}))
            found[f"null, {label.format(level)}"] = nulls[-1]
        found[figure] = float(np.polyfit([usual[condition], *levels], nulls, 1)[0]) * change
    return found


def of_load_step(clean: Recording, bench: str, _situation: Situation) -> Truths:
    """Flows at rest of the throttle as it closes and opens with its time constant, read by a meter of first order."""
    band, typical = float(clean.meta["settings"]["band"]) / 100.0, plant("four-way-valve").typical
    line_s, meter_s = typical["line_lag"], typical["sensor_lag"]
    loads = np.concatenate(([0.0], np.geomspace(0.01, 100.0, 60)))
    time_s = np.arange(0.0, 0.6, 2e-5)
    found: Truths = {}
    for command in (50.0, -50.0):
        flows, drops = (
            np.array([_read(bench, name, (command,), load=float(load))[0] for load in loads])
            for name in ("flow", "load_pressure")
        )
        for ends, throttle in (((100, 0), np.exp(-time_s / line_s)), ((0, 100), -np.expm1(-time_s / line_s))):
            flow = PchipInterpolator(np.sqrt(loads), flows)(np.sqrt(100.0 * throttle))
            keep = np.exp(-2e-5 / meter_s)
            read = lfilter([1.0 - keep], [1.0, -keep], flow - flow[0])
            label = f"{command:+.0f} %, load {ends[0]} → {ends[1]} %"
            outside = np.flatnonzero(np.abs(read - read[-1]) > band * np.abs(read).max())
            found[f"load_step, {label}"] = float(np.diff(drops[[0, -1]])[0] * np.sign(ends[1] - ends[0]))
            found[f"load_deviation, {label}"] = float(np.abs(read).max())
            found[f"load_settling, {label}"] = 1e3 * float(time_s[outside[-1] + 1])
            found[f"spool_deviation, {label}"] = 0.0
    return found


def _null(bench: str, **conditions: float) -> float:
    command, flow = _dense(_WHOLE, _read(bench, "flow", _WHOLE, **conditions))
    crossings = []
    for end in (flow[-1], flow[0]):
        body = (flow / end >= 0.2) & (flow / end <= 0.8)
        gain, level = np.polyfit(command[body], flow[body], 1)
        crossings.append(float(-level / gain))
    return float(np.mean(crossings))
