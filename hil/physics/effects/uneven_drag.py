"""Uneven drag: a guide, a seal or a bearing brakes motion one way harder than the other."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(value: float, difference: float) -> float:
    """The speed that the drag is as large as: less than it is forwards, more than it is backwards, or the reverse."""
    return value - difference * abs(value)


EFFECT = Effect(
    name="uneven_drag",
    known_as="asymmetry",
    title="drag that differs between directions",
    hooks=("drag",),
    parameters=(
        EffectParameter(
            "difference", "1", 0.0, 0.1, -0.95, 0.95, "drag backwards less that forwards, as a share of their sum"
        ),
    ),
    transform=transform,
    starts=grid(difference=(-0.3, -0.1, 0.1, 0.3)),
    equation="F = b·(v − δ·|v|),  δ = (b₋ − b₊)/(b₋ + b₊)",
    signature="an offset of the force that grows with speed and is gone at rest; one direction faster than the other",
    source="Armstrong-Hélouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; "
    "Janot, Gautier, Brunot: Data Set and Reference Models of EMPS, nonlinearbenchmark.org 2019",
    sentence="Motion backwards is braked by {difference:%} more than the mean of both ways, forwards by as much less.",
)
