"""How large an effect shows, and the strength at which it shows as large as wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..truth.catalog import all_laws
from ..truth.law import Array, Hidden
from ..truth.simulate import SUBSTEPS, Unit
from .play import Played, play, replay

COARSE = SUBSTEPS // 2
_FOR_SLOPES = SUBSTEPS // 8
_TOLERANCE = 0.1
_LOOKS = 12
_NEXT_TO_NOTHING = 1e-6


@dataclass(frozen=True, slots=True)
class Stand:
    """A healthy unit, what is played to it, and what it answers (not known before, inside a position loop)."""

    healthy: Unit
    commands: Mapping[str, Array]
    first: int
    substeps: int
    answers: Mapping[int, Array]

    def change(self, unit: Unit) -> Array:
        """Return what is concealed in a unit does to its output, all recordings one after another."""
        return np.concatenate([p.shown - self.answer(p) for p in play(unit, self.commands, self.first, self.substeps)])

    def answer(self, played: Played) -> Array:
        """Return the healthy unit's output on a command."""
        known = self.answers.get(played.number)
        return replay(self.healthy, played, self.substeps) if known is None else known

    def sigma(self, unit: Unit) -> float:
        """Return the rms of the change, in deviations of the sensor's noise."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.sqrt(np.mean(self.change(unit) ** 2)) / unit.plant.channels[0].noise)


def stand(healthy: Unit, commands: Mapping[str, Array], first: int, substeps: int) -> Stand:
    """Return a stand for one programme."""
    known = [] if healthy.plant.tracked else play(healthy, commands, first, substeps)
    return Stand(healthy, commands, first, substeps, {p.number: p.shown for p in known})


def strengthened(hidden: Hidden, on: Stand, wanted_sigma: float) -> Hidden:
    """Return the law at the strength at which it shows with `wanted_sigma`, or at its greatest where it cannot.

    Raises:
        RuntimeError: next to nothing of it shows as much: the truth's own solver diverges.
    """

    def shows(strength: float) -> float:
        return on.sigma(replace(on.healthy, hidden=(_with(hidden, strength),)))

    greatest = all_laws()[hidden.law].largest[on.healthy.plant.name]
    low, high = (0.0, 0.0), (greatest, np.inf)  # strengths that enclose the answer, and how large they show
    strength = 0.1 * greatest
    for _ in range(_LOOKS):
        found = shows(strength)
        if abs(found / wanted_sigma - 1.0) < _TOLERANCE or low[0] == greatest:
            break
        if found < wanted_sigma:
            low = (strength, found)
        else:
            high = (strength, found)
        strength = _next(low, high, wanted_sigma)
    if strength < _NEXT_TO_NOTHING * greatest:
        raise RuntimeError(
            f"{hidden.law}: {strength:g} of it shows as much as {greatest:g} should; the solver diverges"
        )
    return _with(hidden, strength)


def _next(low: tuple[float, float], high: tuple[float, float], wanted: float) -> float:
    """Interpolate between logarithms; go by proportion, or to the middle, where one end says nothing."""
    if low[1] > 0.0 and np.isfinite(high[1]):
        share = np.log(wanted / low[1]) / np.log(high[1] / low[1])
        return float(low[0] * (high[0] / low[0]) ** np.clip(share, 0.15, 0.85))
    if np.isfinite(high[1]):
        return float(high[0] * max(wanted / high[1], 0.1)) if low[0] == 0.0 else float(np.sqrt(low[0] * high[0]))
    if low[1] > 0.0:
        return float(min(high[0], low[0] * min(wanted / low[1], 4.0)))
    return float(np.sqrt(low[0] * high[0]))


def _with(hidden: Hidden, strength: float) -> Hidden:
    return replace(hidden, parameters=(float(strength), *hidden.parameters[1:]))


def distinct_sigma(unit: Unit, on: Stand) -> float:
    """Return what of a change no small change of base parameters could imitate, in noise deviations.

    The change is projected onto the sensitivities of the output to all base parameters, but for those that
    are the concealed effect itself under another name (a dead time, an overlap).
    """
    same = {name for hidden in unit.hidden for name in all_laws()[hidden.law].counterparts}
    played = play(unit, on.commands, on.first, on.substeps)
    changed = np.concatenate([p.shown - on.answer(p) for p in played])
    # slopes only: a healthy unit is smooth, and the error of coarser steps is much the same on both sides
    healthy = _answers(on.healthy, played)
    columns = [
        _answers(_nudged(on.healthy, base.name), played) - healthy
        for base in on.healthy.plant.base
        if base.name not in same
    ]
    basis = np.stack([column / np.linalg.norm(column) for column in columns], axis=1)
    left = changed - basis @ np.linalg.lstsq(basis, changed, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)) / unit.plant.channels[0].noise)


def _answers(unit: Unit, played: Sequence[Played]) -> Array:
    return np.concatenate([replay(unit, p, _FOR_SLOPES) for p in played])


def _nudged(unit: Unit, name: str) -> Unit:
    return replace(unit, parameters=dict(unit.parameters) | {name: unit.parameters[name] * 1.001})
