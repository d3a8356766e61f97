"""Why a unit missed its certificate, in physics: what a diagnosis of its run found, or why it found nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class Found:
    """One thing that is not as it should be, or not as it was.

    Attributes:
        name: of an effect, a parameter or a condition. `meaning`: a parameter in words; empty for others.
        of: `valve`, `bench` or `open`.
        before, after: its sizes; None where there is none, or none is known. `before_std`, `after_std`: standard
            uncertainties of them.
        unit: of both.
        share: of the whole change; None where it is not known.
        alike: other causes that these data do not tell from it.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
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
    """What is said beside a verdict that is no pass; it judges nothing itself.

    Attributes:
        command: that was asked, as it is typed.
        since: name of the earlier run of the unit that it is compared with; empty where it is the model of the type.
        verdict: of the command: `changed`, `unchanged`, `unexplained`, … ; empty where it gave none.
        found: what it named, the largest share first.
        untold: what nobody looked at for want of time, in words.
        reason: why there is no verdict.
        seconds: that it took.
        budget_s: that it might take.
    """

    __pydantic_config__: ClassVar = {"extra": "forbid"}
    command: str
    since: str = ""
    verdict: str = ""
    found: tuple[Found, ...] = ()
    untold: str = ""
    reason: str = ""
    seconds: float = 0.0
    budget_s: float = 0.0
