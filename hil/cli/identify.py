"""`hil identify`: fit a plant's parameters to recordings."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.reading import Columns, Gaps, Inputs, Interval, Output, Rename, Time, Unit


def command(
    recordings: list[Path] = typer.Argument(
        ..., metavar="RECORDING...", help="Recordings or tables of a frequency response, fitted together."
    ),
    plant: str = typer.Option(..., "--plant", help="Name of a plant, or a model file to start from."),
    out: Path = typer.Option(..., "--out", help="Model file to write."),
    input_name: Inputs = [],  # noqa: B006 — typer makes a new one
    output_name: Output = "",
    free: list[str] = typer.Option(
        [], "--free", metavar="NAME,…", help="Also estimate these, held fixed otherwise; friction.coulomb of an effect."
    ),
    poles: int | None = typer.Option(None, "--poles", min=1, max=5, help="From a frequency response: so many poles."),
    zeros: int | None = typer.Option(None, "--zeros", min=0, max=5, help="From a frequency response: so many zeros."),
    dead_time: bool | None = typer.Option(
        None, "--dead-time/--no-dead-time", help="From a frequency response: with a dead time, or without."
    ),
    weights: str = typer.Option(
        "", "--weights", metavar="relative|uniform", help="Of lines without uncertainty: of their size, or all alike."
    ),
    part: str = typer.Option("", "--part", metavar="NAME", help="Of a run with several frequency responses, this one."),
    time: Time = "",
    interval: Interval = 0.0,
    unit: Unit = [],  # noqa: B006
    rename: Rename = [],  # noqa: B006
    columns: Columns = "",
    gaps: Gaps = False,
) -> None:
    """Fit a plant's parameters to all recordings together and write a model file."""
    from hil.cli.places import check_distinct, check_file
    from hil.cli.reading import notes_on, reading_of, say
    from hil.identification.table_fit import orders_of
    from hil.physics.model import save_model
    from hil.record.response_table import ResponseTable
    from hil.session.identification import identified, read_for

    check_distinct(recordings)
    check_file(out, recordings)
    read = read_for(plant, recordings, reading_of(time, interval, unit, rename, columns, gaps), part)
    asked = [name for names in free for name in names.split(",") if name]
    found = identified(plant, read, asked, input_name, output_name, orders_of(poles, zeros, dead_time, weights))
    save_model(found.model, out)
    experiments = () if isinstance(read[0], ResponseTable) else found.experiments
    say(notes_on(read, experiments))
    typer.echo(found.text)
