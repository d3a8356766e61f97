"""`hil archive`: the index of the runs."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.runs import ARCHIVE

group = typer.Typer(no_args_is_help=True, help="Look after the index of the runs.")


@group.callback()
def _archive() -> None:
    """Look after the index of the runs."""


@group.command()
def rebuild(
    archive: str = ARCHIVE,
    folders: list[Path] = typer.Option([], "--folder", metavar="DIR", help="Also search this folder for runs."),
) -> None:
    """Make the index anew from the run folders."""
    from hil.archive.archive import rebuild as rebuilt
    from hil.archive.place import archive_place

    place = archive_place(archive)
    count, left_out = rebuilt(place, [*([place.folder] if place.folder else []), *folders])
    for sentence in left_out:
        typer.echo(f"left out: {sentence}", err=True)
    typer.echo(f"{place}: {count} runs")
