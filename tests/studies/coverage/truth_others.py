"""What the remaining procedures must find: parameters of the plant, and lines through the response without noise."""

from __future__ import annotations

import math
import tomllib
from collections import defaultdict

import numpy as np

from hil.bench.find import benches
from hil.record.recording import Recording
from tests.studies.coverage.situations import CLOSED, Situation
from tests.studies.coverage.truth_static import Truths


def of_velocity_steps(clean: Recording, _bench: str, _situation: Situation) -> Truths:
    """Slope between 10 % and 40 % of the way (closed loop), from 40 % of the time on (open loop)."""
    position = clean.values(clean.meta["roles"]["response"])
    speeds, places = defaultdict(list), defaultdict(dict)
    for part in clean.meta["parts"]:
        if part["kind"] != "velocity step":
            continue
        rows = slice(part["first"], part["first"] + part["count"])
        time_s, way = clean.time_s[rows] - clean.time_s[rows.start], position[rows]
        if part["closed"]:
            share = (way - way[0]) / (way[-len(way) // 20 :].mean() - way[0])
            kept = slice(int(np.argmax(share >= 0.1)), int(np.argmax(share >= 0.4)))
        else:
            kept = slice(round(0.4 * len(way)), len(way))
        speeds[part["label"]].append(float(np.polyfit(time_s[kept], way[kept], 1)[0]))
        places[part["place"]][bool(part["extending"])] = part["label"]
    means = {label: float(np.mean(values)) for label, values in speeds.items()}
    found: Truths = {f"speed, {label}": value for label, value in means.items()}
    for place, both in places.items():
        found[f"speed_ratio, {place}"] = abs(means[both[False]] / means[both[True]])
    return found


def of_cylinder_drift(clean: Recording, bench: str, situation: Situation) -> Truths:
    """A line through the position without noise; the restlessness is the sensor's noise."""
    told = tomllib.loads(benches()[bench].read_text(encoding="utf-8"))
    name = clean.meta["roles"]["response"]
    slope = float(told["channels"][name]["calibration"]["slope"])
    noise_v = float(told["devices"]["daq"]["noise_v"])
    noise = situation.noise * math.hypot(told["simulation"]["instruments"][name]["noise"], noise_v * slope)
    rounding = slope * 20.0 / 2.0**situation.bits / math.sqrt(12.0)
    unit = clean.channel(clean.meta["roles"]["command"]).unit
    found: Truths = {}
    for part in (part for part in clean.meta["parts"] if part["kind"] == "drift"):
        rows = slice(part["first"], part["first"] + part["count"])
        time_s, position = clean.time_s[rows], clean.values(name)[rows]
        rate, level = np.polyfit(time_s - time_s.mean(), position, 1)
        about = float(np.std(position - level - rate * (time_s - time_s.mean())))
        second = round(1.0 / clean.interval_s)
        means = position[: len(position) // second * second].reshape(-1, second).mean(axis=1)
        place = f"{part['level']:.4g} {unit}"
        found |= {
            f"drift_rate, {place}": 60.0 * float(rate), f"drift, {place}": float(np.ptp(means)),
            f"restlessness, {place}": math.hypot(about, noise, rounding),
        }  # fmt: skip
        if bench == CLOSED:
            found[f"offset, {place}"] = float(level) - part["level"]
    return found


def of_leakage_check(_clean: Recording, _bench: str, _situation: Situation) -> Truths:
    """80 ml/min at 220 psi; the closed valve leaves 2.5 psi behind it."""
    return {"leakage": 80.0, "supply_pressure": 220.0, "return_pressure": 2.5}


def of_electrical_check(clean: Recording, _bench: str, _situation: Situation) -> Truths:
    """2.1 Ω at 72 °F and 90 mH; temperature and voltage as they are read without noise."""
    (part,) = (part for part in clean.meta["parts"] if part["kind"] == "coil")
    rows = slice(part["first"], part["first"] + part["count"])  # the coil is colder on the way there
    warm_c = float(clean.values("coil temperature")[rows].mean())
    at_warm = 1.0 + 0.00393 * (warm_c - 20.0)
    at_reference = 1.0 + 0.00393 * ((72.0 - 32.0) / 1.8 - 20.0)
    current_a = float(clean.meta["settings"]["test_current"])
    return {
        "coil_resistance": 2.1, "coil_inductance": 90.0,
        "coil_temperature": warm_c, "test_voltage": 2.1 * at_warm / at_reference * current_a,
    }  # fmt: skip
