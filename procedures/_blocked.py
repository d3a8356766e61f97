"""Sweeps of the command with the ports A and B blocked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hil.rig import Rig
from procedures._conditions import LOAD, adjusted, adjusting_s
from procedures._run_sequence import RunSequence, joined, sweep, sweep_part
from procedures._scale import Scale


@dataclass(frozen=True, slots=True)
class BlockedSweep:
    """A sweep from `bottom` to `top`, in the unit of the command, and back in `cycle_s`; `text` says which."""

    bottom: float
    top: float
    cycle_s: float
    text: str


def drive_blocked(
    rig: Rig, scale: Scale, sweeps: Sequence[BlockedSweep], kind: str, plan: Mapping[str, Any], warm_up_s: float,
    rate_hz: float,
) -> None:  # fmt: skip
    """Block the ports, drive sweeps as parts of a kind, and open the ports again.

    The bench has an output that adjusts the load orifice; `warm_up_s` is spent where the first sweep begins.

    Raises:
        RangeError: a sweep would leave the envelope; nothing has moved.
    """
    blocked = {LOAD: rig.adjustable[LOAD].low}
    paths = [sweep(rig, one.bottom, one.top, one.cycle_s, rate_hz) for one in sweeps]
    sequence = RunSequence(rig, rate_hz, joined(rig, rate_hz, warm_up_s, paths), plan, adjusting_s(rig, [blocked]))
    with adjusted(rig, blocked, rate_hz):
        sequence.warm_up(sweeps[0].bottom, warm_up_s)
        for path, one in zip(paths, sweeps, strict=True):
            sequence.go_to(one.bottom)
            part = {"kind": kind, **sweep_part(rig, scale, one.bottom, one.top, one.cycle_s)}
            sequence.play(path, f"ports blocked, {one.text}", part)
        sequence.finish()
