"""Ranges and units that settings share, declared with their types: checked, shown and described from there."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval, Unit

Positive = Annotated[float, Interval(gt=0.0)]
NotNegative = Annotated[float, Interval(ge=0.0)]
Percent = Annotated[float, Unit("%")]
PositivePercent = Annotated[Positive, Unit("%")]
NotNegativePercent = Annotated[NotNegative, Unit("%")]
PositiveHertz = Annotated[Positive, Unit("Hz")]
Ampere = Annotated[float, Unit("A")]
PositiveAmpere = Annotated[Positive, Unit("A")]
NotNegativeAmpere = Annotated[NotNegative, Unit("A")]
Celsius = Annotated[float, Unit("°C")]
Once = Annotated[int, Interval(ge=1, le=10_000)]
Twice = Annotated[int, Interval(ge=2, le=10_000)]
Seed = Annotated[int, Interval(ge=0)]
Poles = Annotated[int, Interval(ge=1, le=5)]
Zeros = Annotated[int, Interval(ge=0, le=5)]
