"""`hil compare`: how well a model fits recordings, and where it fails."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.reading import Columns, Gaps, Inputs, Interval, Output, Rename, Time, Unit


def command(
    recordings: list[Path] = typer.Argument(
        ..., metavar="RECORDING...", help="Recordings or tables of a frequency response to compare with."
    ),
    model: Path = typer.Option(..., "--model", help="Model file."),
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
    input_name: Inputs = [],  # noqa: B006 — typer makes a new one
    output_name: Output = "",
    time: Time = "",
    interval: Interval = 0.0,
    unit: Unit = [],  # noqa: B006
    rename: Rename = [],  # noqa: B006
    columns: Columns = "",
    gaps: Gaps = False,
) -> None:
    """Compare a model with recordings: fit, ceiling by the noise, and where the model fails."""
    from hil.cli.reading import notes_on, reading_of, say
    from hil.identification.compare import compare
    from hil.identification.experiment import for_model
    from hil.identification.table_fit import compare_table
    from hil.physics.model import load_model
    from hil.record.plain import to_json
    from hil.record.read import read_any
    from hil.record.response_table import ResponseTable

    loaded = load_model(model)
    read = [read_any(path, reading_of(time, interval, unit, rename, columns, gaps)) for path in recordings]
    found = [
        compare_table(loaded, one)
        if isinstance(one, ResponseTable)
        else compare(loaded, for_model(loaded, one, input_name, output_name))
        for one in read
    ]
    notes = notes_on(read)
    say(notes, aside=as_json)
    if as_json:
        typer.echo(to_json({"schema": "hil.compare/1", "model": str(model), "recordings": [c.as_dict() for c in found],
                            "assumed": notes}))  # fmt: skip
    else:
        typer.echo("\n".join(c.as_text() for c in found))
