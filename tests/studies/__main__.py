"""`python -m tests.studies`: what is said of units whose structure is not the library's, changed and unchanged."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import track

from tests.studies.cases import CONDITIONS, Case, Outcome, cases_of, examined, seal, skeletons
from tests.studies.jobs import finished
from tests.studies.table import as_json, as_text, draw


def main(
    units: int = typer.Option(3, min=1, help="Units of each skeleton, drawn anew."),
    changes: int = typer.Option(2, min=0, help="Changes of each unit; it is asked unchanged too."),
    seed: int = typer.Option(1, help="Seed of all units, recordings and changes."),
    only: str = typer.Option("", help="Skeletons that take part, separated by commas; all if empty."),
    jobs: int = typer.Option(2, min=1, help="Processes."),
    out: Path = typer.Option(Path("proof-wrong"), help="Folder for recordings and answers; a stopped study goes on."),
    condition: str = typer.Option(
        "", help=f"What is taken away: {', '.join(filter(None, CONDITIONS))}; nothing if empty."
    ),
    only_seal: bool = typer.Option(False, "--seal", help="Print the hash of all truths, and do nothing else."),
    plot: Path | None = typer.Option(None, help="Draw naming over the size of the change into this file (.svg)."),
    in_json: bool = typer.Option(False, "--json", help="Print counts with exact intervals as JSON."),
) -> None:
    """Count alarms on unchanged units, and changes that are noticed, named rightly and named wrongly."""
    chosen = [name for name in skeletons() if not only or name in only.split(",")]
    drawn = cases_of(chosen, units, changes, seed)
    if condition not in CONDITIONS:
        raise typer.BadParameter(f"{condition!r} is none of {', '.join(filter(None, CONDITIONS))}")
    if only_seal:
        print(seal(drawn))
        return
    found = _all(drawn, jobs, out, condition)
    if plot is not None:
        draw(found, plot)
    if in_json:
        print(json.dumps(as_json(found)))
    else:
        print(as_text(found))


def _all(units: Sequence[Sequence[Case]], jobs: int, out: Path, condition: str) -> list[Outcome]:
    done = finished(examined, [(unit, out, condition) for unit in units], jobs)
    shown = track(done, "units", total=len(units), console=Console(stderr=True))
    return sorted((one for _, unit in shown for one in unit), key=lambda one: one.case)


if __name__ == "__main__":
    typer.run(main)
