"""`python -m tests.studies.proof.real --recordings DIR`: what the diagnosis makes of real recordings."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table

from tests.studies.markdown import put

from .prove import Outcome, prove
from .publish import HEADINGS, START, STOP, cells, markdown, parameters
from .sets import SETS


def main(
    recordings: Path = typer.Option(..., help="Folder with one folder for each set of recordings."),
    only: str = typer.Option("", help="Sets to run, by the beginning of their name, separated by commas."),
    page: Path | None = typer.Option(None, help="Page of documentation to put the tables into."),
) -> None:
    """Diagnose every set of real recordings from its nominal model, and judge on what was kept back."""
    if not recordings.is_dir():
        _refuse(f"{recordings}: no such folder; real recordings are not part of the project, --recordings names them")
    if page is not None and (not page.is_file() or START not in page.read_text(encoding="utf-8")):
        _refuse(f"{page}: no page with a line '{START}' to put the tables after")
    chosen = [real for real in SETS if not only or real.name.startswith(tuple(only.split(",")))]
    missing = [real for real in chosen if not (recordings / real.folder).is_dir()]
    if len(missing) == len(chosen):
        _refuse(f"{recordings}: none of {', '.join(sorted({real.folder for real in chosen}))} is in it")
    console = Console()
    for real in missing:
        console.print(f"{real.name}: not run, {recordings / real.folder} is absent")
    outcomes = []
    for real in chosen:
        if real not in missing:
            console.print(f"{real.name} …")
            outcomes.append(prove(real, recordings))
    _show(outcomes, console)
    if page is not None:
        put(page, START, STOP, markdown(outcomes))


def _show(outcomes: list[Outcome], console: Console) -> None:
    table = Table(title="Real recordings: fit %, nominal → corrected", title_justify="left", pad_edge=False)
    for heading in HEADINGS:
        table.add_column(heading)
    for outcome in outcomes:
        table.add_row(*cells(outcome))
    console.print(table)
    for outcome in outcomes:
        if not outcome.failure:
            console.print(f"{outcome.real.name}: {parameters(outcome)}")
    console.print("In brackets: describes the recordings, but the evidence does not suffice to name it.", style="dim")


def _refuse(message: str) -> None:
    typer.echo(message, err=True)
    raise typer.Exit(2)


if __name__ == "__main__":
    typer.run(main)
