"""The bar: what a proof has to show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tests.studies.rates import Rate

from ..cases.label import NOTHING, PAIR, PARAMETER, THREE, TOGETHER
from .calibration import brier
from .judge import WRONG
from .result import Result
from .table import Row


@dataclass(frozen=True, slots=True)
class Claim:
    """A figure, what is asked of it, and whether it is reached (None where nothing was measured)."""

    what: str
    found: str
    asked: str
    met: bool | None


def claims(results: Sequence[Result]) -> list[Claim]:
    """Return every figure of the bar."""
    seen = [r for r in results if r.visible]
    single = [r for r in seen if r.listed and r.kind not in (NOTHING, PARAMETER, *TOGETHER) and r.severity == "full"]
    none = [r for r in seen if r.kind == NOTHING]
    return [
        _least("effect named first, full severity", Rate(sum(r.right for r in single), len(single)), 0.90),
        _most("wrong names, full severity", Rate(sum(r.said == WRONG for r in single), len(single)), 0.02),
        _most("false alarms where nothing is concealed", Rate(sum(not r.right for r in none), len(none)), 0.01),
        _least("out of library called unexplained", _right([r for r in seen if not r.listed]), 0.90),
        _least("pairs, both named", _right([r for r in seen if r.kind == PAIR]), 0.70),
        _least("three at once, all named", _right([r for r in seen if r.kind == THREE]), 0.40),
        _least("parameter changes called so", _right([r for r in seen if r.kind == PARAMETER]), 0.90),
        _gap(single),
        _coverage(seen),
        _brier(seen),
        _time(seen),
    ]


def _right(results: Sequence[Result]) -> Rate:
    return Rate(sum(r.right for r in results), len(results))


def _least(what: str, rate: Rate, wanted: float) -> Claim:
    return Claim(what, str(rate), f"≥ {100 * wanted:.0f} %", rate.share >= wanted if rate.trials else None)


def _most(what: str, rate: Rate, wanted: float) -> Claim:
    return Claim(what, str(rate), f"≤ {100 * wanted:.0f} %", rate.share <= wanted if rate.trials else None)


def _gap(single: Sequence[Result]) -> Claim:
    middle = Row("", tuple(single), 0).closed(0.5)
    found = "–" if middle is None else f"{100 * middle:.1f} %"
    return Claim(
        "closable gap closed on unseen recordings, median", found, "≥ 90 %", None if middle is None else middle >= 0.9
    )


def _coverage(seen: Sequence[Result]) -> Claim:
    held = Row("", tuple(seen), 0).held
    low, high = held.interval()
    return Claim("95 % intervals that hold the truth", str(held), "95 %", low <= 0.95 <= high if held.trials else None)


def _brier(seen: Sequence[Result]) -> Claim:
    found = brier(seen)
    return Claim("Brier score of names", f"{found:.3f}", "≤ 0.031", None if math.isnan(found) else found <= 0.031)


def _time(seen: Sequence[Result]) -> Claim:
    middle = Row("", tuple(seen), 0).seconds(0.5)
    found = "–" if middle is None else f"{middle:.1f} s"
    return Claim("from recordings to diagnosis, median", found, "≤ 60 s", None if middle is None else middle <= 60.0)
