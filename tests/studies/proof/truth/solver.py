"""Classical Runge–Kutta of fourth order with a fixed step, the command held and delayed exactly.

Within a step in which the delayed command changes, its mean over the step is used: a delay that is no
multiple of the step is then right to second order.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numba import float64, int64, njit, types, void
from numba.core.errors import NumbaExperimentalFeatureWarning

from .compiled import compiled
from .memory import LAW_RECORDS, LAW_TUPLE, PLANT_RECORD, PLANT_SIGNATURE, STATES

_PLANT_STATES = 8
_plant_function = types.FunctionType(PLANT_SIGNATURE)


@njit(inline="always")
def _held_mean(u: Any, now_s: float, step_s: float, sample_s: float) -> float:
    """Mean of the held samples u over [now, now + step]; before the first sample its value."""
    start, end = now_s / sample_s, (now_s + step_s) / sample_s
    i, j = int(np.floor(start)), int(np.floor(end))
    last = len(u) - 1
    first = u[min(max(i, 0), last)]
    if j <= i:
        return first
    share = (end - j) / (end - start)
    return (1.0 - share) * first + share * u[min(max(j, 0), last)]


@njit(inline="always")
def step(rhs: Any, r: Any, laws: Any, records: Any, t: float, h: float, old: Any, total: Any) -> None:
    """Advance plant and laws by one step; `old` and `total` are scratch rows, one per record and the plant."""
    count = len(records)
    for q in range(_PLANT_STATES):
        old[count, q] = r.s[q]
        total[count, q] = 0.0
    for j in range(count):
        for q in range(STATES):
            old[j, q] = records[j].z[q]
            total[j, q] = 0.0
    for stage in range(4):
        now = t + (0.0 if stage == 0 else h if stage == 3 else 0.5 * h)
        weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
        reach = 0.5 * h if stage < 2 else h
        r.t = now
        for j in range(count):
            records[j].t = now
            records[j].h = h
            records[j].first = 1 if stage == 0 else 0
        rhs(r, laws, records)
        for q in range(_PLANT_STATES):
            total[count, q] += weight * r.ds[q]
            r.s[q] = old[count, q] + reach * r.ds[q]
        for j in range(count):
            for q in range(STATES):
                total[j, q] += weight * records[j].dz[q]
                records[j].z[q] = old[j, q] + reach * records[j].dz[q]
    for q in range(_PLANT_STATES):
        r.s[q] = old[count, q] + total[count, q]
    for j in range(count):
        for q in range(STATES):
            records[j].z[q] = old[j, q] + total[j, q]


@njit(inline="always")
def _stands(r: Any, before: Any) -> bool:
    same = True
    for q in range(_PLANT_STATES):
        same = same and r.s[q] == before[q]
    return same


def _integrate(rhs: Any, r: Any, laws: Any, records: Any, u: Any, y: Any, times: Any) -> None:
    """Fill y (samples × channels); times is (sample_s, sub-steps a sample, settle_s, delay_s)."""
    sample_s, substeps, settle_s, delay_s = times
    h = sample_s / substeps
    old, total = np.zeros((len(records) + 1, 8)), np.zeros((len(records) + 1, 8))
    r.u = u[0]
    for k in range(-int(settle_s / h), 0):
        step(rhs, r, laws, records, k * h, h, old, total)
        if len(records) == 0 and _stands(r, old[0]):  # without laws only states decide: it stands from now on
            break
    for i in range(len(u)):
        for j in range(substeps):
            t = i * sample_s + j * h
            r.u = _held_mean(u, t - delay_s, h, sample_s)
            if j == 0:
                _show(rhs, r, laws, records, t, h, y, i)
            step(rhs, r, laws, records, t, h, old, total)


@njit(inline="always")
def _show(rhs: Any, r: Any, laws: Any, records: Any, t: float, h: float, y: Any, i: int) -> None:
    r.t = t
    for j in range(len(records)):
        records[j].t = t
        records[j].h = h
        records[j].first = 0
    rhs(r, laws, records)
    for q in range(y.shape[1]):
        y[i, q] = r.out[q]


def _track(
    rhs: Any, r: Any, laws: Any, records: Any, reference: Any, blur: Any, force: Any, y: Any, times: Any
) -> None:
    """Close a sampled position loop round the plant; fills the force it commanded and y.

    times is (sample_s, sub-steps a sample, proportional gain, derivative gain, force resolution, force limit,
    delay_s); blur is the noise that the controller's own sensor sees.
    """
    sample_s, substeps, proportional, derivative, resolution, limit, delay_s = times
    h = sample_s / substeps
    old, total = np.zeros((len(records) + 1, 8)), np.zeros((len(records) + 1, 8))
    last = 0.0
    for i in range(len(reference)):
        t = i * sample_s
        _show(rhs, r, laws, records, t, h, y, i)
        seen = y[i, 0] + blur[i]
        speed = (seen - last) / sample_s if i > 0 else 0.0
        last = seen
        wanted = proportional * (reference[i] - seen) - derivative * speed
        force[i] = resolution * np.round(min(max(wanted, -limit), limit) / resolution)
        for j in range(substeps):
            r.u = _held_mean(force, t + j * h - delay_s, h, sample_s)
            step(rhs, r, laws, records, t + j * h, h, old, total)


_TIMES = types.Tuple((float64, int64, float64, float64))
_LOOP = types.Tuple((float64, int64, float64, float64, float64, float64, float64))
_COLUMNS = float64[:, ::1]
_ROW = float64[::1]
_INTEGRATE = void(_plant_function, PLANT_RECORD, LAW_TUPLE, LAW_RECORDS, _ROW, _COLUMNS, _TIMES)
_TRACK = void(_plant_function, PLANT_RECORD, LAW_TUPLE, LAW_RECORDS, _ROW, _ROW, _ROW, _COLUMNS, _LOOP)


def integrate(
    rhs: Any, r: Any, laws: Any, records: Any, u: Any, y: Any, times: tuple[float, int, float, float]
) -> None:
    """Run a plant on held samples u, after settling on the first of them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        compiled(_integrate, _INTEGRATE)(rhs, r, laws, records, u, y, times)


def track(
    rhs: Any, r: Any, laws: Any, records: Any, reference: Any, blur: Any, force: Any, y: Any,
    times: tuple[float, int, float, float, float, float, float],
) -> None:  # fmt: skip
    """Run a plant inside a sampled position loop."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        compiled(_track, _TRACK)(rhs, r, laws, records, reference, blur, force, y, times)
