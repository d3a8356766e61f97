"""What belongs to the valve and what to the bench, told by the stage of the chain."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

Owner = Literal["valve", "bench", "open"]
_VALVE = frozenset(("pilot", "spool", "coil", "rotor", "orifice", "torque motor", "lands", "linkage"))
_BENCH = frozenset(("sensor", "recorder", "supply", "oil", "load cell"))


def owner_of(stage: str) -> Owner:
    """Whose a stage is; open where a command, a load or a whole transfer function may be either's."""
    return "valve" if stage in _VALVE else "bench" if stage in _BENCH else "open"


def owner_among(stage: str, rivals: Iterable[str]) -> Owner:
    """Whose it is when the data do not tell it from causes at other stages."""
    own = owner_of(stage)
    return own if all(owner_of(rival) == own for rival in rivals) else "open"
