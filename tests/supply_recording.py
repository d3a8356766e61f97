"""Recordings of commands of ± 100 % at several supply pressures, by formula: 2 bar in the tank line, 3 at the load."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hil.record.recording import Channel, Recording
from procedures._supplies import KIND

_COUNT = 800


def supply_recording(
    flow: Callable[[float], float], supplies: Sequence[float], seed: int = 0, uncertainty: float = 0.0,
    off: float = 0.0, rated: float = 70.0,
) -> Recording:  # fmt: skip
    """`flow` of a valve pressure drop at + 100 %; a gauge of the supply that is off, as its calibration allows."""
    rng, count = np.random.default_rng(seed), _COUNT
    rows = [(sign, supply) for supply in supplies for sign in (1.0, -1.0)]
    parts = [
        {
            "kind": KIND, "label": f"{100 * sign:+.0f} %", "supply": f"supply {supply:g} bar", "first": k * count,
            "count": count, "start_s": k * count / 200.0, "stop_s": ((k + 1) * count - 1) / 200.0,
        }
        for k, (sign, supply) in enumerate(rows)
    ]  # fmt: skip

    def read(name: str, unit: str, values: list[float], noise: float, known: float = 0.0) -> Channel:
        samples = np.repeat(values, count) + noise * rng.normal(size=count * len(values))
        return Channel(name, unit, samples, calibration={"uncertainty": known} if known else {})

    channels = {
        "command": read("command", "%", [100.0 * sign for sign, _ in rows], 0.0),
        "flow": read("flow", "l/min", [sign * flow(supply - 5.0) for sign, supply in rows], 0.05),
        "supply pressure": read("supply pressure", "bar", [supply + off for _, supply in rows], 0.2, uncertainty),
        "return pressure": read("return pressure", "bar", [2.0] * len(rows), 0.02),
        "load pressure": read("load pressure", "bar", [3.0 * sign for sign, _ in rows], 0.2),
    }
    meta = {"roles": {"command": "command", "response": "flow"}, "parts": parts, "conditions": {},
            "settings": {"rated_drop": rated}}  # fmt: skip
    return Recording("run", np.arange(count * len(rows)) / 200.0, channels, meta)
