"""Limits of a run that replace those a procedure declares: from its bench file and from the command line."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from hil.bench.file import Bench
from hil.errors import FileError, SettingError
from hil.record.measurement import Limit, Measurement, present_name
from hil.session.quantity import number_in


def split_limits(texts: Iterable[str]) -> dict[str, TypedLimit]:
    """`["bandwidth_3db=1..", "thd=..5 %", "rise=..0.2s"]` by name.

    Raises:
        SettingError: a text of another form, a limit given twice, or one that nothing can lie in.
    """
    found: dict[str, TypedLimit] = {}
    for text in texts:
        name, equals, span = (part.strip() for part in text.partition("="))
        low, dots, high = (part.strip() for part in span.partition(".."))
        if not (name and equals and dots and (low or high)):
            raise SettingError(f"limit '{text}' is not NAME=LOW..HIGH; one of the two may be left out")
        if name in found:
            raise SettingError(f"limit '{name}' is given twice")
        found[name] = TypedLimit(low, high)
    return found


def limit_text(name: str, limit: Limit) -> str:
    """A limit as it would be typed: `rise=..0.2`."""
    low, high = ("" if end is None else repr(end) for end in (limit.low, limit.high))
    return f"{name}={low}..{high}"


def bench_limits(bench: Bench, procedure: str) -> dict[str, Limit]:
    """Those that a bench file has for a procedure."""
    return {name: Limit(limit.low, limit.high) for name, limit in bench.acceptance.get(procedure, {}).items()}


@dataclass(frozen=True, slots=True)
class TypedLimit:
    """A limit as it was typed, an end with a unit or without; an empty one was left out."""

    low: str
    high: str

    def in_unit(self, name: str, unit: str) -> Limit:
        """The limit in the unit of what it is of.

        Raises:
            SettingError: an end that is no number, or in a unit of another kind.
        """
        ends = [number_in(end, unit, f"limit {name}") if end else None for end in (self.low, self.high)]
        return Limit(*ends)


def checked_limits(measurements: Iterable[Measurement], limits: Mapping[str, Limit | TypedLimit]) -> dict[str, Limit]:
    """The limits, each for something that the procedure measures, by its name of today.

    Raises:
        SettingError: a name that it does not measure, or a lower limit above the upper one.
    """
    known = {measurement.name: measurement.unit for measurement in measurements}
    found: dict[str, Limit] = {}
    for name, given in by_present_names(known, limits).items():
        quantity = name.partition(", ")[0]
        if quantity not in known:
            raise SettingError(f"limit '{name}': not measured here; measured are: {', '.join(known) or 'nothing'}")
        limit = found[name] = given.in_unit(name, known[quantity]) if isinstance(given, TypedLimit) else given
        if limit.low is not None and limit.high is not None and limit.low > limit.high:
            raise SettingError(f"limit '{name}': {limit.low:g} is above {limit.high:g}")
    return found


Allowed = TypeVar("Allowed", bound=Limit | TypedLimit)


def by_present_names(measured: Container[str], limits: Mapping[str, Allowed]) -> dict[str, Allowed]:
    """The limits by names of today; a procedure that measures a quantity of that old name keeps it."""
    return {name if name.partition(", ")[0] in measured else present_name(name): one for name, one in limits.items()}


def limits_of(meta: Mapping[str, Any]) -> dict[str, Limit]:
    """The limits that were written into the header of a run.

    Raises:
        FileError: one has no two ends that are numbers or open.
    """
    found = meta.get("limits") or {}
    for name, limit in found.items():
        ends = (limit.get("low", ""), limit.get("high", "")) if isinstance(limit, Mapping) else ("",)
        if not all(isinstance(end, int | float | None) for end in ends):
            shown = f"{limit!r:.60}"
            raise FileError(f"limit '{name}' in the header of the run: its ends are numbers or open, found {shown}")
    return {name: Limit(limit["low"], limit["high"]) for name, limit in found.items()}
