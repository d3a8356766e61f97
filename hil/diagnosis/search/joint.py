"""Look for two causes at once: what both change together is, at first, the sum of what each changes alone.

One cause after the other goes wrong where a third one, which is not there, imitates most of the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.search.around import Around, adapted_residuals
from hil.diagnosis.search.fitted import Fitted
from hil.diagnosis.search.screen import MOST_STRONGER, Screened, sketch
from hil.diagnosis.search.terms import Term
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class _Look:
    """A term at given values, and what it changes after base parameters have adapted (see `sketch`)."""

    term: Term
    values: tuple[float, ...]
    change: NDArray[np.float32]

    @property
    def strongest(self) -> float:
        """The largest share of the change that is thought of."""
        return MOST_STRONGER if self.term.scales else 1.0

    def at(self, share: float) -> tuple[float, ...]:
        """The values with the strength that gives this share of the change."""
        return self.term.scaled(self.values, share) if self.term.scales else self.values


def joint(place: Around, screened: Sequence[Screened], refined: Sequence[Fitted], most: int) -> list[Fitted]:
    """The most promising pairs of effects of different names, best first; nothing is simulated but the refined terms.

    Args:
        place: around what; terms were screened and refined there.
        screened: every term with what it changes at each start.
        refined: terms fitted alone.
        most: so many pairs at most.

    Returns:
        Both terms at the strengths whose summed changes leave least, with the χ² that they would leave.
    """
    looks = _looks(place, screened, refined)
    if len(looks) < 2:
        return []
    changes = np.stack([look.change for look in looks])
    open_residuals = sketch(place.residuals_without)
    gain, share_i, share_j = _gains(changes, open_residuals, np.array([look.strongest for look in looks]))
    first, second = np.triu_indices(len(looks), 1)
    total = float(open_residuals @ open_residuals)
    scale = float(place.residuals_without @ place.residuals_without) / total
    found: dict[frozenset[str], Fitted] = {}
    for k in np.argsort(-gain[first, second], kind="stable"):
        i, j = int(first[k]), int(second[k])
        names = frozenset((looks[i].term.name, looks[j].term.name))
        if gain[i, j] <= 0.0 or len(found) == most:
            break
        if len(names) == 2 and names not in found and share_i[i, j] > 0.0 and share_j[i, j] > 0.0:
            values = (looks[i].at(share_i[i, j]), looks[j].at(share_j[i, j]))
            chi2 = scale * (total - float(gain[i, j]))
            terms = (looks[i].term, looks[j].term)
            found[names] = Fitted(terms, values, place.accepted.parameters, chi2, place.accepted.residuals)
    return list(found.values())


def _looks(place: Around, screened: Sequence[Screened], refined: Sequence[Fitted]) -> list[_Look]:
    looks = [
        _Look(s.term, start, change)
        for s in screened
        if s.term.kind == "effect"
        for start, change in zip(s.starts, s.changes, strict=True)
    ]
    for f in refined:
        if f.terms[-1].kind == "effect":
            adapted = adapted_residuals(place, (f.terms[-1], f.values[-1]))
            looks.append(_Look(f.terms[-1], f.values[-1], sketch(adapted - place.residuals_without)))
    # what changes less than one noise deviation in all is not there to be added to anything
    return [look for look in looks if float(look.change @ look.change) > 1.0]


def _gains(changes: NDArray[np.float32], r: NDArray[np.float32], most: Array) -> tuple[Array, Array, Array]:
    """How much χ² falls with each pair, and the shares, between 0 and `most`, of the first and of the second in it.

    Each of shape (k, k); [i, j] is the pair of i and j.
    """
    products: Array = (changes @ changes.T).astype(np.float64)
    pull: Array = -(changes @ r).astype(np.float64)
    size = np.diag(products)
    with np.errstate(divide="ignore", invalid="ignore"):
        alone = (np.outer(pull, size) - products * pull) / (np.outer(size, size) - products**2)
    first = np.clip(np.nan_to_num(alone), 0.0, most[:, None])
    # where one of them was clipped, the other one takes what is best beside it
    second = np.clip((pull - products * first) / size, 0.0, most)
    first = np.clip((pull[:, None] - products * second) / size[:, None], 0.0, most[:, None])
    gain = 2.0 * (first * pull[:, None] + second * pull) - (
        first**2 * size[:, None] + second**2 * size + 2.0 * first * second * products
    )
    return gain, first, second
