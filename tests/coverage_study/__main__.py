"""`python -m tests.coverage_study`: the study, its table on a page, and what falls short."""

from __future__ import annotations

import argparse
import math
import os
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from tests.coverage_study.cases import CASES, WITHOUT_TRUTH, Case
from tests.coverage_study.page import put
from tests.coverage_study.situations import Situation
from tests.coverage_study.study import Outcome, keep, kept, tried
from tests.coverage_study.table import short, summary, table, verdicts


def main() -> None:
    """Run it."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seeds", type=int, default=300)
    asked.add_argument("--first", type=int, default=1000)
    asked.add_argument("--only", default="", help="part of `procedure bench`")
    asked.add_argument("--situation", default="", help="part of a situation's name")
    asked.add_argument("--limit-s", type=float, default=math.inf, help="processor time of each case and situation")
    asked.add_argument("--jobs", type=int, default=os.cpu_count(), help="how many at a time")
    asked.add_argument("--keep", type=Path, help="folder of outcomes: what is there is not run again")
    asked.add_argument("--page", type=Path, help="Markdown page to put the table into")
    asked.add_argument("--verdicts", action="store_true", help="instead: wrong verdicts of a limit at the truth")
    asked.add_argument("--brief", action="store_true", help="only what falls short")
    given = asked.parse_args()
    seeds = range(given.first, given.first + given.seeds)
    asked_for = list(_asked_for(given.only, given.situation))
    if not asked_for:
        asked.error(f"no case is called '{given.only}' with a situation '{given.situation}'")
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(given.jobs) as pool:
        one_of = partial(_outcome, seeds=seeds, limit_s=given.limit_s, folder=Path(folder), keep_in=given.keep)
        for one in pool.map(one_of, *zip(*asked_for, strict=True)):
            outcomes.append(one)
            if not given.brief:
                print(f"{one.case.procedure} on {one.case.bench}, {one.situation.name}: {one.runs} runs", flush=True)
    made = verdicts(outcomes) if given.verdicts else f"{summary(outcomes)}\n\n{table(outcomes)}"
    if given.page:
        put(given.page, "verdicts" if given.verdicts else "coverage", made)
    if not given.brief:
        print(made)
    print("\n".join(short(outcomes)) or "every figure holds")
    for one in outcomes:
        for name in sorted(one.strange):
            if name.partition(", ")[0] not in WITHOUT_TRUTH:
                print(f"no truth: {one.case.procedure} on {one.case.bench}, {one.situation.name}: {name}")


def _asked_for(only: str, situation: str) -> Iterator[tuple[Case, Situation]]:
    for case in CASES:
        if only in f"{case.procedure} {case.bench}":
            yield from ((case, one) for one in case.situations if situation in one.name)


def _outcome(
    case: Case, situation: Situation, seeds: range, limit_s: float, folder: Path, keep_in: Path | None
) -> Outcome:  # fmt: skip
    """One case in one situation, run or kept from before."""
    name = f"{case.procedure}-{case.bench}-{situation.name.replace(' ', '-')}"
    file = None if keep_in is None else keep_in / f"{name}.json"
    found = None if file is None else kept(file, case, situation)
    if found is None:
        found = tried(case, situation, seeds, folder / name, limit_s)
        if file is not None:
            keep(file, found)
    return found


if __name__ == "__main__":
    main()
