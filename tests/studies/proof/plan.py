"""Which cases a proof consists of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .cases.label import NOTHING, PAIR, PARAMETER, THREE, TOGETHER, Label
from .truth.catalog import PLANTS, effects, laws_of

ALL_PLANTS = tuple(PLANTS)


@dataclass(frozen=True, slots=True)
class Plan:
    """What is asked for.

    Attributes:
        cases: Cases for each listed effect and severity; the other kinds in fixed proportion to it.
        plants: Plants that take part.
        severities: Severities of single effects.
        only: Kinds that take part; all if empty.
    """

    cases: int = 20
    plants: tuple[str, ...] = ALL_PLANTS
    severities: tuple[str, ...] = ("full",)
    only: tuple[str, ...] = ()

    def labels(self) -> list[Label]:
        """Return all cases."""
        wanted = [*self._singles(), *self._others()]
        return [label for label in wanted if not self.only or label.kind in self.only]

    def _singles(self) -> Iterator[Label]:
        for effect in effects(listed=True):
            for severity in self.severities:
                yield from self._spread(effect, severity, self.cases)

    def _others(self) -> Iterator[Label]:
        for effect in effects(listed=False):
            yield from self._spread(effect, "full", max(1, self.cases // 2))
        yield from self._spread(PARAMETER, "full", 2 * self.cases)
        yield from self._spread(PAIR, "full", 2 * self.cases)
        yield from self._spread(THREE, "full", self.cases)
        yield from self._spread(NOTHING, "full", 15 * self.cases)

    def _spread(self, kind: str, severity: str, count: int) -> Iterator[Label]:
        """Spread cases evenly over the plants on which a kind makes sense."""
        possible = _plants_of(kind, self.plants)
        for i in range(count if possible else 0):
            yield Label(kind, possible[i % len(possible)], severity, i // len(possible))


def _plants_of(kind: str, plants: Sequence[str]) -> list[str]:
    if kind in (NOTHING, PARAMETER, *TOGETHER):
        return list(plants)
    return [plant for plant in plants if laws_of(kind, plant)]


def kinds() -> list[str]:
    """Return every kind of case."""
    return [*effects(listed=True), *effects(listed=False), PARAMETER, *TOGETHER, NOTHING]
