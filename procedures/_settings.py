"""Ranges that settings share, declared with their types: checked, shown and described from there."""

from __future__ import annotations

from typing import Annotated

from hil.session.allowed import Allowed

Positive = Annotated[float, Allowed(above=0.0)]
NotNegative = Annotated[float, Allowed(at_least=0.0)]
Once = Annotated[int, Allowed(at_least=1, at_most=10_000)]
Twice = Annotated[int, Allowed(at_least=2, at_most=10_000)]
Seed = Annotated[int, Allowed(at_least=0)]
Poles = Annotated[int, Allowed(at_least=1, at_most=5)]
Zeros = Annotated[int, Allowed(at_least=0, at_most=5)]
