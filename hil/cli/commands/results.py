"""`hil results`: everything that a run found, as data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.options import argument, option

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.findings.results import Results


def command(
    run: Path = argument(..., "RUN", "Run folder."),
    csv: str = option("", "--csv", "FILE", "Write the values here, each curve as STEM_NAME.csv."),
    json: str = option("", "--json", "FILE", "Write everything as JSON, schema hil.results/1."),
    xlsx: str = option("", "--xlsx", "FILE", "Write everything as a spreadsheet."),
) -> None:
    """Every measured value, curve and transfer function of a run as data; FILE may be `-` for stdout."""
    from hil import api
    from hil.findings.tables import values_csv, write_csv, write_xlsx

    found = api.results(run)
    if not (csv or json or xlsx):
        typer.echo(_listed(found))
    _handed_on(csv, found, values_csv, lambda path: write_csv(found, path))
    _handed_on(json, found, lambda results: results.as_json(), lambda path: _write_json(found, path))
    if xlsx == "-":
        raise typer.BadParameter("a spreadsheet is no text; name a file", param_hint="--xlsx")
    _handed_on(xlsx, found, lambda _results: "", lambda path: write_xlsx(found, path))


def _handed_on(target: str, found: Results, text: Callable[[Results], str], write: Callable[[Path], object]) -> None:
    """To stdout or into a file, if it was asked for."""
    from hil.cli.places import check_file

    if target == "-":
        typer.echo(text(found), nl=False)
    elif target:
        check_file(Path(target))
        made = write(Path(target))
        for path in made if isinstance(made, tuple) else (target,):
            typer.echo(f"{path}: written", err=True)


def _write_json(found: Results, path: Path) -> None:
    from hil.errors import storing
    from hil.record.durable import write_named

    with storing(path):
        write_named(path, found.as_json())


def _listed(found: Results) -> str:
    """The values as `hil run` prints them, then what else there is."""
    from hil.findings.collect import findings_of
    from hil.report.terminal import findings_text, typed

    lines = [findings_text(findings_of(found), simulated=bool(found.simulated), ended=found.ended or "")]
    lines += [one.line for one in found.transfer_functions]
    lines += [f"curve: {curve.name} ({len(curve.rows)} rows)" for curve in found.curves]
    return typed("\n".join(lines))
