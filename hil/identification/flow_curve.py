"""The steady-state flow curve: dead band, hysteresis, symmetry, gain, linearity, leakage, and its description."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InputError
from hil.identification.sweep_branches import branches
from hil.record.recording import Array, Recording

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

_GAIN_FROM, _GAIN_TO = 0.3, 0.9  # share of the rated flow between which the gain is read
_NEIGHBOURS = 5
_CLEAR = 10.0  # times its standard uncertainty: flow that can be read
_FOOT_TO = 0.4  # and up to which the dead band's edge is read


@dataclass(frozen=True, slots=True)
class Number:
    """A value with its standard uncertainty and unit."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True, slots=True)
class FlowCurve:
    """Output over command, rising and falling sweeps apart, and the figures read from it.

    Attributes:
        command: levels at which both branches are known, rising, shape (n,).
        rising, falling: mean output there while the command rises and falls, shape (n,).
        std: standard uncertainty of the mean of both, shape (n,).
        dead_band_positive, dead_band_negative: command at which flow begins, on the nominal curve.
        hysteresis: largest width of the loop along the command, in % of the command's span.
        rated_positive, rated_negative: output at the ends of the command.
        symmetry: gain of the weaker side over that of the stronger.
        gain_positive, gain_negative: slope between 30 % and 90 % of the rated flow.
        linearity: largest departure from those lines, in % of rated flow.
        leakage: output at zero command.
    """

    command: Array
    rising: Array
    falling: Array
    std: Array
    dead_band_positive: Number
    dead_band_negative: Number
    hysteresis: Number
    rated_positive: Number
    rated_negative: Number
    symmetry: Number
    gain_positive: Number
    gain_negative: Number
    linearity: Number
    leakage: Number
    input_unit: str
    output_unit: str

    @property
    def nominal(self) -> Array:
        """Middle of the two branches, shape (n,)."""
        made: Array = (self.rising + self.falling) / 2.0
        return made


def flow_curve(recording: Recording, command_name: str, output_name: str, *, lag_s: float = 0.0) -> FlowCurve:
    """Read a flow curve from a sweep of the command up and down over its whole range.

    The dead-band edges are where a power law through the lower flows begins, which noise does not move as it
    moves a threshold.

    Args:
        recording: a sweep that passes every level at least once up and once down.
        command_name: the command's channel.
        output_name: the output's channel.
        lag_s: dead time and lag of the valve; the command is taken that much earlier, so that the sweep's own
            speed does not look like hysteresis.

    Raises:
        InputError: the command does not go both up and down over a range.
    """
    u, y = recording.channel(command_name), recording.channel(output_name)
    command = np.interp(recording.time_s - lag_s, recording.time_s, u.values)
    levels, rising, falling, std = branches(recording.name, command, y.values)
    nominal = (rising + falling) / 2.0
    zero = float(np.interp(0.0, levels, nominal))
    ends = float(command.max()), float(command.min())
    rated = {+1: _at_end(levels, nominal, ends[0]), -1: _at_end(levels[::-1], nominal[::-1], ends[1])}
    sides = {sign: _side(levels, nominal - zero, std, sign, rated[sign] - zero) for sign in (+1, -1)}
    gains = [abs(sides[sign].gain) for sign in (+1, -1)]
    weak = min(gains) / max(gains)
    relative = math.hypot(*(sides[sign].gain_std / abs(sides[sign].gain) for sign in (+1, -1)))
    noise = float(np.median(std))
    unit = f"[{y.unit}]/[{u.unit}]"
    return FlowCurve(
        levels, rising, falling, std,
        Number(sides[+1].edge, sides[+1].edge_std, u.unit),
        Number(sides[-1].edge, sides[-1].edge_std, u.unit),
        _hysteresis(levels, rising, falling, std),
        Number(rated[+1], float(std[-1]), y.unit),
        Number(rated[-1], float(std[0]), y.unit),
        Number(weak, weak * relative, "1"),
        Number(sides[+1].gain, sides[+1].gain_std, unit),
        Number(sides[-1].gain, sides[-1].gain_std, unit),
        _linearity(sides, rated, noise),
        Number(zero, noise, y.unit),
        u.unit, y.unit,
    )  # fmt: skip


def polynomial(command: Array, flow: Array, degree: int = 9) -> Callable[[Array], Array]:
    """The least-squares polynomial of a flow curve, as the HPV41 paper describes it (degree 9).

    A polynomial cannot lie flat in a dead band: it ripples there, and its slope changes sign. For simulation
    use `spline`.
    """
    fitted = np.polynomial.Polynomial.fit(command, flow, degree)

    def curve(values: Array) -> Array:
        return np.asarray(fitted(values), dtype=np.float64)

    return curve


