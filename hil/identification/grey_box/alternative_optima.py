"""Other values that fit as well, away from where the slopes at a fit can see.

Slopes hold in the neighbourhood of a fit alone. A range that ends exactly at a level that was driven makes a corner
there; lags in a row may change places; and what is confounded with a value that is not identifiable gives way along a
curve. Each is tried by fitting again from there; intervals hold what fits as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from hil.identification.grey_box.criteria import CRITERIA, EFFORT
from hil.identification.grey_box.estimate import Estimate
from hil.language.note import Note
from hil.physics.plant import Parameters
from hil.record.recording import Array
from hil.signals.interval import UNIFORM

AwayWith = Callable[[int, float], Array | None]
FitAt = Callable[[Parameters, Sequence[str]], Estimate]
"""Fits the named parameters, the others held, from these values."""

_ASIDE = 2.0 * UNIFORM  # standard deviation of what lies anywhere up to so far, to one side


def alternative_optima(found: Estimate, at: Parameters, fit_at: FitAt) -> tuple[Array, tuple[Note, ...]]:
    """Covariance of how far values that fit as well lie away, shape (k, k), and what to say of them.

    Args:
        found: the fit.
        at: values of all parameters there.
        fit_at: fits again.
    """
    made, notes = np.zeros((len(found.values),) * 2), []

    def away_with(k: int, value: float) -> Array | None:
        """How far values lie away with one held and the others fitted again; None where that fits worse."""
        name = found.unknowns[k].name
        again = fit_at({**at, name: value}, [other for other in found.named if other != name])
        return np.insert(again.values, k, value) - found.values if _as_good(found, again) else None

    for apart, note in (*_beyond_corners(found, away_with), *_exchanged(found, at, fit_at), *_held(found, away_with)):
        made += np.outer(apart, apart)
        notes += [note] if note else []
    return made, tuple(dict.fromkeys(notes))


def _beyond_corners(found: Estimate, away_with: AwayWith) -> Iterator[tuple[Array, Note]]:
    """Values in a corner, held ever farther to both sides for as long as the fit stays as good."""
    curvature = found.curvature
    if curvature.bent is None:
        return
    is_corner = np.diag(curvature.bent) > CRITERIA.corner**2 * np.diag(curvature.alike)
    for k in np.flatnonzero(is_corner).tolist():
        for sign in (1.0, -1.0):
            farthest = _walked(found, away_with, k, sign * EFFORT.first_step * float(found.std[k]))
            if farthest is not None:
                note = Note(
                    "parameter '{name}' lies at a level that was driven. Its interval reaches as far as the fit stays "
                    "as good. Another level within the interval would determine it",
                    name=found.unknowns[k].name,
                )
                yield 2.0 * _ASIDE * farthest, note


def _walked(found: Estimate, away_with: AwayWith, k: int, step: float) -> Array | None:
    """How far all values lie away at the farthest, in steps that double; None where the first is too far."""
    u, farthest = found.unknowns[k], None
    for doubled in range(EFFORT.doublings):
        value = float(found.values[k]) + step * 2.0**doubled
        if not (math.isfinite(value) and u.low <= value <= u.high):
            break
        if (away := away_with(k, value)) is None:
            break
        farthest = away
    return farthest


def _held(found: Estimate, away_with: AwayWith) -> Iterator[tuple[Array, Note | None]]:
    """A value that only its bounds hold, at both ends of where it may lie: where the others go then, without it."""
    widths = np.array([u.high - u.low for u in found.unknowns])
    for direction in found.identifiability.unidentifiable:
        k = int(np.argmax(np.abs(direction) / widths))
        u, reach = found.unknowns[k], abs(float(direction[k]))
        for value in (max(float(found.values[k]) - reach, u.low), min(float(found.values[k]) + reach, u.high)):
            if (apart := away_with(k, value)) is not None:
                apart[k] = 0.0
                yield apart / 2.0, None


def _exchanged(found: Estimate, at: Parameters, fit_at: FitAt) -> Iterator[tuple[Array, Note]]:
    """A lag in the place of the slow one of an overdamped pair, which in a row act alike."""
    names = list(found.named)
    for pair in (name.removesuffix("_damping") for name in names if name.endswith("_damping")):
        frequency, damping = at.get(f"{pair}_frequency", 0.0), at[f"{pair}_damping"]
        if f"{pair}_frequency" not in names or damping <= 1.0:
            continue
        root = math.sqrt(damping**2 - 1.0)
        slow, fast = frequency * (damping - root), frequency * (damping + root)
        for lag in (name for name in names if name.endswith("_lag") and at[name] > 0.0):
            for stays, goes in ((fast, slow), (slow, fast)):
                swapped = math.sqrt(stays / at[lag])
                values = {lag: 1.0 / goes, f"{pair}_frequency": swapped}
                values[f"{pair}_damping"] = (stays + 1.0 / at[lag]) / (2.0 * swapped)
                limits = {u.name: (u.low, u.high) for u in found.unknowns}
                if not all(limits[name][0] <= value <= limits[name][1] for name, value in values.items()):
                    continue
                again = fit_at({**at, **values}, names)
                if _as_good(found, again):
                    note = Note(
                        "{lag} and a lag of the {pair} may change places: these recordings do not tell which is which. "
                        "A channel between them would",
                        lag=lag, pair=pair,
                    )  # fmt: skip
                    yield _ASIDE * (again.values - found.values), note


def _as_good(found: Estimate, again: Estimate) -> bool:
    return again.chi2 - found.chi2 <= CRITERIA.as_good * found.identifiability.variance
