"""What a stop does to a part that runs against it."""

from __future__ import annotations

from hil.physics.effect import compiled


@compiled
def speed_after(speed: float, free: float, before: float, reached: float) -> float:
    """The part's speed once its hook has held it at `reached` where it would have gone to `free`; nothing at a stop.

    A stop takes the momentum. It holds the very same place again; a disturbance injected at the hook never does.
    """
    return 0.0 if reached == before and reached != free else speed
