"""Stretches of a recording in which the misfit is far beyond the noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.diagnose.problem import Problem
from hil.diagnose.runs import runs
from hil.diagnose.search.fitted import Fitted
from hil.record.recording import Array

BLOCK_S = 0.1  # so long is a block that is far beyond the noise, or not
_BURST = 4.0  # times the noise variance
_SPARSE_SHARE, _SPARSE_TIME = 0.6, 0.45

Burst = tuple[int, int]
"""First sample, and the one behind the last."""


def all_bursts(problem: Problem, around: Fitted) -> list[list[Burst]]:
    """The bursts of every experiment."""
    return [bursts_of(problem, around.residuals, k) for k in range(len(problem.experiments))]


def bursts_of(problem: Problem, residuals: Array, k: int) -> list[Burst]:
    """(first, last) samples of stretches in which the misfit is far beyond the noise."""
    part, e = residuals[problem.output_slices()[k]], problem.experiments[k]
    size = max(2, round(BLOCK_S / e.drive.interval_s))
    blocks = len(part) // size
    power = np.mean(part[: blocks * size].reshape(blocks, size) ** 2, axis=1)
    merged: list[Burst] = []
    for start, stop in runs(power > _BURST):
        if merged and start - merged[-1][1] <= 1:
            merged[-1] = merged[-1][0], stop
        else:
            merged.append((start, stop))
    return [(start * size, stop * size) for start, stop in merged]


def is_sparse(problem: Problem, residuals: Array, bursts: Sequence[Sequence[Burst]]) -> bool:
    """Whether most of the misfit of the output lies in a small part of the time."""
    inside, beyond, time, whole = 0.0, 0.0, 0, 0
    for part, own in zip(problem.output_slices(), bursts, strict=True):
        r = residuals[part]
        beyond += float(r @ r) - len(r)
        whole += len(r)
        for start, stop in own:
            inside += float(r[start:stop] @ r[start:stop]) - (stop - start)
            time += stop - start
    return inside > _SPARSE_SHARE * beyond and time < _SPARSE_TIME * whole
