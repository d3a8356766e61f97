"""Channels sampled at different times on one even grid: where commands change, and where an output has no sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.identification.preparation.criteria import CRITERIA, EFFORT
from hil.record.recording import Array, Mask, Samples


def held_grid(given: Sequence[Samples], output_s: Array, from_s: float) -> tuple[Array, float]:
    """An even grid on which every command changes where it did, and its interval: the finest time base if that will do.

    Else one that is finer. It begins at `from_s`.
    """
    bases = [stamps for stamps in (output_s, *(one.time_s for one in given)) if _is_even(stamps)]
    fine = min(bases, key=lambda stamps: float(np.median(np.diff(stamps))), default=output_s)
    interval_s = float(np.median(np.diff(fine)))
    changes = np.concatenate([one.time_s[np.flatnonzero(np.diff(one.values)) + 1] for one in given])
    off = np.abs((changes - fine[0]) / interval_s - np.rint((changes - fine[0]) / interval_s))
    on_base = bool(bases) and bool(np.all(off < CRITERIA.on_grid))
    start, stop = np.float64(from_s), output_s[-1]
    if not on_base:
        interval_s /= EFFORT.grid_per_sample
    else:  # in step with the base
        start = fine[0] + interval_s * np.floor((start - fine[0]) / interval_s + CRITERIA.on_grid)
    count = int(np.ceil((stop - start) / interval_s - CRITERIA.on_grid)) + 1
    grid_s = start + interval_s * np.arange(count)
    return grid_s, interval_s


def _is_even(stamps: Array) -> bool:
    steps = np.diff(stamps)
    return len(steps) > 8 and bool(
        np.quantile(np.abs(steps - np.median(steps)), 0.8) <= CRITERIA.on_grid * np.median(steps)
    )


def missing_of_even(grid_s: Array, output_s: Array, interval_s: float) -> Mask | None:
    """Which places of the grid have no sample of an output that was sampled on it but for some; None for others."""
    at = np.rint((output_s - grid_s[0]) / interval_s).astype(np.intp)
    off = np.abs(grid_s[0] + at * interval_s - output_s) > CRITERIA.on_grid * interval_s
    slower = len(output_s) > 1 and float(np.median(np.diff(output_s))) > 1.5 * interval_s
    if off.any() or slower or len(output_s) == len(grid_s):
        return None
    missing = np.ones(len(grid_s), dtype=np.bool_)
    missing[at] = False
    return missing


def is_known_throughout(samples: Samples) -> bool:
    """Whether a command is known at every time: one sampled evenly has no hole, one kept at changes alone has none."""
    steps = np.diff(samples.time_s)
    return not _is_even(samples.time_s) or bool(steps.max() <= CRITERIA.gap * np.median(steps))
