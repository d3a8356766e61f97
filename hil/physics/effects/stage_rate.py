"""Limited rate inside a stage: a pilot or a coil moves no faster than its oil or voltage allows."""

from __future__ import annotations

from hil.physics.effect import Effect, EffectParameter, Seen, compiled


@compiled
def transform(value: float, step_s: float, rate: float, knee: float) -> float:
    """The step that a first-order stage wants to make, held below the fastest one."""
    share = abs(value) / (rate * step_s)
    if share < 0.05:  # so far below the limit that it is not felt, whatever the knee
        return value
    return value / (1.0 + share ** (1.0 / knee)) ** knee


@compiled
def settle(value: float) -> float:
    """At rest it is where it wants to be."""
    return value


def starts(seen: Seen) -> list[dict[str, float]]:
    """From the rate at which the largest step seen would fill a sample, down."""
    top = seen.size / seen.interval_s
    return [{"rate": share * top} for share in (1.5, 0.7, 0.35, 0.15, 0.05)]


EFFECT = Effect(
    name="stage_rate",
    known_as="rate_limit",
    title="slew rate limit",
    hooks=("pilot_step", "coil_step"),
    parameters=(
        EffectParameter("rate", "{value}/s", float("inf"), 2.0, 0.02, 200.0, "fastest change", by_law=0.001),
        EffectParameter(
            "knee", "1", None, 0.1, 0.03, 0.5, "0.03: nothing is felt below the limit; 0.5: long before it"
        ),
    ),
    transform=transform,
    settle=settle,
    starts=starts,
    equation="ẏ = v/(1 + |v/R|^(1/k))^k,  v = (u − y)/T",
    signature="large steps begin as ramps of constant slope and end as they always do; bandwidth falls with amplitude",
    source="Merritt: Hydraulic Control Systems, 1967, ch. 7",
    sentence="It moves no faster than {rate}, however large the step.",
)
