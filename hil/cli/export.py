"""`hil export`: a model, or the transfer functions of a run, for another tool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from hil.session.export import Exported

_FORMS = ("python", "matlab", "json", "csv", "table", "c", "fmu")


def command(
    source: Path = typer.Argument(
        ..., metavar="MODEL.json|RUN", help="Model file, or run folder; of a table also a curve as CSV."
    ),
    to: str = typer.Option(..., "--to", metavar="|".join(_FORMS), help="For which tool."),
    out: str = typer.Option("-", "--out", metavar="FILE", help="File to write; `-` is stdout."),
    part: str = typer.Option("", "--part", metavar="NAME", help="Of a run: transfer functions with this in the name."),
    fmi: str = typer.Option("3", "--fmi", metavar="2|3", help="Version of FMI."),
    step_s: float | None = typer.Option(
        None, "--step", metavar="S", help="Internal step of C and FMU; the plant's own."
    ),
    effects: list[str] = typer.Option(
        [], "--effect", metavar="NAME@HOOK", help="Also bring this effect, switched off, for fault injection."
    ),
    platforms: str = typer.Option(
        "", "--platform", metavar="NAME,...", help="Binaries for these; default: this machine."
    ),
    points: int = typer.Option(0, "--points", metavar="N", help="Rows of a table: which command gives which flow."),
    sources_only: bool = typer.Option(False, "--sources-only", help="An FMU without binaries."),
) -> None:
    """Hand a model, or the transfer functions or the flow curve of a run, on to another tool.

    `c` is one C99 file, `fmu` a co-simulation FMU that needs no Python; it is run and compared with `hil simulate`.
    """
    from hil import api
    from hil.cli.places import check_file

    target = None if out == "-" else Path(out)
    if target is not None:
        check_file(target, [source])
    asked = [name.strip() for name in platforms.split(",") if name.strip()] or None
    found = api.export(
        source, to, target, part=part, fmi=fmi, step_s=step_s, effects=effects,
        platforms=[] if sources_only else asked, points=points,
    )  # fmt: skip
    if found.text and target is None:
        typer.echo(found.text, nl=False)
    elif not found.text:
        typer.echo("\n".join([*_lines(found, fmi if to == "fmu" else ""), *(f"note: {one}" for one in found.notes)]))


def _lines(found: Exported, fmi: str) -> list[str]:
    if not fmi:
        return [f"{found.path}: {found.title} in C99, {found.parameters} parameters"]
    ran = (
        "not run: it has no binary for this machine"
        if found.difference is None
        else f"differs from `hil simulate` by at most {found.difference:.1g} of full scale"
        if found.difference
        else "run here: the same as `hil simulate`, to the last digit"
    )
    return [f"{found.path}: FMI {fmi}, {', '.join(found.platforms) or 'sources only'}", ran]