def spline(command: Array, flow: Array) -> PchipInterpolator:
    """The monotone cubic through a flow curve (PCHIP): flat where the data are flat, never overshooting."""
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(command, np.maximum.accumulate(flow))


@dataclass(frozen=True, slots=True)
class _Side:
    edge: float
    edge_std: float
    gain: float
    gain_std: float
    departure: float


def _at_end(levels: Array, nominal: Array, end: float) -> float:
    """The curve carried on from the middle of its last bin to the end of the sweep."""
    slope = (nominal[-1] - nominal[-2]) / (levels[-1] - levels[-2])
    return float(nominal[-1] + slope * (end - levels[-1]))


def _side(levels: Array, flow: Array, std: Array, sign: int, rated: float) -> _Side:
    """Edge of the dead band, gain and departure from a line, on one side."""
    if abs(rated) < _CLEAR * float(np.median(std)):
        raise InputError(f"flow curve: at the {'positive' if sign > 0 else 'negative'} end no flow beyond the noise")
    share = flow / rated
    mine = sign * levels > 0.0
    body = mine & (share > _GAIN_FROM) & (share < _GAIN_TO)
    foot = mine & (share < _FOOT_TO)
    if body.sum() < 4 or foot.sum() < 4:
        raise InputError("flow curve: too few levels carry flow on one side of centre")
    edge, edge_std = _edge(sign * levels[foot], share[foot], std[foot] / abs(rated))
    (gain, _), covariance = np.polyfit(levels[body], flow[body], 1, cov=True)
    line = flow[body].mean() + gain * (levels[body] - levels[body].mean())
    departure = float(np.max(np.abs(flow[body] - line)))
    return _Side(sign * edge, edge_std, float(gain), math.sqrt(covariance[0, 0]), departure)


def _edge(opening: Array, share: Array, std: Array) -> tuple[float, float]:
    """Where a power law through the foot of the curve begins, with its uncertainty."""
    from scipy.optimize import least_squares

    weight = 1.0 / np.maximum(std, 1e-4)
    top = float(opening.max())

    def residuals(p: Array) -> Array:
        over = np.maximum((opening - p[0]) / (top - p[0]), 0.0)
        made: Array = (p[2] * over ** p[1] - share) * weight
        return made

    flowing = float(opening[np.argmax(share > 0.02)]) if np.any(share > 0.02) else 0.0
    found = least_squares(
        residuals, [min(flowing, 0.9 * top), 1.2, float(share.max())],
        bounds=([0.0, 0.3, 0.0], [0.98 * top, 5.0, 2.0]), x_scale=[top, 1.0, 1.0],
    )  # fmt: skip
    dof = max(len(opening) - 3, 1)
    slopes = np.asarray(found.jac, dtype=np.float64)
    covariance = np.linalg.pinv(slopes.T @ slopes) * max(1.0, 2.0 * found.cost / dof)
    return float(found.x[0]), math.sqrt(float(covariance[0, 0]))


def _hysteresis(levels: Array, rising: Array, falling: Array, std: Array) -> Number:
    """Widest distance of the branches along the command, in % of its span, where the curve has a slope."""
    nominal = (rising + falling) / 2.0
    slope = np.gradient(nominal, levels)
    steep = np.abs(slope) > 0.3 * float(np.median(np.abs(slope[np.abs(slope) > 0.1 * np.abs(slope).max()])))
    span = float(np.ptp(levels))
    # a mean over neighbours, because the largest of many noisy widths is too large
    distance = np.abs(np.convolve(falling - rising, np.full(_NEIGHBOURS, 1.0 / _NEIGHBOURS), mode="same"))
    width = distance[steep] / np.abs(slope[steep])
    widest = int(np.argmax(width))
    error = 2.0 * std[steep][widest] / abs(float(slope[steep][widest])) / math.sqrt(_NEIGHBOURS)
    return Number(100.0 * float(width[widest]) / span, 100.0 * error / span, "%")


def _linearity(sides: dict[int, _Side], rated: dict[int, float], noise: float) -> Number:
    worst = max((+1, -1), key=lambda sign: sides[sign].departure / abs(rated[sign]))
    size = abs(rated[worst])
    return Number(100.0 * sides[worst].departure / size, 100.0 * noise / size, "%")
