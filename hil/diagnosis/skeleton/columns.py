"""What the library can change in a simulation: the directions in which a wrong structure is described."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from hil.diagnosis.problem import Problem
from hil.diagnosis.search.terms import Term, all_terms
from hil.physics.simulate import ActiveEffect

# A small step of a base parameter beside the starts of its term, as a share of its size: its slope.
_SLOPE = 0.02


@dataclass(frozen=True, slots=True)
class Column:
    """One change of the model: an effect of the library at a hook, or a base parameter at another value.

    Attributes:
        name: of the effect or the parameter. `hook`: where the effect acts; empty for a parameter.
        values: of the effect's parameters, or of the parameter.
    """

    name: str
    hook: str
    values: Mapping[str, float]

    def apply(self, parameters: dict[str, float], effects: list[ActiveEffect]) -> None:
        """Put the change into a simulation's arguments."""
        if self.hook:
            effects.append(ActiveEffect(self.name, self.hook, dict(self.values)))
        else:
            parameters.update(self.values)


def columns_of(problem: Problem) -> tuple[Column, ...]:
    """Every library term at each of its starts, and every base parameter at some steps; none that runs by the clock."""
    terms = all_terms(problem, problem.nominal_residuals)
    return tuple(column for term in terms if not term.by_clock for column in _of_term(term))


def _of_term(term: Term) -> Iterator[Column]:
    for start in _starts(term):
        parameters: dict[str, float] = {}
        effects: list[ActiveEffect] = []
        term.apply(start, parameters, effects)
        for effect in effects:
            yield Column(effect.name, effect.hook, effect.parameters)
        if parameters:
            yield Column(term.name, "", parameters)


def _starts(term: Term) -> Sequence[tuple[float, ...]]:
    if term.kind == "effect":
        return term.starts
    u = term.unknowns[0]
    step = _SLOPE * max(abs(term.nominal), u.scale)
    return (*term.starts, (term.nominal + (step if term.nominal + step <= u.high else -step),))
