"""Recordings of sweeps by formula: a command up and down with waits at its ends, and what channels read then."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hil.record.recording import Array, Channel, Recording

RATE_HZ = 200.0


def swept_recording(
    kind: str,
    sweeps: Sequence[tuple[float, float, float]],
    channels: Mapping[str, tuple[str, Callable[[Array, int], Array], float]],
    more: Sequence[Mapping[str, Any]] = (),
    seed: int = 0,
) -> Recording:
    """Sweeps of (bottom, top, time up and down in s), each a part of `kind` with what `more` says of it.

    `channels`: unit, reading over the command in sweep k, and noise, by name. The response is the first.
    """
    rng = np.random.default_rng(seed)
    pieces, parts, first = [], [], 0
    for k, (bottom, top, cycle_s) in enumerate(sweeps):
        up, wait = np.linspace(bottom, top, round(cycle_s / 2.0 * RATE_HZ) + 1), np.full(60, 1.0)
        pieces.append(np.concatenate(([bottom], up[1:], top * wait, up[-2::-1], bottom * wait)))
        parts.append({
            "kind": kind, "cycle_s": cycle_s, "speed_per_s": 2.0 * (top - bottom) / cycle_s, "settling_s": 0.2,
            "neutral": 0.0, "span": top - bottom, "full": 100.0, "first": first, "count": len(pieces[-1]),
            "start_s": first / RATE_HZ, "stop_s": (first + len(pieces[-1]) - 1) / RATE_HZ, **(more[k] if more else {}),
        })  # fmt: skip
        first += len(pieces[-1])
    read = {"command": Channel("command", "%", np.concatenate(pieces))}
    for name, (unit, of, noise) in channels.items():
        values = np.concatenate([of(piece, k) for k, piece in enumerate(pieces)])
        read[name] = Channel(name, unit, values + noise * rng.normal(size=first))
    roles = {"command": "command", "response": next(iter(channels)), "oil temperature": "oil temperature"}
    return Recording("run", np.arange(first) / RATE_HZ, read, {"roles": roles, "parts": parts, "conditions": {}})
