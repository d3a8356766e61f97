"""What sweeps must find: the static curves as their sources give them, read by the written definitions."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from hil.bench.find import benches
from hil.record.recording import Array, Recording
from tests.studies.coverage.score import Truth, ends
from tests.studies.coverage.situations import EFC, HPV41, Situation

Truths = dict[str, Truth]

_POINTS = 200_001
_COUNTED_L_MIN = (0.005, 0.5)  # what three standard uncertainties may come to, from little noise to coarse codes
_HALF_HOLD_MS = 0.5  # a command held for a millisecond comes half of it late


@dataclass(frozen=True)
class Static:
    """A static curve and what delays it.

    Attributes:
        curve: response over command. `low`, `high`: ends of the command.
        lag_ms: all delays from the command to the reading together, half a hold included.
        coulomb, stiction: half the widths of the loop that friction makes, sliding and sticking; 0 for none.
        play: half the width that backlash makes.
    """

    curve: Callable[[Array], Array]
    low: float
    high: float
    lag_ms: float
    coulomb: float = 0.0
    stiction: float = 1.2
    play: float = 0.0
    saturated: float = 100.0

    @property
    def short_of_ends(self) -> tuple[float, ...]:
        """By how much the valve may stop before where the command waits, at least and at most."""
        return (0.0, self.coulomb * self.stiction) if self.coulomb else (self.play,)

    @property
    def hysteresis(self) -> Truth:
        """Width of the loop along the command: any that friction has between sliding and sticking."""
        if self.coulomb:
            return 2.0 * self.coulomb, 2.0 * self.coulomb * self.stiction
        return 2.0 * self.play


def hpv41(situation: Situation) -> Static:
    """Overlap of 20 %, then 70 l/min at the end by a power of 1.2 (Tørdal, Klausen, Bak)."""
    found = {effect.name: effect.parameters for effect in situation.effects.get(HPV41, ())}
    leak = found.get("leakage", {}).get("leak", 0.0)

    def curve(command: Array) -> Array:
        over = np.maximum(np.abs(command) - 20.0, 0.0) / 80.0
        made: Array = np.sign(command) * 70.0 * over**1.2 + leak * np.exp(-0.5 * np.abs(command) / 100.0)
        return made

    lag_ms = 20.0 + 1e3 / 7.0 + 1e3 * 2.0 * 0.5 / 33.0 + 8.0 + _HALF_HOLD_MS
    coulomb = found.get("friction", {}).get("coulomb", 0.0)
    return Static(curve, -100.0, 100.0, lag_ms, coulomb, play=found.get("backlash", {}).get("half_width", 0.0))


def efc(situation: Situation) -> Static:
    """207 psi by a logistic transition 0.1 A wide about 1.58 A, 3 psi when closed."""
    found = {effect.name: effect.parameters for effect in situation.effects.get(EFC, ())}

    def curve(command: Array) -> Array:
        made: Array = 3.0 + 207.0 / (1.0 + np.exp(-(command - 1.58) / 0.1))
        return made

    # the current loop of 500 rad/s reads the mean of the period before: a ramp runs ahead of it by the rest of 2 ms
    drive_ms = 1e3 / 500.0 - 1e3 / 1000.0
    lag_ms = drive_ms + 2.0 + 16.0 + 1e3 * 2.0 * 0.5 / 48.0 + 4.0 + _HALF_HOLD_MS
    coulomb = found.get("friction", {}).get("coulomb", 0.0)
    return Static(curve, 0.0, 2.2, lag_ms, coulomb, play=found.get("backlash", {}).get("half_width", 0.0))


def efc_drive(coulomb: float, top: float) -> Static:
    """207 psi by the five steps of the thesis, a monotone cubic through them, 2.5 psi when closed."""
    through = PchipInterpolator(
        [1.1, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2], [0.0, 0.0005, 0.111, 0.565, 0.758, 1.0, 1.0], extrapolate=False
    )

    def curve(command: Array) -> Array:
        made: Array = 2.5 + 207.0 * np.nan_to_num(through(np.clip(command, 1.1, 2.2)))
        return made

    lag_ms = 2.0 + 1e3 / 250.0 + 8.0 + 1e3 * 2.0 * 3.14 / 187.0 + 4.0 + _HALF_HOLD_MS
    return Static(curve, 0.0, top, lag_ms, coulomb)


def two_sided(static: Static) -> Truths:
    """Figures of `flow_curve` for a command that goes both ways from zero."""
    found = [_two_sided(static, short) for short in static.short_of_ends]
    return {name: _between([truths[name] for truths in found]) for name in found[0]}


def _two_sided(static: Static, short: float) -> Truths:
    """The same where the valve stops by `short` before where the command waits."""
    zero = float(static.curve(np.zeros(1))[0])
    last = {side: float(static.curve(np.array([side * (static.high - short)]))[0]) for side in (1.0, -1.0)}
    gains, departures = {}, {}
    for side, end in last.items():
        command = side * np.linspace(0.0, static.high, _POINTS)
        change = static.curve(command) - zero
        share = change / (end - zero)
        body = (share >= 0.3) & (share <= 0.9)
        gain, level = np.polyfit(command[body], change[body], 1)
        gains[side] = float(gain)
        departures[side] = float(np.max(np.abs(change[body] - gain * command[body] - level)) / abs(end - zero))
    return {
        "response_high": last[1.0], "response_low": last[-1.0],
        "hysteresis": _scaled(static.hysteresis, 100.0 / (static.high - static.low)),
        "dead_band_positive": 20.0, "dead_band_negative": -20.0,
        "gain_positive": gains[1.0], "gain_negative": gains[-1.0],
        "symmetry": min(gains.values()) / max(gains.values()), "linearity": 100.0 * max(departures.values()),
        "lag": static.lag_ms, "leakage": zero, "polarity": 1.0, **_null(static, last),
    }  # fmt: skip


def _null(static: Static, last: Mapping[float, float]) -> Truths:
    """Null bias and lap by the lines through 20 to 80 % of each side; the curve is flat from nowhere on."""
    crossings = {}
    for side, end in last.items():
        command = side * np.linspace(0.0, static.high, _POINTS)
        response = static.curve(command)
        body = (response / end >= 0.2) & (response / end <= 0.8)
        gain, level = np.polyfit(command[body], response[body], 1)
        crossings[side] = float(-level / gain)
    return {
        "null_bias": (crossings[1.0] + crossings[-1.0]) / 2.0,
        "lap": crossings[1.0] - crossings[-1.0],
        "saturation_positive": (static.saturated, math.inf),
        "saturation_negative": (-math.inf, -static.saturated),
    }


def _between(truths: list[Truth]) -> Truth:
    """Everything between them."""
    low, high = min(ends(truth)[0] for truth in truths), max(ends(truth)[1] for truth in truths)
    return low if low == high else (low, high)


def one_sided(static: Static) -> Truths:
    """Figures of `flow_curve` for a command that goes one way."""
    found = [_one_sided(static, short) for short in static.short_of_ends]
    return {name: _between([truths[name] for truths in found]) for name in found[0]}


def _one_sided(static: Static, short: float) -> Truths:
    command = np.linspace(static.low, static.high, _POINTS)
    response = static.curve(command)
    low, high = (float(static.curve(np.array([at]))[0]) for at in (static.low + short, static.high - short))
    return {
        "response_high": high, "response_low": low,
        "hysteresis": _scaled(static.hysteresis, 100.0 / (static.high - static.low)),
        "command_half": float(np.interp((low + high) / 2.0, response, command)),
        "gain_largest": float(np.max(np.gradient(response, command))),
        "lag": static.lag_ms, "leakage": float(response[0]), "polarity": 1.0,
    }  # fmt: skip


def pressure(static: Static) -> Truths:
    """Figures of `pressure_current`."""
    found = one_sided(static)
    points = {f"pressure, {at:g} A": float(static.curve(np.array([at]))[0]) for at in (1.2, 1.4, 1.6, 1.8, 2.0)}
    response = static.curve(np.array([static.low, static.high]))
    return {
        "pressure_span": float(response[1] - response[0]), **points,
        "hysteresis": _scaled(static.hysteresis, 1e3), "lag": static.lag_ms,
        "current_half": found["command_half"], "slope_largest": found["gain_largest"],
    }  # fmt: skip


def of_flow_curve(_clean: Recording, bench: str, situation: Situation) -> Truths:
    """By the bench."""
    return two_sided(hpv41(situation)) if bench == HPV41 else one_sided(efc(situation))


def of_threshold(clean: Recording, _bench: str, situation: Situation) -> Truths:
    """What moves the response by any change that noise may let count, after each stop of the run without noise."""
    late, flow, command = hpv41(situation).lag_ms / 1e3, clean.values("flow"), clean.values("command")
    found: dict[str, list[tuple[Array, Array]]] = {}
    for part in clean.meta["parts"]:
        if part.get("way") in ("onward", "reversal"):
            at, stop = part["first"] + part["waited"], part["first"] + part["count"]
            change = np.abs(command[at:stop] - command[at - 1])
            moved = np.maximum.accumulate(np.abs(flow[at:stop] - flow[at - 1]))
            speed = float(change[-1]) / (stop - at) / clean.interval_s
            found.setdefault(f"threshold_{part['way']}, {part['label']}", []).append((change - speed * late, moved))
    return {name: _moved_by(rows) for name, rows in found.items()}


def _moved_by(rows: list[tuple[Array, Array]]) -> Truth:
    change, moved = np.mean([c for c, _ in rows], axis=0), np.mean([m for _, m in rows], axis=0)
    low, high = (float(np.interp(counted, moved, change)) for counted in _COUNTED_L_MIN)
    return max(low, 0.0), high


def of_pressure_current(_clean: Recording, bench: str, situation: Situation) -> Truths:
    """Of the acceptance bench, which has friction as installed."""
    told = tomllib.loads(benches()[bench].read_text(encoding="utf-8"))
    own = {effect["name"]: effect["parameters"] for effect in told["simulation"].get("effects", ())}
    coulomb = 0.0 if bench in situation.effects else float(own.get("friction", {}).get("coulomb", 0.0))
    return pressure(efc_drive(coulomb, top=2.0))


def _scaled(truth: Truth, factor: float) -> Truth:
    return (truth[0] * factor, truth[1] * factor) if isinstance(truth, tuple) else truth * factor
