"""The table of the study as Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import groupby

import numpy as np

from tests.studies.coverage.score import Tally, ends
from tests.studies.coverage.study import Outcome
from tests.studies.markdown import head, line
from tests.studies.rates import Rate

HEADINGS = ("figure", "situation", "truth", "mean", "u", "bias/u", "spread/u", "holds", "runs")
LEAST, MOST, LEAST_BOUND = 0.91, 0.985, 0.97
_TWICE = 2.0


def table(outcomes: Iterable[Outcome]) -> str:
    """A section for each procedure on each bench, a line for each figure in each situation."""
    made = []
    for (procedure, bench), group in groupby(outcomes, key=lambda one: (one.case.procedure, one.case.bench)):
        listed = list(group)
        made += [f"### `{procedure}` on `{bench}`", "", *head(HEADINGS)]
        for name in listed[0].tallies:
            of_name = [(one, one.tallies[name]) for one in listed if name in one.tallies]
            made += [row(name, one.situation.name, tally, one.runs) for one, tally in of_name]
        made.append("")
    return "\n".join(made)


def summary(outcomes: Iterable[Outcome]) -> str:
    """A line for each situation: how many figures with a value hold too seldom, more often than need be, too widely."""
    rows: dict[str, list[Tally]] = {}
    for one in outcomes:
        told = [tally for tally in one.tallies.values() if tally.stated > one.runs / 2]
        rows.setdefault(one.situation.name, []).extend(told)
    made = head(("situation", "figures with a value", "held in < 91 %", "91 … 98.5 %", "> 98.5 %", "u > 2 × rms error"))
    for name, tallies in rows.items():
        shares = np.array([tally.held / tally.stated for tally in tallies])
        wide = sum(float(np.median(t.stds)) > _TWICE * float(np.sqrt(np.mean(np.square(t.errors)))) for t in tallies)
        few, many = np.sum(shares < LEAST), np.sum(shares > MOST)
        counts = (len(shares), few, len(shares) - few - many, many)
        made.append(line((name, *map(str, counts), str(wide))))
    return "\n".join(made)


def verdicts(outcomes: Iterable[Outcome]) -> str:
    """A line for each figure: how many runs lie wholly below, and wholly above, a limit at the truth."""
    made = head(("figure", "situation", "below", "above", "runs"))
    for one in outcomes:
        for name, tally in one.tallies.items():
            said = (f"{100.0 * share:.1f} %" for share in tally.beside)
            note = f" ({tally.bounds} bounds)" if tally.bounds else ""
            made.append(line((f"`{one.case.procedure}` {name}{note}", one.situation.name, *said, str(one.runs))))
    return "\n".join(made)


def short(outcomes: Iterable[Outcome]) -> Iterator[str]:
    """Figures whose intervals hold the truth too seldom: 300 seeds of a 95 % interval give 91 % at least."""
    for one in outcomes:
        for name, tally in one.tallies.items():
            if Rate(tally.held, tally.stated).interval()[1] < LEAST_BOUND - 0.02 and tally.stated:
                yield f"{one.case.procedure} on {one.case.bench}, {one.situation.name}: {_holds(tally)} {name}"
            if tally.bounds and Rate(tally.bounds_held, tally.bounds).interval()[1] < LEAST_BOUND:
                yield f"{one.case.procedure} on {one.case.bench}, {one.situation.name}: bound {_holds(tally)} {name}"


def row(name: str, place: str, tally: Tally, runs: int) -> str:
    """The line of a figure: what is true of it, what was said, and how often that held."""
    low, high = ends(tally.truth)
    truth = f"{low:.5g} {tally.unit}".rstrip() if low == high else f"{low:.4g} … {high:.4g}"
    u = float(np.median(tally.stds)) if tally.stds else 0.0
    mean, bias, spread = ("–",) * 3
    if tally.stated:
        mean = f"{np.mean(tally.values):.5g}"
    if tally.stated > 1 and u:
        bias, spread = f"{np.mean(tally.errors) / u:+.2f}", f"{np.std(tally.values, ddof=1) / u:.2f}"
    cells = (re.sub(r"\|", "/", name), place, truth, mean, f"{u:.2g}" if u else "–", bias, spread)
    return line((*cells, _holds(tally), str(runs)))


def _holds(tally: Tally) -> str:
    said = []
    if tally.stated:
        said.append(str(Rate(tally.held, tally.stated)))
    if tally.bounds:
        said.append(f"bound {100.0 * tally.bounds_held / tally.bounds:.0f} % of {tally.bounds}")
    if tally.untold:
        said.append(f"cannot be told {tally.untold}")
    if tally.unknown:
        said.append(f"no uncertainty {tally.unknown}")
    return ", ".join(said)
