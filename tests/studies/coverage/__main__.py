"""`python -m tests.studies.coverage`: the study, its table in a file, and what falls short."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import typer

from tests.studies.coverage.cases import CASES, WITHOUT_TRUTH, Case
from tests.studies.coverage.situations import Situation
from tests.studies.coverage.study import Outcome, keep, kept, tried
from tests.studies.coverage.table import short, summary, table, verdicts
from tests.studies.jobs import finished
from tests.studies.markdown import put


def main(
    seeds: int = typer.Option(300, min=1, help="How many."),
    first: int = typer.Option(1000, help="The first of them."),
    only: str = typer.Option("", help="Part of `procedure bench`."),
    situation: str = typer.Option("", help="Part of a situation's name."),
    limit_s: float = typer.Option(math.inf, help="Processor time of each case and situation."),
    jobs: int = typer.Option(2, min=1, help="Processes."),
    keep_in: Path | None = typer.Option(None, "--keep", help="Folder of outcomes: what is there is not run again."),
    page: Path | None = typer.Option(None, exists=True, help="Markdown file to put the table into."),
    of_verdicts: bool = typer.Option(False, "--verdicts", help="Instead: wrong verdicts of a limit at the truth."),
    brief: bool = typer.Option(False, "--brief", help="Print what falls short alone."),
) -> None:
    """Count how often what procedures print holds the truth."""
    asked_for = list(_asked_for(only, situation))
    if not asked_for:
        raise typer.BadParameter(f"no case is called '{only}' with a situation '{situation}'")
    found = dict[int, Outcome]()
    with tempfile.TemporaryDirectory() as folder:
        more = (range(first, first + seeds), limit_s, Path(folder), keep_in)
        for number, one in finished(_outcome, [(*one, *more) for one in asked_for], jobs):
            found[number] = one
            if not brief:
                print(f"{one.case.procedure} on {one.case.bench}, {one.situation.name}: {one.runs} runs", flush=True)
    outcomes = [found[number] for number in sorted(found)]
    made = verdicts(outcomes) if of_verdicts else f"{summary(outcomes)}\n\n{table(outcomes)}"
    if page is not None:
        place = "verdicts" if of_verdicts else "coverage"
        put(page, f"<!-- {place}: begin -->", f"<!-- {place}: end -->", made)
    if not brief:
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
    typer.run(main)
