"""Recordings of one test whose outputs differ by more than noise: by how much, in which way, and what would tell why.

No one model fits both. What differs is written as an offset, a gain and a delay, the first terms of any small change
of a unit: d = a + b (y - mean y) + c dy/dt, fitted by least squares.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.noise import channel_floor
from hil.language.note import Note
from hil.record.recording import Array, split_heading
from hil.signals.colour import colour_factor
from hil.signals.interval import CERTAIN, COVERED


def disagreement(experiments: Sequence[Experiment]) -> tuple[Note, ...]:
    """What is said of the first two recordings of one command that differ by more than their noise; empty if none."""
    noises = [[channel_floor(row) for row in e.drive.inputs] if len(experiments) > 1 else [] for e in experiments]
    for (one, noise), (other, others) in combinations(zip(experiments, noises, strict=True), 2):
        allowed = COVERED * np.hypot(noise, others) if len(noise) == len(others) else None
        if _is_one_test(one, other, allowed) and (ways := _differences(one, other)):
            disagree = Note(
                "the same command as {other}, yet the output differs: {ways}. No one model fits both; repeat the first "
                "test: where its output comes back, the unit was changed in between, else it drifts",
                other=other.name, ways=ways,
            )  # fmt: skip
            return (disagree.of(one.name),)
    return ()


def _is_one_test(one: Experiment, other: Experiment, allowed: Array | None) -> bool:
    """Whether two recordings have the same commands, sample by sample, but for what their noise allows."""
    if allowed is None or one.drive.inputs.shape != other.drive.inputs.shape or len(one.output) != len(other.output):
        return False
    if not math.isclose(one.interval_s, other.interval_s, rel_tol=1.0 / len(one.output)):
        return False
    return bool(np.all(np.std(one.drive.inputs - other.drive.inputs, axis=1) <= allowed))


def _differences(one: Experiment, other: Experiment) -> tuple[Note, ...]:
    """In which ways the first output differs from the second, each beyond its uncertainty; none within the noise."""
    both = one.valid & other.valid
    mean = (one.output + other.output) / 2.0
    parts = np.array([np.ones(len(mean)), mean - mean[both].mean(), np.gradient(mean, one.interval_s)])[:, both]
    apart = (one.output - other.output)[both]
    noise = math.hypot(channel_floor(one.valid_output), channel_floor(other.valid_output))
    sizes = np.linalg.norm(parts, axis=1)
    if not sizes.all():
        return ()
    found, _, rank, _ = np.linalg.lstsq((parts.T / sizes), apart, rcond=None)
    if rank < len(parts):
        return ()
    left = apart - (parts.T / sizes) @ found
    spread = np.linalg.inv((parts / sizes[:, None]) @ (parts.T / sizes)) * float(left @ left) / len(left)
    values, stds = found / sizes, np.sqrt(np.diag(spread) * colour_factor(left)) / sizes
    notes = (
        Note("{value:+.3g} ± {width:.2g} {unit} of offset", value=values[0], width=COVERED * stds[0],
             unit=split_heading(one.output_heading)[1]),
        Note("{value:+.3g} ± {width:.2g} % of gain", value=100.0 * values[1], width=100.0 * COVERED * stds[1]),
        Note("{value:+.3g} ± {width:.2g} s of delay", value=-values[2], width=COVERED * stds[2]),
    )  # fmt: skip
    is_large = (np.abs(values) > CERTAIN * stds) & (np.abs(found) > noise * math.sqrt(len(apart)))
    return tuple(note for note, shown in zip(notes, is_large, strict=True) if shown)
