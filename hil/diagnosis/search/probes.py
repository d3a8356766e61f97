"""A probe: what a term at one of its starts changes; probes can be added up without another simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.cores import parallel_map
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.linearization import Linearization, adapted_residuals
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import TINY
from hil.record.recording import Array

Start = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Probe:
    """A term at a start.

    Attributes:
        change: of the residuals there, sketched. `at`: the start scaled to where the line through it is lowest, and
            `chi2` there.
    """

    term: Term
    start: Start
    change: NDArray[np.float32]
    at: Start
    chi2: float

    @property
    def strongest(self) -> float:
        """The largest share of the change that is thought of."""
        return EFFORT.stronger if self.term.scales else 1.0

    @property
    def weakest(self) -> float:
        """The least share of it: negative where the term may have either sign."""
        return -self.strongest if self.term.is_signed else 0.0


def simulated_probes(linear: Linearization, jobs: Sequence[tuple[Term, Start]]) -> list[Probe]:
    """Terms at starts beside what is accepted, all else adapting linearly; best first."""
    r = linear.residuals_without

    def probe(job: tuple[Term, Start]) -> Probe | None:
        change = adapted_residuals(linear, *job) - r
        return _on_line(*job, sketch(change), change, r) if np.isfinite(change).all() else None

    return _best_first([found for found in parallel_map(probe, jobs) if found is not None])


def predicted_probes(linear: Linearization, probes: Sequence[Probe]) -> list[Probe]:
    """The same probes beside another set, from what they changed beside the unit as it was: nothing is simulated."""
    rows = linear.slopes.shape[0]
    stride = 1 + (rows + len(linear.problem.base)) // EFFORT.sketched
    slopes = linear.slopes[::stride].astype(np.float32)
    basis = np.linalg.qr(slopes / np.maximum(np.linalg.norm(slopes, axis=0), TINY))[0]
    r, taken, found = sketch(linear.residuals_without), keys(linear.accepted), []
    for probe in probes:
        if probe.term.key not in taken:
            change = probe.change.copy()
            change[: len(slopes)] -= basis @ (basis.T @ change[: len(slopes)])
            found.append(_on_line(probe.term, probe.start, probe.change, change, r))
    return _best_first(found)


def sketch(r: Array) -> NDArray[np.float32]:
    """As many of the residuals as suffice to compare what terms change, at half the precision."""
    return r[:: 1 + len(r) // EFFORT.sketched].astype(np.float32)


Keys = frozenset[tuple[str, str]]


def keys(f: Fitted) -> Keys:
    """The terms of a set, by name and hook."""
    return frozenset(t.key for t in f.terms)


Placed = tuple[Term, Start]


def pairs(probes: Sequence[Probe], r: NDArray[np.float32], most: int) -> list[tuple[Placed, Placed]]:
    """The most promising pairs of effects of different names: what both change is, at first, the sum of their changes.

    Args:
        probes: of every effect at its starts.
        r: the residuals, sketched.
        most: so many pairs at most.
    """
    probes = [probe for probe in probes if probe.term.kind == "effect" and float(probe.change @ probe.change) > 1.0]
    if len(probes) < 2:
        return []
    least, most_of = np.array([[x.weakest, x.strongest] for x in probes]).T
    gain, share_i, share_j = gains(np.stack([probe.change for probe in probes]), r, least, most_of)
    first, second = np.triu_indices(len(probes), 1)
    found: dict[frozenset[str], tuple[Placed, Placed]] = {}
    for k in np.argsort(-gain[first, second], kind="stable"):
        i, j = int(first[k]), int(second[k])
        names = frozenset((probes[i].term.reported_name, probes[j].term.reported_name))
        if gain[i, j] <= 0.0 or len(found) == most:
            break
        if len(names) == 2 and names not in found and share_i[i, j] != 0.0 != share_j[i, j]:
            a, b = probes[i], probes[j]
            found[names] = (
                (a.term, a.term.scaled(a.start, share_i[i, j])),
                (b.term, b.term.scaled(b.start, share_j[i, j])),
            )
    return list(found.values())


def gains(
    changes: NDArray[np.float32], r: NDArray[np.float32], least: Array, most: Array
) -> tuple[Array, Array, Array]:
    """How much χ² falls with each pair, and the shares, from `least` to `most`, of the first and of the second in it.

    Each of shape (k, k); [i, j] is the pair of i and j.
    """
    products = (changes @ changes.T).astype(np.float64)
    pull = -(changes @ r).astype(np.float64)
    size = np.diag(products)
    with np.errstate(divide="ignore", invalid="ignore"):
        alone = (np.outer(pull, size) - products * pull) / (np.outer(size, size) - products**2)
    first = np.clip(np.nan_to_num(alone), least[:, None], most[:, None])
    # where one of them was clipped, the other one takes what is best beside it
    second = np.clip((pull - products * first) / size, least, most)
    first = np.clip((pull[:, None] - products * second) / size[:, None], least[:, None], most[:, None])
    gain = 2.0 * (first * pull[:, None] + second * pull) - (
        first**2 * size[:, None] + second**2 * size + 2.0 * first * second * products
    )
    return gain, first, second


def _on_line(
    term: Term, start: Start, kept: NDArray[np.float32], change: NDArray[np.floating], r: NDArray[np.floating]
) -> Probe:
    """A probe at the strength at which the straight line from nothing to it is lowest."""
    length, found = float(change @ change), Probe(term, start, kept, start, np.inf)
    share = float(np.clip(-(r @ change) / max(length, 1.0), found.weakest, found.strongest)) if term.scales else 1.0
    if length <= 1.0 or share == 0.0:
        return found
    there = r + share * change
    return Probe(term, start, kept, term.scaled(start, share), float(there @ there))


def _best_first(probes: Sequence[Probe]) -> list[Probe]:
    return sorted(probes, key=lambda probe: probe.chi2)
