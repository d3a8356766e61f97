"""What tests under adjusted conditions must find: a simulator of another structure, read by the written definitions."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.interpolate import PchipInterpolator

from hil.bench.file import Bench
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.physics.compose import plant
from hil.record.recording import Array, Recording
from hil.signals.recursion import filtered
from tests import four_way_simulator, hpv41_lab_simulator
from tests.studies.coverage.situations import Situation
from tests.studies.coverage.truth_static import Truths

_WHOLE = tuple(np.concatenate((np.linspace(-100.0, -6.0, 48), np.linspace(-5.0, 5.0, 41), np.linspace(6.0, 100.0, 48))))
_POINTS = 40_001
_SATURATED = 0.25  # slope of log flow over log drop below which a flow rises no further
_TANK_BAR, _OIL_C = 2.0, 40.0
_SIMULATORS = {"four-way-valve": four_way_simulator, "hpv41-loaded": hpv41_lab_simulator}


@cache
def _bench(name: str) -> Bench:
    return read_bench(benches()[name]).bench


def _supply_bar(bench: str) -> float:
    return float(_bench(bench).channels["supply setting"].on or 0.0)


def _read(bench: str, name: str, commands: tuple[float, ...], **conditions: float) -> Array:
    told = _bench(bench)
    simulator, changed = _SIMULATORS[told.valve.plant], told.simulation.get("parameters", {})
    given = {"supply": _supply_bar(bench), **conditions}
    found: Array = simulator.curve(name, commands, tuple(sorted(given.items())), tuple(sorted(changed.items())))
    return found


def _dense(commands: tuple[float, ...], values: Array) -> tuple[Array, Array]:
    places = np.linspace(commands[0], commands[-1], _POINTS)
    return places, PchipInterpolator(commands, values)(places)


def of_pressure_gain(clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The straight line through the blocked curve within ± 40 % of supply."""
    supply_bar, reach = _supply_bar(bench), float(clean.meta["settings"]["reach"])
    near = tuple(np.linspace(-reach, reach, 2001))
    command, load = _dense(near, _read(bench, "load_pressure", near, load=0.0) / supply_bar * 100.0)
    body = np.abs(load) <= 40.0
    return {
        "pressure_gain": float(np.polyfit(command[body], load[body], 1)[0]),
        "pressure_null": float(np.interp(0.0, load, command)), "supply_pressure": supply_bar,
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
    supplies = tuple(_supply_bar(bench) * share for share in (0.5, 0.75, 1.0, 1.5, 2.0))
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
    """The largest of flow times drop; a flow that rises as far as the supply does saturates nowhere."""
    found: Truths = {}
    for command in (100.0, 50.0, -50.0, -100.0):
        flows, drops = _points(bench, command, tuple(_supply_bar(bench) * np.linspace(0.25, 2.0, 8)))
        label, powers = f"{command:+.0f} %", np.abs(flows) * drops / 600.0
        found[f"limiting_power, {label}"] = float(powers.max())
        found[f"limiting_drop, {label}"] = float(drops[powers.argmax()])
        found[f"saturation_drop, {label}"] = float(drops[-1])
        if np.diff(np.log(np.abs(flows[-2:]))) < _SATURATED * np.diff(np.log(drops[-2:])):
            flows, drops = _points(bench, command, tuple(np.geomspace(5.0, 2.0 * _supply_bar(bench), 400)))
            steep = np.diff(np.log(np.abs(flows))) >= _SATURATED * np.diff(np.log(drops))
            found[f"saturation_drop, {label}"] = float(drops[np.flatnonzero(steep)[-1] + 1])
    return found


def _points(bench: str, command: float, supplies: tuple[float, ...]) -> tuple[Array, Array]:
    """Flow and valve pressure drop at each supply pressure."""
    names = ("flow", "load_pressure")
    read = np.array([[_read(bench, name, (command,), supply=supply)[0] for name in names] for supply in supplies])
    return read[:, 0], np.array(supplies) - _TANK_BAR - np.abs(read[:, 1])


def of_null_shift(_clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The null under each condition by the lines through 20 to 80 % of each side, and its slope over the condition."""
    supply_bar = _supply_bar(bench)
    lower, higher, tank = 0.8 * supply_bar, 1.2 * supply_bar, _TANK_BAR + 0.1 * supply_bar
    ways = {
        "null_shift_supply": ("supply", "supply pressure {:.4g} bar", (lower, higher), 0.1 * supply_bar),
        "null_shift_tank": ("tank", "tank pressure {:.4g} bar", (tank,), 0.1 * supply_bar),
        "null_shift_temperature": ("oil_c", "oil temperature {:.4g} °C", (20.0, 60.0), 40.0),
    }
    usual = {"supply": supply_bar, "tank": _TANK_BAR, "oil_c": _OIL_C}
    stands = _null(bench)
    found: Truths = {"null, as the bench stands": stands}
    for figure, (condition, label, levels, change) in ways.items():
        nulls = [stands]
        for level in levels:
            nulls.append(_null(bench, **{condition: level}))
            found[f"null, {label.format(level)}"] = nulls[-1]
        found[figure] = float(np.polyfit([usual[condition], *levels], nulls, 1)[0]) * change
    for label, end in (("high", 100.0), ("low", -100.0)):
        flows = [_read(bench, "flow", (end,), oil_c=oil)[0] for oil in (20.0, 40.0, 60.0)]
        found[f"flow_shift_temperature, {label}"] = float(np.polyfit([20.0, 40.0, 60.0], flows, 1)[0]) * 40.0
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
            read = filtered([1.0 - keep], [1.0, -keep], flow - flow[0])
            label = f"{command:+.0f} %, load {ends[0]} → {ends[1]} %"
            outside = np.flatnonzero(np.abs(read - read[-1]) > band * np.abs(read).max())
            found[f"load_step, {label}"] = float(np.diff(drops[[0, -1]])[0] * np.sign(ends[1] - ends[0]))
            found[f"load_deviation, {label}"] = float(np.abs(read).max())
            found[f"load_settling, {label}"] = 1e3 * float(time_s[outside[-1] + 1])
            found[f"spool_deviation, {label}"] = 0.0
    return found


def of_proof_pressure(clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The pressure as it was asked for, the leakage at neutral, and that nothing gives way."""
    share = 0.01 * float(clean.meta["settings"]["pressure"])
    leak = float(_read(bench, "returned", (0.0,), load=0.0)[0])
    return {"proof_pressure": share * _supply_bar(bench), "leakage_before": leak, "leakage_change": 0.0}


def of_compensated_load_step(clean: Recording, bench: str, _situation: Situation) -> Truths:
    """Meter and spool as an integrator has them, while the throttle closes and opens with its time constant."""
    band = float(clean.meta["settings"]["band"]) / 100.0
    valve = hpv41_lab_simulator.Valve(**_bench(bench).simulation.get("parameters", {}))
    time_s = np.arange(0.0, 2.0, 1e-4)
    found: Truths = {}
    for command in (50.0, -50.0):
        for start, end in ((100.0, 0.0), (0.0, 100.0)):
            label = f"{command:+.0f} %, load {start:.0f} → {end:.0f} %"
            ends = [_read(bench, "load_pressure", (command,), load=one)[0] for one in (start, end)]
            found[f"load_step, {label}"] = float(ends[1] - ends[0])
            seen = valve.load_step(command, start, end, time_s, _supply_bar(bench), _TANK_BAR)
            for read, name in zip(seen, ("load", "spool"), strict=True):
                away = read - read[0]
                outside = np.flatnonzero(np.abs(away - away[-1]) > band * np.abs(away).max())
                found[f"{name}_deviation, {label}"] = float(np.abs(away).max())
                found[f"{name}_settling, {label}"] = 1e3 * float(time_s[outside[-1] + 1])
    return found


def _null(bench: str, **conditions: float) -> float:
    command, flow = _dense(_WHOLE, _read(bench, "flow", _WHOLE, **conditions))
    crossings = []
    for end in (flow[-1], flow[0]):
        body = (flow / end >= 0.2) & (flow / end <= 0.8)
        gain, level = np.polyfit(command[body], flow[body], 1)
        crossings.append(float(-level / gain))
    return float(np.mean(crossings))
