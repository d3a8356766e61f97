"""Sensor lag: the instrument follows late, with one time constant or two."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, state: Any, keep: float, keep_second: float) -> float:
    """Two first-order lags in a row; the second may be instant."""
    state[0] = keep * state[0] + (1.0 - keep) * value
    state[1] = keep_second * state[1] + (1.0 - keep_second) * state[0]
    return state[1]


def coefficients(parameters: Mapping[str, float], step_s: float) -> dict[str, float]:
    """The shares of the old values that stay over one sub-step."""
    lag = parameters["lag"]
    return {"keep": _kept(lag, step_s), "keep_second": _kept(parameters["second"] * lag, step_s)}


def _kept(lag_s: float, step_s: float) -> float:
    return math.exp(-step_s / lag_s) if lag_s > 1e-9 else 0.0


def starts(_seen: Seen) -> list[dict[str, float]]:
    """From milliseconds to a tenth of a second, of first and of second order."""
    return [{"lag": lag, "second": second} for lag in (0.004, 0.012, 0.035, 0.1) for second in (0.0, 0.5)]


EFFECT = Effect(
    name="sensor_lag",
    title="lag of the sensor",
    hooks=("sensor", "recorder"),
    parameters=(
        EffectParameter("lag", "s", 0.0, 0.01, 0.0, 0.5, "time constant"),
        EffectParameter("second", "1", None, 0.0, 0.0, 1.0, "a second time constant, as a share of the first"),
    ),
    transform=transform,
    starts=starts,
    memory=lambda _parameters, _step_s: 2,
    coefficients=coefficients,
    equation="(T·s + 1)·(r·T·s + 1)·y = u",
    signature="phase and gain fall with frequency, no distortion; an inner signal such as spool position is on time",
    source="Doebelin: Measurement Systems, ch. 3",
    sentence="The instrument, not the valve, is slow: it follows with a time constant of {lag}.",
)
