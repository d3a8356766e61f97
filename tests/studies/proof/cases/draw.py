"""Draw a case: from a seed and a label, always the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..truth.catalog import PLANTS, all_laws, effects, laws_of
from ..truth.excitation.programme import Programme, programme
from ..truth.law import Hidden
from ..truth.noise import draw_colour
from ..truth.plant import Plant
from ..truth.simulate import Unit
from .label import NOTHING, PARAMETER, SEVERITIES, TOGETHER, Label
from .play import CHANGED
from .severity import COARSE, Stand, distinct_sigma, stand, strengthened
from .truth import Truth

_QUIET = ("white",) * 7 + ("ar90",) * 2 + ("ar99",)
_COLOURFUL = ("white", "ar90", "ar99", "hum")


def programme_of(seed: int, label: Label) -> Programme:
    """Return what is played in a case."""
    return programme(label.plant, np.random.default_rng([*label.words(seed), 1]))


def draw(seed: int, label: Label) -> Truth:
    """Draw the truth of a case; takes seconds, because strengths are sought that show as large as wanted."""
    rng = np.random.default_rng([*label.words(seed), 2])
    plant = PLANTS[label.plant]
    unit = plant.unit(rng)
    key = int(rng.integers(1, 1_000_000)) * 100
    colour = draw_colour(rng, _COLOURFUL if label.kind == NOTHING else _QUIET)
    intermediate = bool(len(plant.channels) > 1 and rng.random() < 1 / 3)
    salt = rng.bytes(16).hex()
    healthy = Unit(plant, unit)
    on = stand(healthy, programme_of(seed, label).changed, key + CHANGED, COARSE)
    changed_unit = changed(plant, unit, rng) if label.kind == PARAMETER else unit
    hidden = tuple(strengthened(*_conceal(effect, on, label, rng)) for effect in _effects(label, rng))
    alone = [replace(healthy, hidden=(h,)) for h in hidden]
    sigma = tuple(on.sigma(one) for one in alone or [Unit(plant, changed_unit)])
    return Truth(
        label, seed, unit, changed_unit, hidden, colour, key, intermediate,
        sigma=sigma, distinct_sigma=tuple(distinct_sigma(one, on) for one in alone), salt=salt,
    )  # fmt: skip


def _effects(label: Label, rng: np.random.Generator) -> list[str]:
    if label.kind in (NOTHING, PARAMETER):
        return []
    if label.kind in TOGETHER:
        possible = [e for e in effects(listed=True) if laws_of(e, label.plant)]
        return [str(e) for e in rng.choice(possible, size=TOGETHER[label.kind], replace=False)]
    return [label.kind]


def _conceal(effect: str, on: Stand, label: Label, rng: np.random.Generator) -> tuple[Hidden, Stand, float]:
    """Return a law for an effect, its strength still to be found on the stand, and the sigma that is wanted."""
    name = str(rng.choice(laws_of(effect, label.plant)))
    law = all_laws()[name]
    low, high = law.full_sigma.get(label.plant, on.healthy.plant.full_sigma)
    wanted = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    parameters = (0.0, *(float(x) for x in law.draw(rng, label.plant)))
    return Hidden(name, parameters), on, wanted * SEVERITIES[label.severity]


def changed(plant: Plant, unit: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Return a unit of which one parameter or two have changed, with those that change together with them."""
    candidates = [b for b in plant.base if b.changes]
    chosen = rng.choice(len(candidates), size=rng.integers(1, 3), replace=False)
    after = dict(unit)
    for base in (candidates[i] for i in chosen):
        factor = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(*base.change)
        for name in (base.name, *base.together):
            after[name] *= factor
    return after
