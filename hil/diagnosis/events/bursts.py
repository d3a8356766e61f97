"""Stretches of a recording in which the misfit is far beyond the noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.thresholds import FAR
from hil.identification.preparation.experiment import Experiment
from hil.record.recording import Array
from hil.signals.runs import runs

BLOCK_S = 0.1  # so long is a block that is far beyond the noise, or not; a recording has several in any case
_SEVERAL = 20
_SPARSE_SHARE, _SPARSE_TIME = 0.6, 0.45

Burst = tuple[int, int]
"""First sample, and the one behind the last."""


def all_bursts(problem: Problem, model: Fitted) -> list[list[Burst]]:
    """The bursts of every experiment."""
    return [bursts_of(problem, model.residuals, k) for k in range(len(problem.experiments))]


def bursts_of(problem: Problem, residuals: Array, k: int) -> list[Burst]:
    """(first, last) samples of stretches in which the misfit is far beyond the noise."""
    e = problem.experiments[k]
    size, power = block_size(e), block_power(e, residuals[problem.output_slices()[k]])
    merged: list[Burst] = []
    for start, stop in runs(power > FAR):
        if merged and start - merged[-1][1] <= 1:
            merged[-1] = merged[-1][0], stop
        else:
            merged.append((start, stop))
    return [(start * size, stop * size) for start, stop in merged]


def block_size(e: Experiment) -> int:
    """Samples of a recording in a block."""
    return max(2, min(round(BLOCK_S / e.drive.interval_s), len(e.output) // _SEVERAL))


def block_power(e: Experiment, residuals: Array) -> Array:
    """Mean square of one channel's residuals in each whole block, shape (blocks,)."""
    size = block_size(e)
    count = len(residuals) // size
    return np.mean(residuals[: count * size].reshape(count, size) ** 2, axis=1)


def is_sparse(problem: Problem, residuals: Array, bursts: Sequence[Sequence[Burst]]) -> bool:
    """Whether most of the misfit of the output lies in a small part of the time."""
    parts = problem.outputs_of(residuals)
    inside = [r[start:stop] for r, own in zip(parts, bursts, strict=True) for start, stop in own]
    return (
        _misfit(inside) > _SPARSE_SHARE * _misfit(parts)
        and sum(map(len, inside)) < _SPARSE_TIME * sum(map(len, parts))
    )  # fmt: skip


def _misfit(parts: Sequence[Array]) -> float:
    """Squared residuals beyond what noise would make of them."""
    return sum(float(r @ r) - len(r) for r in parts)
