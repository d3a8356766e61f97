"""A counter of pulses: it sees how fast a shaft turns, and not which way."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, compiled, grid


@compiled
def transform(value: float, share: float) -> float:
    """What turns backwards is read forwards; of some of the pulses the direction may be known."""
    if value < 0.0:
        return value * (1.0 - 2.0 * share)
    return value


EFFECT = Effect(
    name="blind_to_sign",
    title="sensor that is blind to the direction",
    hooks=("pickup",),
    parameters=(EffectParameter("share", "1", 0.0, 1.0, 0.0, 1.0, "share of the pulses that are read forwards"),),
    transform=transform,
    starts=grid(share=(1.0, 0.6)),
    equation="y = v for v ≥ 0, (1 − 2s)·v for v < 0",
    signature="the reading never falls below nothing, and bounces off it where the shaft turns round",
    source="Wigren, Schoukens: Coupled Electric Drives Data Set and Reference Models, 2017",
    sentence="The sensor does not see the direction: {share:%} of what runs backwards is read as forwards.",
)
