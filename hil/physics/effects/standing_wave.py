"""Standing wave: a line sends a part of each change back from its end, and rings in odd multiples of one frequency."""

from __future__ import annotations

import cmath
import math
from typing import Any

from hil.physics.effect import Effect, EffectParameter, Seen, compiled

# Waves beyond the third die out before a valve shows them; they follow at once.
WAVES = 3
# Of state for each wave: the factor of a step, what the last and the new value add, and where it stands, all complex.
_WORDS = 8


@compiled
def transform(value: float, state: Any, reflection: float, period: float) -> float:
    """The direct part and three decaying waves; state: last value, direct gain, then the waves."""
    if reflection <= 0.0:
        return value
    heard = 0.0
    for k in range(WAVES):
        w = 2 + _WORDS * k
        real = state[w] * state[w + 6] - state[w + 1] * state[w + 7]
        imaginary = state[w] * state[w + 7] + state[w + 1] * state[w + 6]
        state[w + 6] = real + state[w + 2] * state[0] + state[w + 4] * value
        state[w + 7] = imaginary + state[w + 3] * state[0] + state[w + 5] * value
        heard += state[w + 6]
    state[0] = value
    return state[1] * value + 4.0 * (1.0 + reflection) / period * heard


@compiled
def settle(value: float, state: Any, step_s: float, reflection: float, period: float) -> float:
    """All waves at rest at the first value; their steps are exact for a value that runs straight through each."""
    state[0] = value
    if reflection <= 0.0:
        return value
    direct = 1.0
    for k in range(WAVES):
        order = 2.0 * k + 1.0
        decay = -2.0 * math.log(reflection) / period * math.sqrt(order)
        pole = complex(-decay, 2.0 * math.pi * order / period)
        step = cmath.exp(pole * step_s)
        new = (step - 1.0 - pole * step_s) / (pole * pole * step_s)
        old = (step - 1.0) / pole - new
        rest = -value / pole
        w = 2 + _WORDS * k
        state[w], state[w + 1] = step.real, step.imag
        state[w + 2], state[w + 3] = old.real, old.imag
        state[w + 4], state[w + 5] = new.real, new.imag
        state[w + 6], state[w + 7] = rest.real, rest.imag
        direct -= 4.0 * (1.0 + reflection) / period * decay / (decay * decay + pole.imag * pole.imag)
    state[1] = direct
    return value


def starts(seen: Seen) -> list[dict[str, float]]:
    """Periods of lines of a metre to a dozen, and of those tones that stand out."""
    return [{"reflection": 0.5, "period": period} for period in seen.periods_s(0.05, 0.08, 0.12, 0.17, 0.25, 0.4)]


EFFECT = Effect(
    name="standing_wave",
    known_as="resonance",
    title="standing wave in a line",
    hooks=("flow",),
    parameters=(
        EffectParameter("reflection", "1", 0.0, 0.5, 0.0, 0.98, "share of a wave that comes back"),
        EffectParameter("period", "s", None, 0.15, 0.02, 2.0, "of the lowest wave, four times the travel time"),
    ),
    transform=transform,
    starts=starts,
    memory=2 + _WORDS * WAVES,
    settle=settle,
    equation="y = d·u + 4·(1 + ρ)/P · Σ_k Re q_k,  q̇_k = (−σ·√(2k − 1) + j·2π·(2k − 1)/P)·q_k + u,  σ = −2·ln ρ/P,  "
    "k = 1…3,  d: as the gain at rest is one",
    signature="ringing after steps in odd multiples of one frequency, the higher ones gone sooner, no distortion",
    source="Stecki, Davis: Fluid transmission lines, Proc. IMechE A 200(4), 1986",
    sentence="A line sends waves back and forth: it swings with a period of {period} after each change.",
)
