"""`python -m tests.studies.proof`: the concealment proof."""

from __future__ import annotations

import math
import time
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from .cases.label import SEVERITIES
from .diagnosers import PYTHON, by_command_line
from .plan import ALL_PLANTS, Plan, kinds
from .publish import keep, show
from .run import OtherSealsError, prove


def main(
    cases: int = typer.Option(20, min=1, help="Cases for each effect and severity; the other kinds in proportion."),
    plants: str = typer.Option(",".join(ALL_PLANTS), help="Plants that take part, separated by commas."),
    severity: str = typer.Option("full", help=f"Severities of single effects: {', '.join(SEVERITIES)}."),
    only: str = typer.Option("", help="Kinds of case that take part, separated by commas; all if empty."),
    jobs: int = typer.Option(2, min=1, help="Processes."),
    seed: int = typer.Option(1, help="Seed of all cases."),
    out: Path = typer.Option(
        Path("proof"), help="Folder for truths, seals and results; a stopped proof goes on in it."
    ),
    brief: bool = typer.Option(False, "--brief", help="Hand over every other recording only; for many healthy units."),
    minutes: float = typer.Option(math.inf, min=0.0, help="Begin no case after so many minutes."),
    known: Path | None = typer.Option(
        None, exists=True, dir_okay=False, help="`proof.json` of an earlier run of the same cases, to go on from."
    ),
    python: Path | None = typer.Option(
        None, exists=True, dir_okay=False, help="Interpreter whose `hil` answers, a process a call: another version's."
    ),
) -> None:
    """Conceal effects, have them found, and print how often that succeeds."""
    plan = Plan(
        cases,
        _chosen(plants, ALL_PLANTS, "--plants"),
        _chosen(severity, tuple(SEVERITIES), "--severity"),
        _chosen(only, tuple(kinds()), "--only"),
    )
    console = Console()
    asked = PYTHON if python is None else by_command_line(python)
    begin_until_s = time.time() + 60.0 * minutes
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console
    ) as bar:
        task = bar.add_task("sealing", total=None)

        def tell(what: str, done: int, total: int) -> None:
            bar.update(task, description=what, completed=done, total=total)
            if what.startswith("seals"):
                bar.console.print(what)

        try:
            results, fingerprint = prove(
                plan.labels(), seed, out, asked, jobs, tell, 2 if brief else 1, begin_until_s, known
            )
        except OtherSealsError as error:
            raise typer.BadParameter(f"--known: {error}") from error
    show(results, console)
    keep(results, seed, fingerprint, out)
    console.print(f"{out / 'proof.md'}, {out / 'proof.json'}")


def _chosen(text: str, allowed: tuple[str, ...], option: str) -> tuple[str, ...]:
    chosen = tuple(name for name in text.split(",") if name)
    unknown = sorted(set(chosen) - set(allowed))
    if unknown:
        raise typer.BadParameter(f"{option}: unknown {', '.join(unknown)}; known: {', '.join(allowed)}")
    return chosen


if __name__ == "__main__":
    typer.run(main)
