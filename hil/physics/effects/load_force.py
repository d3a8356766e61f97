"""Load force: a constant force on the moving part, or a load pressure that helps one way and hinders the other."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid, shares


@compiled
def transform(force: float) -> float:
    """A force that is always there, before the first sample too."""
    return force


EFFECT = Effect(
    name="load_force",
    title="load force",
    hooks=("force",),
    parameters=(EffectParameter("force", "{value}", 0.0, 0.02, -0.5, 0.5, "force, as the equivalent command"),),
    transform=transform,
    starts=grid(force=shares("amplitude", -0.3, -0.05, 0.05, 0.3)),
    equation="F = F_L",
    signature="a shift of the working point that the sensor does not have; one direction faster than the other",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 6",
    sentence="A steady force pulls on the moving part, worth {force} of command.",
)
