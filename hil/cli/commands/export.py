"""`hil export`: a model, or the transfer functions of a run, for another tool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.options import argument, option

if TYPE_CHECKING:
    from hil.session.export import Exported

_FORMS = ("python", "matlab", "json", "csv", "table", "c", "fmu")


def command(
    source: Path = argument(..., "MODEL.json|RUN", "Model file, or run folder; of a table also a curve as CSV."),
    to: str = option(..., "--to", "|".join(_FORMS), "For which tool."),
    out: str = option("-", "--out", "FILE", "File to write; `-` is stdout."),
    part: str = option("", "--part", "NAME", "Of a run: transfer functions with this in the name."),
    fmi: str = option("3", "--fmi", "2|3", "Version of FMI."),
    step_s: float | None = option(None, "--step", "S", "Internal step of C and FMU; the plant's own."),
    effects: list[str] = option(
        [], "--effect", "NAME@HOOK", "Also bring this effect, switched off, for fault injection."
    ),
    platforms: str = option("", "--platform", "NAME,...", "Binaries for these; default: this machine."),
    points: int = option(0, "--points", "N", "Rows of a table: which command gives which flow."),
    sources_only: bool = option(False, "--sources-only", help="An FMU without binaries."),
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
