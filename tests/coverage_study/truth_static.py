"""What sweeps must find: the static curves as their sources give them, read by the written definitions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from hil.record.recording import Array, Recording
from tests.coverage_study.score import Truth
from tests.coverage_study.situations import EFC, HPV41, Situation

Truths = dict[str, Truth]

_POINTS = 200_001
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

    lag_ms = 2.0 + 16.0 + 1e3 * 2.0 * 0.5 / 48.0 + 4.0 + _HALF_HOLD_MS
    coulomb = found.get("friction", {}).get("coulomb", 0.0)
    return Static(curve, 0.0, 2.2, lag_ms, coulomb, play=found.get("backlash", {}).get("half_width", 0.0))


def efc_drive(frictionless: bool, top: float) -> Static:
    """207 psi by the five steps of the thesis, a monotone cubic through them, 2.5 psi when closed."""
    through = PchipInterpolator(
        [1.1, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2], [0.0, 0.0005, 0.111, 0.565, 0.758, 1.0, 1.0], extrapolate=False
    )

    def curve(command: Array) -> Array:
        made: Array = 2.5 + 207.0 * np.nan_to_num(through(np.clip(command, 1.1, 2.2)))
        return made

    lag_ms = 2.0 + 1e3 / 250.0 + 8.0 + 1e3 * 2.0 * 3.14 / 187.0 + 4.0 + _HALF_HOLD_MS
    return Static(curve, 0.0, top, lag_ms, 0.0 if frictionless else 0.004)


def two_sided(static: Static) -> Truths:
    """Figures of `flow_curve` for a command that goes both ways from zero."""
    zero = float(static.curve(np.zeros(1))[0])
    ends = {side: float(static.curve(np.array([side * static.high]))[0]) for side in (1.0, -1.0)}
    gains, departures = {}, {}
    for side, end in ends.items():
        command = side * np.linspace(0.0, static.high, _POINTS)
        change = static.curve(command) - zero
        share = change / (end - zero)
        body = (share >= 0.3) & (share <= 0.9)
        gain, level = np.polyfit(command[body], change[body], 1)
        gains[side] = float(gain)
        departures[side] = float(np.max(np.abs(change[body] - gain * command[body] - level)) / abs(end - zero))
    return {
        "response_high": ends[1.0], "response_low": ends[-1.0],
        "hysteresis": _scaled(static.hysteresis, 100.0 / (static.high - static.low)),
        "dead_band_positive": 20.0, "dead_band_negative": -20.0,
        "gain_positive": gains[1.0], "gain_negative": gains[-1.0],
        "symmetry": min(gains.values()) / max(gains.values()), "linearity": 100.0 * max(departures.values()),
        "lag": static.lag_ms, "leakage": zero,
    }  # fmt: skip


def one_sided(static: Static) -> Truths:
    """Figures of `flow_curve` for a command that goes one way."""
    command = np.linspace(static.low, static.high, _POINTS)
    response = static.curve(command)
    half = float(np.interp((response[0] + response[-1]) / 2.0, response, command))
    return {
        "response_high": float(response[-1]), "response_low": float(response[0]),
        "hysteresis": _scaled(static.hysteresis, 100.0 / (static.high - static.low)),
        "command_half": half, "gain_largest": float(np.max(np.gradient(response, command))),
        "lag": static.lag_ms, "leakage": float(response[0]),
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


def of_pressure_current(_clean: Recording, bench: str, situation: Situation) -> Truths:
    """Of the acceptance bench, which has friction as installed."""
    return pressure(efc_drive(frictionless=bench in situation.effects, top=2.0))


def _scaled(truth: Truth, factor: float) -> Truth:
    return (truth[0] * factor, truth[1] * factor) if isinstance(truth, tuple) else truth * factor
