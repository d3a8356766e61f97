"""Ranges and units that settings share, declared with their types: checked, shown and described from there."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Unit

from hil.session.allowed import Allowed

Positive = Annotated[float, Allowed(above=0.0)]
NotNegative = Annotated[float, Allowed(at_least=0.0)]
Percent = Annotated[float, Unit("%")]
PositivePercent = Annotated[Positive, Unit("%")]
NotNegativePercent = Annotated[NotNegative, Unit("%")]
PositiveHertz = Annotated[Positive, Unit("Hz")]
Ampere = Annotated[float, Unit("A")]
PositiveAmpere = Annotated[Positive, Unit("A")]
NotNegativeAmpere = Annotated[NotNegative, Unit("A")]
Celsius = Annotated[float, Unit("°C")]
Once = Annotated[int, Allowed(at_least=1, at_most=10_000)]
Twice = Annotated[int, Allowed(at_least=2, at_most=10_000)]
Seed = Annotated[int, Allowed(at_least=0)]
Poles = Annotated[int, Allowed(at_least=1, at_most=5)]
Zeros = Annotated[int, Allowed(at_least=0, at_most=5)]
