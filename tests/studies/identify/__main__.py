"""`python -m tests.studies.identify`: the study and its table in a file."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import typer

from tests.studies.coverage.table import HEADINGS, row
from tests.studies.identify.cases import CASES
from tests.studies.identify.study import Outcome, tried
from tests.studies.jobs import finished
from tests.studies.markdown import head, put


def table(outcomes: Iterable[Outcome]) -> str:
    """A section for each valve, a line for each parameter at each range."""
    made = []
    for title, group in groupby(outcomes, key=lambda one: one.case.name):
        made += [f"### {title}", "", *head(("parameter", "range", *HEADINGS[2:]))]
        made += [row(name, one.range, tally, one.runs) for one in group for name, tally in one.tallies.items()]
        made.append("")
    return "\n".join(made)


def main(
    seeds: int = typer.Option(100, min=1, help="How many."),
    first: int = typer.Option(1, help="The first of them."),
    only: str = typer.Option("", help="Part of a valve's name."),
    jobs: int = typer.Option(2, min=1, help="Processes."),
    page: Path | None = typer.Option(None, exists=True, help="Markdown file to put the table into."),
) -> None:
    """Count how often intervals of identified parameters hold the truth."""
    asked_for = [(case, at) for case in CASES if only in case.name for at in case.commands]
    if not asked_for:
        raise typer.BadParameter(f"no valve is called '{only}'")
    outcomes = dict[int, Outcome]()
    for number, one in finished(tried, [(*one, range(first, first + seeds)) for one in asked_for], jobs):
        outcomes[number] = one
        print(f"{one.case.name}, {one.range}: {one.runs} runs, fit {one.fit:.2f} %", flush=True)
        for note, count in sorted(one.notes.items(), key=lambda pair: -pair[1])[:6]:
            print(f"  {count} × {note}", flush=True)
        print(table([one]), flush=True)
    if page is not None:
        put(page, "<!-- begin -->", "<!-- end -->", table(outcomes[number] for number in sorted(outcomes)))


if __name__ == "__main__":
    typer.run(main)
