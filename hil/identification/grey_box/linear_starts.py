"""Where the poles of a linear plant may begin: read off the samples, by linear least squares alone.

Steiglitz and McBride's iteration (IEEE Trans. Automat. Contr. 10, 1965) finds the poles of the output error without a
start of its own. So a light resonance is found where a grid of start values misses it. It serves as a start only: a
fit of the plant itself follows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hil.arrays import LEAST
from hil.identification.grey_box.criteria import EFFORT
from hil.identification.preparation.experiment import Experiment
from hil.record.recording import Array, Complex
from hil.signals.recursion import filtered

_INSIDE = 0.999


@dataclass(frozen=True, slots=True)
class _Signals:
    """Input and output of one recording on its even grid, both (n,)."""

    given: Array
    read: Array
    interval_s: float

    def coarser(self, stride: int) -> _Signals:
        return _Signals(self.given[::stride], self.read[::stride], self.interval_s * stride)


def poles_rad_s(experiments: Sequence[Experiment], count: int) -> Complex | None:
    """So many stable poles, shape (count,), that leave least of the outputs; None where the samples are too few."""
    signals = [_signals(e) for e in experiments]
    interval_s = min(s.interval_s for s in signals)
    alike = [s for s in signals if math.isclose(s.interval_s, interval_s, rel_tol=1e-6)]
    found = min(_tried(alike, count), key=lambda tried: tried[0], default=None)
    return None if found is None else found[1]


def _signals(e: Experiment) -> _Signals:
    read, given = e.to_follow, e.drive.inputs[0]
    telling = np.flatnonzero(~np.isnan(read))
    return _Signals(given, np.interp(np.arange(len(given)), telling, read[telling]), e.drive.interval_s)


def _tried(signals: Sequence[_Signals], count: int) -> Iterator[tuple[float, Complex]]:
    """Poles from ever coarser samples, in which slow ones show, with the share of the output that they leave."""
    stride = 1
    while sum(len(s.given) // stride for s in signals) >= EFFORT.samples_per_unknown * (3 * count + 2):
        yield from _iterated([s.coarser(stride) for s in signals], count)
        stride *= EFFORT.coarser


def _iterated(signals: Sequence[_Signals], count: int) -> Iterator[tuple[float, Complex]]:
    below = np.r_[1.0, np.zeros(count)]
    for _ in range(EFFORT.linear_rounds):
        rows = [_equations(s, below, count) for s in signals]
        solved = np.linalg.lstsq(np.vstack([r for r, _ in rows]), np.concatenate([r for _, r in rows]), rcond=None)[0]
        roots = _stable(np.roots(np.r_[1.0, solved[:count]]).astype(np.complex128))
        below = np.real(np.poly(roots))
        if np.all(np.abs(roots) > 1e-6) and not np.any((roots.imag == 0.0) & (roots.real < 0.0)):
            yield _share_left(signals, below), np.asarray(np.log(roots), dtype=np.complex128) / signals[0].interval_s


def _stable(roots: Complex) -> Complex:
    """Roots outside the unit circle mirrored into it."""
    size = np.maximum(np.abs(roots), 1e-12)
    return np.where(size >= 1.0, roots / size**2 * _INSIDE, roots)


def _equations(s: _Signals, below: Array, count: int) -> tuple[Array, Array]:
    """The difference equation of prefiltered samples: rows and what they are to make; offset and start are free."""
    one, impulse = np.ones(len(s.given)), np.r_[1.0, np.zeros(len(s.given) - 1)]
    given, read, one, impulse = filtered([1.0], below, np.array([s.given, s.read, one, impulse]))
    delayed = [-_late(read, k) for k in range(1, count + 1)] + [_late(given, k) for k in range(count + 1)]
    return np.array([*delayed, one, *(_late(impulse, k) for k in range(count))]).T, read


def _late(values: Array, by: int) -> Array:
    return np.concatenate((np.zeros(by), values[: len(values) - by]))


def _share_left(signals: Sequence[_Signals], below: Array) -> float:
    """What poles leave of the output, the zeros, the offset and the start of each recording being free."""
    left = total = 0.0
    for s in signals:
        count = len(below) - 1
        impulse = np.r_[1.0, np.zeros(len(s.given) - 1)]
        answers = filtered([1.0], below, np.array([s.given, impulse]))
        zeros = [_late(answers[0], k) for k in range(count + 1)]
        start = [_late(answers[1], k) for k in range(count)]
        rows = np.array([*zeros, *start, np.ones(len(s.given))])
        left += _left(rows.T, s.read)
        total += float(np.sum((s.read - s.read.mean()) ** 2))
    return left / max(total, LEAST)


def _left(rows: Array, wanted: Array) -> float:
    error = wanted - rows @ np.linalg.lstsq(rows, wanted, rcond=None)[0]
    return float(error @ error)
