"""Load pressure: a force on the cylinder takes pressure from the metering edge one way and adds to it the other."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(value: float, travel: float, pressure: float, rise: float) -> float:
    """Load pressure at this place of the stroke: steady, rising like that of a spring, or between."""
    return value + pressure * (1.0 + rise * (travel - 1.0))


EFFECT = Effect(
    name="load_pressure",
    known_as="load_force",
    title="load force on the cylinder",
    hooks=("load_pressure",),
    parameters=(
        EffectParameter("pressure", "{value}", 0.0, 0.1, -0.9, 0.9, "load force over area, at half the stroke's scale"),
        EffectParameter("rise", "1", None, 0.0, -4.0, 4.0, "0: the same everywhere; 1: nothing at zero, as a spring"),
    ),
    transform=transform,
    starts=grid(pressure=(-20.0, -5.0, 5.0, 20.0), rise=(0.0, 1.0)),
    equation="v ∝ √(p_s − sgn(v)·p_L),  p_L = p·(1 + r·(x/x_N − 1))",
    signature="one direction faster than the other, by an amount that changes along the stroke",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 6",
    sentence="A force loads the cylinder, worth {pressure} over its area.",
)
