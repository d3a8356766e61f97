"""What is not as it was between two dates, and what these data would have shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

from hil.record.plain import plain

Owner = Literal["valve", "bench", "open"]
_VALVE = frozenset(("pilot", "spool", "coil", "rotor", "orifice", "torque motor", "lands", "linkage"))
_BENCH = frozenset(("sensor", "recorder", "supply", "oil", "load cell"))


@dataclass(frozen=True, slots=True)
class Size:
    """A value with its standard uncertainty; None where it is not known."""

    value: float | None
    std: float | None


@dataclass(frozen=True, slots=True)
class Change:
    """One thing that is not as it was; `share` of the whole change, None for a condition, which has none."""

    name: str
    stage: str
    of: Owner
    parameter: str
    before: Size
    after: Size
    unit: str
    share: float | None
    probability: float | None

    def as_dict(self) -> dict[str, Any]:
        """As in `hil.diff/1`."""
        found: dict[str, Any] = plain(self)
        return {("from" if key == "before" else "to" if key == "after" else key): v for key, v in found.items()}


@dataclass(frozen=True, slots=True)
class Unchanged:
    """What these data would have shown beyond this limit (95 %).

    Attributes:
        name: of an effect or parameter.
        limit: the largest change that may have gone unseen. Of what is itself a limit, such as an end stop, the place
            where it would have been seen: there is none there, nor below.
        unit: of the limit.
        is_identifiable: whether that excludes anything: a limit as large as the usual size of the effect, or as the
            parameter itself, does not.
        is_place: whether the limit is a place.
    """

    name: str
    limit: float
    unit: str
    is_identifiable: bool = True
    is_place: bool = False

    def as_dict(self) -> dict[str, Any]:
        """As in `hil.diff/1`."""
        return {"name": self.name, "limit": self.limit, "unit": self.unit, "is_place": self.is_place}


def owner_of(stage: str) -> Owner:
    """Whose a stage is; open where a command, a load or a whole transfer function may be either's."""
    return "valve" if stage in _VALVE else "bench" if stage in _BENCH else "open"


def owner_among(stage: str, rivals: Iterable[str]) -> Owner:
    """Whose it is when the data do not tell it from causes at other stages."""
    own = owner_of(stage)
    return own if all(owner_of(rival) == own for rival in rivals) else "open"
