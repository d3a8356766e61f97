"""Has the unit changed? One statistic, before any name, on the scale of the recordings of identification."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.special import ndtri, stdtr, stdtrit

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.skeleton.misfit import Misfit, Remainder, learned, leaves, remainder
from hil.diagnosis.skeleton.rows import Rows
from hil.diagnosis.thresholds import TINY
from hil.record.recording import Array, Integers, Mask

# A column counts where its information is at least this share of the median column's.
_ENOUGH = 1e-3
# The logarithm of a factor that says that nothing is known.
_LOG_FACTOR = 50.0
# So few recordings of before are dealt into parts, that each can be judged by a fit of the others.
_FEWEST, _PARTS = 3, 3


@dataclass(frozen=True)
class Before:
    """What is known of the unit that the model was identified from.

    Attributes:
        misfits: of each channel, fitted to all recordings of before.
        remainder: the scale of what they leave of others.
        count_as_one: of every column, so many rows of what is left tell as much as one, shape (columns,).
        least: those at the least. `information`: of every column in the recordings of before, shape (columns,).
        blocks: so many of them tell how many rows count as one, shape (columns,): what shows in few is not known.
        leverage: mean of the recordings of before, each without itself, the greatest.
        reach: z that an unchanged unit reached in pseudo-tests, each recording of before taken as the later one.
        uneven: standard deviation of the logarithm of what is left of each of them, over its scale.
        left: variance that the skeleton misfit leaves of recordings that were not fitted, over that of the nominal one.
    """

    misfits: tuple[Misfit, ...]
    remainder: Remainder
    count_as_one: Array
    least: float
    information: Array
    blocks: Array
    leverage: float
    reach: tuple[float, ...]
    uneven: float
    left: float

    def needed(self, *, alone: bool) -> float:
        """The z from which later recordings are an alarm: no less than pseudo-tests of before have reached.

        Of several later recordings no single one makes an alarm; so no single one of before withholds it.
        """
        return max((CRITERIA.alarm, *sorted(self.reach)[: None if alone else -1]))

    def within(self, count: int) -> float:
        """By which factor what is left of so many unchanged recordings may be off, either way, in 95 % (Student)."""
        known = len(self.reach)
        exponent = stdtrit(known - 1, 0.975) * self.uneven * math.sqrt(1.0 / known + 1.0 / count)
        return math.exp(min(exponent, _LOG_FACTOR))


@dataclass(frozen=True, slots=True)
class Later:
    """Later recordings on the scale of before.

    Attributes:
        z: by how many standard deviations of a normal distribution the column that shows it best is there in every part
            of the recordings.
        column: its place. `leverage`: mean of the recordings. `alone`: whether there is only one recording.
        left: what the skeleton misfit leaves in every row. `std`: its scale. Shape (n,).
    """

    z: float
    column: int
    leverage: float
    alone: bool
    left: Array
    std: Array


def are_enough(rows: Rows) -> bool:
    """Whether recordings of before have parts that can be judged by a fit of the others."""
    return len(np.unique(_folds(rows))) > 2


def before_of(rows: Rows) -> Before:
    """Learn what an unchanged unit leaves, and what pseudo-tests of before reach."""
    fold = _folds(rows)
    found = _learned(rows, fold)
    ridges = {of.channel: of.ridge for of in found.misfits}
    reach = []
    for k in np.unique(fold):
        others = np.where(fold == k, -1, fold)
        if len(np.unique(others[others >= 0])) > 1:
            reach.append(later_of(_learned(rows, others, ridges), rows.some(fold == k)).z)
    return replace(found, reach=tuple(reach))


def _folds(rows: Rows) -> Integers:
    """The recording of each row; parts of them where there are few."""
    count = int(rows.recording.max()) + 1
    if count >= _FEWEST:
        return rows.recording
    fold = np.zeros(len(rows.recording), dtype=np.int64)
    for k in range(count):
        own = np.flatnonzero(rows.recording == k)
        blocks = np.unique(rows.block[own], return_inverse=True)[1]
        fold[own] = _PARTS * k + blocks * _PARTS // (int(blocks.max()) + 1)
    return fold


def _learned(rows: Rows, fold: Integers, ridges: Mapping[int, float] = MappingProxyType({})) -> Before:
    known = rows.valid & (fold >= 0)
    left, leverage = np.zeros(len(fold)), np.zeros(len(fold))
    misfits = []
    for channel in np.unique(rows.channel[known]):
        own = rows.channel == channel
        misfit, left[own], leverage[own] = learned(rows.some(own), fold[own], ridges.get(int(channel)))
        misfits.append(misfit)
    scale = remainder(rows, left, leverage, known)
    std = scale.std_of(rows, leverage)
    g, information = _blocks(rows, left, std, known)
    total = information.sum(axis=1)
    count = (g**2).sum(axis=1) / np.maximum(total, TINY)
    blocks = total**2 / np.maximum((information**2).sum(axis=1), TINY)
    live = total > _ENOUGH * np.median(total)
    each = [(fold == k) & rows.valid for k in np.unique(fold[known])]
    uneven = float(np.std([np.log(TINY + np.mean(np.square(left[own] / std[own]))) for own in each], ddof=1))
    beyond = [float(np.mean(np.square(values[known]))) for values in (left, rows.misfit)]
    return Before(
        tuple(misfits), scale, count,
        float(np.median(count[live])) if live.any() else 1.0, total, np.maximum(blocks, 1.0),
        max(float(np.mean(leverage[own])) for own in each), (), uneven,
        beyond[0] / max(beyond[1], TINY),
    )  # fmt: skip


def later_of(before: Before, rows: Rows) -> Later:
    """The statistic of later recordings: no single one of them makes it; halves where there is only one."""
    left, leverage = leaves(before.misfits, rows)
    std = before.remainder.std_of(rows, leverage)
    g, information = _blocks(rows, left, std, rows.valid)
    owner = _recording_of_blocks(rows)
    parts = np.unique(owner)
    alone = len(np.unique(rows.recording)) == 1
    z = np.array([_z(before, g[:, owner != k], information[:, owner != k]) for k in parts])
    same = (np.sign(z) == np.sign(z[0])).all(axis=0)
    sure = np.where(same, np.abs(z).min(axis=0), 0.0)
    column = int(sure.argmax())
    return Later(float(sure[column]), column, float(np.mean(leverage[rows.valid])), alone, left, std)


def _recording_of_blocks(rows: Rows) -> Integers:
    """Of each block the recording that it is of, or which half of the only one."""
    first = _firsts(rows.block)
    owner = rows.recording[first]
    if len(np.unique(owner)) > 1:
        return owner
    return (np.arange(len(first)) * 2 // len(first)).astype(np.int64)


def _z(before: Before, g: Array, information: Array) -> Array:
    total = information.sum(axis=1)
    enough = _ENOUGH * np.median(total)
    live = (total > enough) & (before.information > enough)
    spread = np.sqrt(np.maximum(before.count_as_one, before.least) * np.maximum(total, TINY))
    return np.where(live, _normal(g.sum(axis=1) / spread, before.blocks), 0.0)


def _normal(z: Array, blocks: Array) -> Array:
    """What is as improbable of a normal distribution as z, whose scale was learned from so many blocks (Student)."""
    tail = np.maximum(stdtr(blocks, -np.abs(z)), np.finfo(np.float64).tiny)
    return -np.sign(z) * ndtri(tail)


def _blocks(rows: Rows, left: Array, std: Array, use: Mask) -> tuple[Array, Array]:
    """Score and information of every column in every block, shape (columns, blocks) each."""
    first = _firsts(rows.block)
    weight = np.where(use, 1.0 / std, 0.0)
    score, information = np.empty((2, len(rows.changes), len(first)))
    for k, own in enumerate(map(slice, first, [*first[1:], len(weight)])):  # a block stays in the processor's cache
        x = rows.changes[:, own] * weight[own]
        score[:, k] = -x @ (left[own] * weight[own])
        information[:, k] = np.einsum("ij,ij->i", x, x)
    return score, information


def _firsts(block: Integers) -> Integers:
    return np.flatnonzero(np.diff(block, prepend=-1)).astype(np.int64)
