"""Counts of a study with exact 95 % intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from tests.studies.cases import NOTHING, Outcome
from tests.studies.rates import Rate

_SAID: dict[str, Callable[[Outcome], bool]] = {
    "not noticed": lambda one: not one.is_alarm,
    "wrong name": lambda one: one.is_wrong,
    "no name": lambda one: one.is_alarm and not one.is_wrong and not one.is_in_set,
    "right in the set": lambda one: one.is_in_set and not one.is_right,
    "right first": lambda one: one.is_right,
}

BANDS = (0.0, 1.0, 3.0, float("inf"))
"""Borders of d between which changes are counted together."""


def as_text(found: Sequence[Outcome]) -> str:
    """One line a skeleton and one a band of d."""
    return "\n".join(f"{name:22}  {_line(_counts(rows))}" for name, rows in _groups(found))


def as_json(found: Sequence[Outcome]) -> dict[str, Any]:
    """The same counts by name; each with hits, trials and its interval."""
    return {
        name: {
            key: {"hits": rate.hits, "trials": rate.trials, "interval": rate.interval()}
            for key, rate in _counts(rows).items()
        }
        for name, rows in _groups(found)
    }


def draw(found: Sequence[Outcome], path: Path) -> None:
    """A figure: every change over its d, by what was said of it."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 2.4), layout="constrained")
    axis = figure.subplots()
    changed = [one for one in found if one.case.change != NOTHING and not one.error]
    for place, is_so in enumerate(_SAID.values()):
        sizes = [one.moved for one in changed if is_so(one)]
        axis.plot(sizes, [place] * len(sizes), "o", color="0.2", alpha=0.5)
        axis.text(30.0, place, str(len(sizes)), va="center")
    axis.set_xscale("log")
    axis.set_xlim(0.01, 20.0)
    axis.set_yticks(range(len(_SAID)), list(_SAID))
    axis.set_xlabel("d: change over noise and what the model left before (rms)")
    with rc_context({"svg.fonttype": "none"}):
        figure.savefig(path)


def _groups(found: Sequence[Outcome]) -> Iterable[tuple[str, list[Outcome]]]:
    for name in sorted({one.case.skeleton for one in found}):
        yield name, [one for one in found if one.case.skeleton == name]
    for low, high in pairwise(BANDS):
        yield f"d {low:g} to {high:g}", [one for one in found if one.case.change != NOTHING and low <= one.moved < high]
    yield "d ≥ 1", [one for one in found if one.case.change == NOTHING or one.moved >= 1.0]
    yield "all", list(found)


def _counts(rows: Sequence[Outcome]) -> dict[str, Rate]:
    told = [one for one in rows if not one.error]
    same = [one for one in told if one.case.change == NOTHING]
    changed = [one for one in told if one.case.change != NOTHING]

    def of(what: Callable[[Outcome], bool], among: Sequence[Outcome]) -> Rate:
        return Rate(sum(map(what, among)), len(among))

    return {
        "unchanged": Rate(len(same), len(rows)),
        "alarms": of(lambda one: one.is_alarm, same),
        "changed": Rate(len(changed), len(rows)),
        "noticed": of(lambda one: one.is_alarm, changed),
        "right": of(lambda one: one.is_right, changed),
        "in_set": of(lambda one: one.is_in_set, changed),
        "wrong": of(lambda one: one.is_wrong, changed),
        "failed": Rate(len(rows) - len(told), len(rows)),
    }


def _line(counts: dict[str, Rate]) -> str:
    same, alarms, changed, noticed, right, in_set, wrong, failed = counts.values()
    return (
        f"unchanged {same.hits:3}, alarms {_cell(alarms):14} changed {changed.hits:3}, noticed {_cell(noticed):14} "
        f"right {_cell(right):14} or in a set of 3 {_cell(in_set):14} wrong {_cell(wrong):14} failed {failed.hits}"
    )


def _cell(rate: Rate) -> str:
    low, high = rate.interval()
    return f"{rate.hits} [{100 * low:.0f}…{100 * high:.0f} %]" if rate.trials else "–"
