"""Limits of a run that replace those a procedure declares: from its bench file and from the command line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from hil.errors import SettingError
from hil.record.measurement import Limit, Measurement


def split_limits(texts: Iterable[str]) -> dict[str, Limit]:
    """`["bandwidth_3db=1..", "thd=..5", "gain=0.6..0.8"]` by name.

    Raises:
        SettingError: a text of another form, a limit given twice, or one that nothing can lie in.
    """
    found: dict[str, Limit] = {}
    for text in texts:
        name, equals, span = (part.strip() for part in text.partition("="))
        low, dots, high = (part.strip() for part in span.partition(".."))
        if not (name and equals and dots and (low or high)):
            raise SettingError(f"limit '{text}' is not NAME=LOW..HIGH; one of the two may be left out")
        if name in found:
            raise SettingError(f"limit '{name}' is given twice")
        found[name] = Limit(_number(text, low), _number(text, high))
    return found


def checked_limits(measurements: Iterable[Measurement], limits: Mapping[str, Limit]) -> dict[str, Limit]:
    """The limits, each for something that the procedure measures.

    Raises:
        SettingError: a name that it does not measure, or a lower limit above the upper one.
    """
    known = [measurement.name for measurement in measurements]
    for name, limit in limits.items():
        if name.partition(", ")[0] not in known:
            raise SettingError(f"limit '{name}': not measured here; measured are: {', '.join(known) or 'nothing'}")
        if limit.low is not None and limit.high is not None and limit.low > limit.high:
            raise SettingError(f"limit '{name}': {limit.low:g} is above {limit.high:g}")
    return dict(limits)


def limits_of(meta: Mapping[str, Any]) -> dict[str, Limit]:
    """The limits that were written into the header of a run."""
    return {name: Limit(limit["low"], limit["high"]) for name, limit in meta.get("limits", {}).items()}


def _number(text: str, part: str) -> float | None:
    try:
        value = float(part) if part else None
    except ValueError:
        value = math.nan
    if value is not None and not math.isfinite(value):
        raise SettingError(f"limit '{text}': '{part}' is not a number")
    return value
