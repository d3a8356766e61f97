"""What moves estimates without showing as scatter: a model that lacks something, its solver, calibrations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from hil.cores import parallel_map
from hil.identification.grey_box.criteria import CRITERIA, EFFORT
from hil.identification.grey_box.estimate import Estimate
from hil.identification.grey_box.free import effects_at
from hil.identification.grey_box.residuals import Residuals
from hil.identification.uncertainty.evidence import VERY_STRONG
from hil.identification.uncertainty.noise import noise_of
from hil.language.note import Note
from hil.physics.plant import Parameters
from hil.record.recording import Array
from hil.signals.autoregression import whitened
from hil.signals.colour import colour_factor
from hil.signals.interval import CERTAIN

# Shares of the whole that what is lacking may add to the residuals, over the noise: tried in steps of a half.
_SHARES = np.concatenate(([0.0], np.geomspace(1e-3, 1e4, 15) ** 2))


@dataclass(frozen=True, slots=True)
class Systematic:
    """By how much estimates may be off beside their scatter.

    Attributes:
        model: covariance of what the model lacks and what its solver leaves, shape (k, k).
        calibration: standard uncertainties by the stated calibrations, shape (k,); None where none is stated.
        notes: in words.
    """

    model: Array
    calibration: Array | None
    notes: tuple[Note, ...]


def systematic(residuals: Residuals, found: Estimate, parameters: Parameters) -> Systematic:
    """Beside the scatter of an estimate, at these parameters."""
    base = residuals.at(parameters, residuals.effects)
    finer = _by_solver(residuals, found, parameters)
    covariance = np.outer(finer, finer)
    notes: tuple[Note, ...] = ()
    if _is_coloured(found.residuals):
        lacking, stage, is_sure = _structural_covariance(residuals, found, parameters, base)
        covariance = covariance + lacking
        sure = Note(
            "the model lacks something, most likely at its {stage}: the residuals are no noise. Intervals are widened "
            "by what that may have moved; hil diagnose looks for it",
            stage=Note(stage),
        )
        unsure = Note(
            "the noise is coloured, or the model lacks something, most likely at its {stage}; nothing tells which. "
            "Intervals are widened by what that may have moved",
            stage=Note(stage),
        )
        notes = ((sure if is_sure else unsure),) if stage else ()
    return Systematic(covariance, _calibrations(residuals, found, parameters, base), notes)


def _by_solver(residuals: Residuals, found: Estimate, parameters: Parameters) -> Array:
    """By how much the values move when the plant is solved in finer steps, shape (k,)."""
    low, high = (np.array([getattr(u, end) for u in found.unknowns]) for end in ("low", "high"))
    best, least, tried = found.values, math.inf, found.values
    for _ in range(EFFORT.solver_rounds):
        named = dict(zip((u.name for u in found.unknowns), tried.tolist(), strict=True))
        at = {**parameters, **{name: value for name, value in named.items() if name in parameters}}
        left = residuals.at(at, effects_at(residuals.effects, named), factor=EFFORT.solver)
        if not float(left @ left) < least:
            break
        best, least = tried, float(left @ left)
        tried = np.clip(tried + found.moved_by(left), low, high)
        if np.all(np.abs(tried - best) <= CRITERIA.followed * np.hypot(found.std, tried - found.values)):
            best = tried
            break
    return best - found.values


def _is_coloured(values: Array) -> bool:
    blocks = max(len(values) / EFFORT.block, 1.0)
    # the colour factor of white noise spreads by one over the root of the blocks about 1
    return colour_factor(values, EFFORT.block) > 1.0 + CERTAIN / math.sqrt(blocks)


def _structural_covariance(
    residuals: Residuals, found: Estimate, parameters: Parameters, base: Array
) -> tuple[Array, str, bool]:
    """Covariance of what physics at the hooks may have moved, the stage where most is, and whether noise is none of it.

    The stage is empty where nothing is.

    Each kind of addition at each hook has a size of its own, drawn about zero; how large they are on the whole is what
    makes the residuals most probable (empirical Bayes).
    """
    additions = list(_additions(residuals, residuals.passing(parameters)))

    def slope(addition: _Addition) -> Array:
        moved = residuals.at(parameters, residuals.effects, inject=addition.of)
        moved -= base
        return moved

    slopes, at = [], []  # of a long recording every copy takes megabytes: each is worked on in its place
    for addition, column in zip(additions, parallel_map(slope, additions), strict=True):
        size = float(np.linalg.norm(column))
        if math.isfinite(size) and size > 0.0:
            column /= size
            slopes.append(column)
            at.append(addition.hook)
    nothing = np.zeros((len(found.values),) * 2), "", False
    if not slopes:
        return nothing
    moves = np.array([found.moved_by(column) for column in slopes]).T
    for column, way in zip(slopes, moves.T, strict=True):
        column += found.jacobian @ way  # what is left of each once the estimate has given way to it
    apart = np.array(slopes).T
    slopes.clear()
    alike, along = apart.T @ apart, apart.T @ found.residuals
    evidence, variance, mean, spread_of = _most_probable(alike, along, found.residuals)
    if evidence == 0.0:
        return nothing
    off = moves @ mean
    stage = max(dict.fromkeys(at), key=lambda hook: float(np.sum(mean[[h == hook for h in at]] ** 2)))
    stages = {hook.name: hook.stage for hook in residuals.plant.hooks}
    moved = moves @ spread_of @ moves.T * variance + np.outer(off, off)
    return moved, stages[stage], _is_no_colour(found, apart)


def _is_no_colour(found: Estimate, apart: Array) -> bool:
    """Whether additions explain residuals that no memory of the noise foretells: coloured noise knows no command."""
    colour = np.array((1.0, *noise_of([found.residuals], 1.0).colour))
    rows = whitened(np.vstack([found.residuals, apart.T, found.jacobian.T]), colour)
    count = 1 + apart.shape[1]
    others = np.linalg.qr(rows[count:].T)[0]
    for row in rows[:count]:
        row -= others @ (row @ others)
    left, added = rows[0], rows[1:count]
    sizes = np.linalg.norm(added, axis=1)
    added /= np.where(sizes > 0.0, sizes, 1.0)[:, None]
    return bool(np.any(sizes > 0.0)) and _most_probable(added @ added.T, added @ left, left)[0] > VERY_STRONG


def _most_probable(alike: Array, along: Array, left: Array) -> tuple[float, float, Array, Array]:
    """Of the most probable share of what is added over the noise, 0 among them: twice the log evidence for it.

    And the noise's variance, the sizes' mean and their spread in its units.
    """
    total, count = float(left @ left), max(int(np.count_nonzero(left)), 1)
    values, vectors = np.linalg.eigh(alike)
    values, seen = np.maximum(values, 0.0), vectors.T @ along

    def explained(share: float) -> tuple[float, float]:
        inner = share / (1.0 + share * values)
        variance = max(total - float(np.sum(inner * seen**2)), 1e-12 * total) / count
        return -0.5 * (count * math.log(variance) + float(np.sum(np.log1p(share * values)))), variance

    share = max(_SHARES, key=lambda s: explained(float(s))[0])
    inner = float(share) / (1.0 + float(share) * values)
    evidence = 2.0 * (explained(float(share))[0] - explained(0.0)[0])
    return evidence, explained(float(share))[1], vectors @ (inner * -seen), (vectors * inner) @ vectors.T


@dataclass(frozen=True, slots=True)
class _Addition:
    """A function of what passes a hook, in shares of its largest, added there so small that it acts in proportion."""

    hook: str
    function: Callable[[Array], Array]
    size: float
    passing: list[Array]

    def of(self, recording: int) -> tuple[str, Array]:
        """Of one recording, as `Residuals.at` is given it."""
        return self.hook, self.size * self.function(self.passing[recording])


def _additions(residuals: Residuals, passing: list[Array]) -> Iterator[_Addition]:
    """Additions at each hook: one sign of the motion of what passes, levels, bends, and its rate."""
    for k, hook in enumerate(residuals.plant.hooks):
        largest = max(float(np.abs(trace[k]).max()) for trace in passing)
        if not largest > 0.0 or not math.isfinite(largest):
            continue
        shares = [trace[k] / largest for trace in passing]
        size = EFFORT.addition * hook.full_scale
        for function in (lambda s: np.sign(np.gradient(s)), np.sign, np.ones_like, np.abs, lambda s: s * np.abs(s)):
            yield _Addition(hook.name, function, size, shares)
        fastest = max(float(np.abs(np.gradient(s)).max()) for s in shares)
        if fastest > 0.0:
            yield _Addition(hook.name, np.gradient, size / fastest, shares)


def _calibrations(residuals: Residuals, found: Estimate, parameters: Parameters, base: Array) -> Array | None:
    """Root sum of squares of what a slope error of each calibrated channel would move, in all recordings alike."""
    moved = []
    for name, share in residuals.stated_gains():
        if name == "":
            change = residuals.driven_by(1.0 + share).at(parameters, residuals.effects) - base
        else:
            change = -share * residuals.readings([None if name == "output" else name])
        moved.append(found.moved_by(change))
    return np.sqrt(np.sum(np.square(moved), axis=0)) if moved else None
