"""What a setting may be, declared beside its type: `cycles: Annotated[int, Allowed(at_least=1)]`."""

from __future__ import annotations

import math
import typing
from dataclasses import dataclass
from typing import Any, TypeVar, get_args, get_origin

Declared = TypeVar("Declared")


@dataclass(frozen=True, slots=True)
class Allowed:
    """The range of a number; ends that are not given are open. Every number must be finite."""

    at_least: float | None = None
    above: float | None = None
    at_most: float | None = None
    below: float | None = None

    def fault(self, value: float) -> str:
        """What a number must be, in words; empty for one that is allowed."""
        within = (
            math.isfinite(value)
            and (self.at_least is None or value >= self.at_least)
            and (self.above is None or value > self.above)
            and (self.at_most is None or value <= self.at_most)
            and (self.below is None or value < self.below)
        )
        return "" if within else self._demand

    @property
    def text(self) -> str:
        """`≥ 1`, `> 0, < 50`, `1 … 5`."""
        if self.at_least is not None and self.at_most is not None:
            return f"{self.at_least:g} … {self.at_most:g}"
        ends = (("≥", self.at_least), (">", self.above), ("≤", self.at_most), ("<", self.below))
        return ", ".join(f"{sign} {end:g}" for sign, end in ends if end is not None)

    @property
    def _demand(self) -> str:
        if self.at_least is not None and self.at_most is not None:
            return f"allowed are {self.at_least:g} to {self.at_most:g}"
        ends = (
            ("at least", self.at_least), ("above", self.above), ("at most", self.at_most), ("below", self.below),
        )  # fmt: skip
        return f"it must be {' and '.join(f'{word} {end:g}' for word, end in ends if end is not None) or 'finite'}"


def declared(kind: Any, what: type[Declared]) -> Declared | None:
    """What a type declares of its numbers, alone, in a union or of each item of a sequence; None for nothing."""
    arguments = get_args(kind)
    if get_origin(kind) is typing.Annotated:
        own = next((part for part in arguments[1:] if isinstance(part, what)), None)
        return own or declared(arguments[0], what)
    return next((found for part in arguments if (found := declared(part, what)) is not None), None)


def numbers_in(value: Any) -> list[float]:
    """The numbers of a value: itself, or its items."""
    if isinstance(value, list | tuple):
        return [number for item in value for number in numbers_in(item)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []
