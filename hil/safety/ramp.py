"""The way to the safe values: down a ramp where the valve asks for one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from hil.arrays import ROUNDING
from hil.daq.contract import Waveform


def way_to(
    targets: Mapping[str, float],
    levels: Mapping[str, float],
    slew_per_s: Mapping[str, float],
    rate_hz: float,
    order: Sequence[str] = (),
) -> Waveform | None:
    """A waveform that brings outputs from where they stand to their targets; None when they are there.

    Args:
        targets: where to, by output.
        levels: where they stand.
        slew_per_s: how fast each may go; those not named jump.
        rate_hz: sample rate.
        order: outputs that go one after another; the others begin at once.

    Each output goes straight and stays at its target when it is there before the others.
    """
    moving = {name: target for name, target in targets.items() if levels[name] != target}
    if not moving:
        return None
    steps = {name: _steps(target - levels[name], slew_per_s.get(name, math.inf) / rate_hz)
             for name, target in moving.items()}  # fmt: skip
    begins, begin = dict.fromkeys(moving, 0), 0
    for name in order:
        if name in moving:
            begins[name], begin = begin, begin + steps[name]
    count = np.arange(1, max(begins[name] + steps[name] for name in moving) + 1)
    paths = {}
    for name, target in moving.items():
        left = np.clip(begins[name] + steps[name] - count, 0, steps[name]) / steps[name]
        paths[name] = target + (levels[name] - target) * left
    return Waveform(rate_hz, paths)


def _steps(distance: float, step: float) -> int:
    return max(1, math.ceil(abs(distance) / step - ROUNDING))
