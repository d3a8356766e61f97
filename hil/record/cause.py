"""Why a unit missed its certificate, in physics: what a diagnosis of its run found, or why it found nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import Field, TypeAdapter


@dataclass(frozen=True, slots=True)
class Found:
    """One thing that is not as it should be, or not as it was: an effect, a parameter or a condition.

    `of`: valve, bench or open; empty where nobody says. `before` and `after` are its sizes, in `unit`, with their
    standard uncertainties; None where there is none, or none is known. `meaning`: a parameter in words. `share` is of
    the whole change, None where it is not known; `alike` what these data do not tell from it.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid", "defer_build": True}
    name: str
    of: str = ""
    before: float | None = None
    before_std: float | None = None
    after: float | None = None
    after_std: float | None = None
    unit: str = ""
    meaning: str = ""
    share: float | None = None
    alike: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Cause:
    """Why a certificate was missed, in physics, as a command found within a time; no part of the verdict.

    `command` was asked, as it is typed, beside the run `since` of the same unit, else beside the model of its type.
    `verdict` is the command's; where it is empty, `reason` says why. `found` is what it named, the
    largest share first; `not_searched` (`untold` in files) was left for want of time. It took `seconds` of `budget_s`.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid", "defer_build": True}
    command: str
    since: str = ""
    verdict: str = ""
    found: tuple[Found, ...] = ()
    not_searched: Annotated[str, Field(alias="untold")] = ""  # its name in results.json
    reason: str = ""
    seconds: float = 0.0
    budget_s: float = 0.0


ANSWER = TypeAdapter(Cause)
"""A cause as JSON, and back."""
