"""sample wear: less than there should be, by a share; `hil list effects` prints this line."""

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, share: float) -> float:
    """Less by a share."""
    return value * (1.0 - share)


def starts(_seen: Seen) -> list[dict[str, float]]:
    """Little and much."""
    return [{"share": 0.05}, {"share": 0.3}]


EFFECT = Effect(
    name="sample_wear",
    title="sample wear",
    hooks=("flow",),
    parameters=(EffectParameter("share", "1", 0.0, 0.1, 0.0, 0.9, "share that is lost"),),
    transform=transform,
    starts=starts,
    equation="y = (1 - s)·u",
    signature="less gain everywhere",
    source="say where the law is from",
    sentence="{share:%} is lost.",
)
