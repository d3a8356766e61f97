"""`python -m tests.coverage_identify`: the study and its table on a page."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from tests.coverage_identify.cases import CASES
from tests.coverage_identify.study import Outcome, Tally, tried
from tests.coverage_study.page import put
from tests.coverage_study.score import wilson

_HEAD = (
    "| parameter | range | truth | mean | u | bias/u | spread/u | holds | runs |\n|---|---|---|---|---|---|---|---|---|"
)


def table(outcomes: Iterable[Outcome]) -> str:
    """A section for each valve, a line for each parameter at each range."""
    made, title = [], ""
    for one in outcomes:
        if one.case.name != title:
            title = one.case.name
            made += ["", f"### {title}", "", _HEAD]
        made += [_line(name, one, tally) for name, tally in one.tallies.items()]
    return "\n".join(made)


def _line(name: str, one: Outcome, tally: Tally) -> str:
    cells = [name, one.range, f"{tally.truth:.5g} {tally.unit}", *["–"] * 4]
    if tally.values:
        u = float(np.median(tally.stds))
        cells[3:5] = f"{np.mean(tally.values):.5g}", f"{u:.2g}"
        cells[5] = f"{np.mean((np.array(tally.values) - tally.truth) / np.array(tally.stds)):+.2f}"
        cells[6] = f"{np.std(tally.values, ddof=1) / u:.2f}" if len(tally.values) > 1 else "–"
    low, high = wilson(tally.held, len(tally.values))
    share = 100 * tally.held / max(len(tally.values), 1)
    said = [f"{share:.0f} % [{100 * low:.0f}…{100 * high:.0f}]"] if tally.values else []
    said += [f"not told {tally.untold}"] if tally.untold else []
    return f"| {' | '.join([*cells, ', '.join(said)])} | {one.runs} |"


def main() -> None:
    """Run it."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seeds", type=int, default=100)
    asked.add_argument("--first", type=int, default=1)
    asked.add_argument("--only", default="", help="part of a valve's name")
    asked.add_argument("--jobs", type=int, default=os.cpu_count(), help="how many at a time")
    asked.add_argument("--page", type=Path, help="Markdown page to put the table into")
    given = asked.parse_args()
    asked_for = [(case, at) for case in CASES if given.only in case.name for at in case.commands]
    if not asked_for:
        asked.error(f"no valve is called '{given.only}'")
    tried_all = partial(tried, seeds=range(given.first, given.first + given.seeds))
    outcomes = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for one in pool.map(tried_all, *zip(*asked_for, strict=True)):
            outcomes.append(one)
            print(f"{one.case.name}, {one.range}: {one.runs} runs, fit {one.fit:.2f} %", flush=True)
            for note, count in sorted(one.notes.items(), key=lambda pair: -pair[1])[:6]:
                print(f"  {count} × {note}", flush=True)
            print(table([one]), flush=True)
    if given.page:
        put(given.page, "identified", table(outcomes))


if __name__ == "__main__":
    main()
