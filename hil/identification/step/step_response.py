"""Step-response figures and the first- and second-order models that a step alone supports."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.errors import InputError
from hil.identification.step.criteria import CRITERIA
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Array, Complex, Mask
from hil.signals.crossing import crossing, first_crossing


@dataclass(frozen=True, slots=True)
class StepFigures:
    """What a step response is described by; times in seconds from the step of the command.

    Attributes:
        start, final: steady values before the step and at its end, in the output's unit.
        onset_s: until the output has moved by 2 % of its change.
        rise_s: from 10 % to 90 % of the change. `response_s`: until 90 %.
        settling_s: after which the output stays within `band` of the change.
        band_entry_s: until it first comes within `band`, as the HPV41 paper defines its settling time.
        overshoot: beyond the final value, as a share of the change.
        band: share of the change that counts as settled.
    """

    start: float
    final: float
    onset_s: float
    rise_s: float
    response_s: float
    settling_s: float
    band_entry_s: float
    overshoot: float
    band: float


def step_figures(
    time_s: Array, response: Array, *, start: float | None = None, final: float | None = None, band: float = 0.02
) -> StepFigures:  # fmt: skip
    """Figures of a response without noise to a step at t = 0; stamps rising, the first at or after 0.

    Args:
        time_s: shape (n,).
        response: shape (n,).
        start: value before the step; the first sample when None.
        final: value at the end; the mean of the last samples when None.
        band: share of the change within which it counts as settled.

    Raises:
        InputError: the response does not change, or does not reach 90 % of its final value.
    """
    tail = max(1, round(CRITERIA.tail_share * len(response)))
    first = float(response[0]) if start is None else start
    last = float(np.mean(response[-tail:])) if final is None else final
    change = last - first
    if change == 0.0:
        raise InputError("step response: the output does not change")
    share = (response - first) / change
    ten, ninety = _reaches(time_s, share, 0.1), _reaches(time_s, share, 0.9)
    return StepFigures(
        first, last, _leaves(time_s, share), ninety - ten, ninety,
        _stays(time_s, share, band), _reaches(time_s, share, 1.0 - band),
        max(float(share.max()) - 1.0, 0.0), band,
    )  # fmt: skip


def first_order_from_rise(rise_s: float, constant: float = 2.2) -> TransferFunction:
    """a/(s + a) with a = 2.2/Tr, eqs 11 and 12 of the HPV41 paper (2.2 stands for ln 9 = 2.197)."""
    return transfer_function([constant / rise_s], [1.0, constant / rise_s])


def first_order_from_settling(settling_s: float, constant: float = 4.0) -> TransferFunction:
    """a/(s + a) with a = 4/Ts, eq. 13 (4 stands for ln 50 = 3.912)."""
    return transfer_function([constant / settling_s], [1.0, constant / settling_s])


def damping_roots(rise_s: float, settling_s: float) -> Complex:
    """The four roots of eq. 17, 1.76ζ⁴ − 0.417ζ³ + 1.039ζ² + ζ − 4Tr/Ts = 0 (Nise 2011, p. 181)."""
    return np.roots([1.76, -0.417, 1.039, 1.0, -4.0 * rise_s / settling_s]).astype(np.complex128)


def second_order_from_step(rise_s: float, settling_s: float) -> TransferFunction:
    """ω²/(s² + 2ζωs + ω²) with ζ from eq. 17 and ω = 4/(ζ·Ts), eqs 14 to 18.

    Raises:
        InputError: no root is a damping ratio between 0 and 1.
    """
    roots = damping_roots(rise_s, settling_s)
    real = [float(r.real) for r in roots if abs(r.imag) < 1e-9 and 0.0 < r.real < 1.0]
    if not real:
        raise InputError(f"rise {rise_s:g} s and settling {settling_s:g} s belong to no underdamped second-order model")
    omega = 4.0 / (real[0] * settling_s)
    return transfer_function([omega**2], [1.0, 8.0 / settling_s, omega**2])


def dead_time_explaining(rise_s: float, settling_s: float, band: float = 0.02) -> tuple[float, float]:
    """(time constant, dead time) of the first-order model with dead time that has both figures.

    A settling time that counts from the command holds the dead time, a rise time does not; where 4/Ts and
    2.2/Tr disagree, a dead time makes peace between them.
    """
    time_constant = rise_s / math.log(9.0)
    return time_constant, settling_s + time_constant * math.log(band)


def _reaches(time_s: Array, share: Array, level: float) -> float:
    """First time at a level, between samples where it lies between them."""
    found = first_crossing(time_s, share, level)
    if found is None:
        raise InputError(f"step response: the output does not reach {100 * level:g} % of its change; record longer")
    return found


def moves_once(response: Array, start: float, final: float) -> bool:
    """Whether the response makes the first 2 % of its change once and for all.

    Where noise takes it there before, what it does first tells nothing of its onset.
    """
    share = (response - start) / (final - start)
    half = int(np.argmax(share >= 0.5))
    over = share[:half] >= CRITERIA.moved
    return bool(over.size) and not over[0] and int(np.sum(over[1:] != over[:-1])) <= 1


def leaves(time_s: Array, response: Array, start: float, final: float) -> float:
    """The onset alone, as `step_figures` reads it."""
    return _leaves(time_s, (response - start) / (final - start))


def _leaves(time_s: Array, share: Array) -> float:
    """Time from which on it has moved, seen back from half its change."""
    half = int(np.argmax(share >= 0.5))
    i = _last(share[:half] < CRITERIA.moved)
    if i < 0:
        return float(time_s[0])
    return crossing(time_s, share, CRITERIA.moved, i, i + 1)


def _stays(time_s: Array, share: Array, band: float) -> float:
    """Time after which the response stays within a band about its final value."""
    i = _last(np.abs(share - 1.0) > band)
    if i < 0:
        return float(time_s[0])
    if i + 1 == len(share):
        return math.inf
    return crossing(time_s, share, 1.0 + math.copysign(band, share[i] - 1.0), i, i + 1)


def _last(true: Mask) -> int:
    """Place of the last one that is true; −1 where none is."""
    if not true.any():
        return -1
    return len(true) - 1 - int(np.argmax(true[::-1]))
