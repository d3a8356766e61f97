"""`hil identify`: fit a plant's parameters to recordings."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.options import Json, Language, Part
from hil.cli.reading import Inputs, Output, takes_reading, teller
from hil.record.reading import Reading


@takes_reading
def command(
    recordings: list[Path] = typer.Argument(
        ..., metavar="RECORDING...", help="Recordings or tables of a frequency response, fitted together."
    ),
    plant: str = typer.Option(..., "--plant", help="Plant, or a model to start from: its file or its name."),
    out: Path = typer.Option(..., "--out", help="Model file to write."),
    input_name: Inputs = [],  # noqa: B006 — typer makes a new one
    output_name: Output = "",
    free: list[str] = typer.Option(
        [], "--free", metavar="NAME,…", help="Also estimate these, held fixed otherwise; friction.coulomb of an effect."
    ),
    poles: int | None = typer.Option(None, "--poles", min=1, max=5, help="Of a transfer function: so many poles."),
    zeros: int | None = typer.Option(None, "--zeros", min=0, max=5, help="Of a transfer function: so many zeros."),
    dead_time: bool | None = typer.Option(
        None, "--dead-time/--no-dead-time", help="Of a transfer function: with a dead time, or without."
    ),
    weights: str = typer.Option(
        "", "--weights", metavar="relative|uniform", help="Of lines without uncertainty: of their size, or all alike."
    ),
    part: Part = "",
    page: Path | None = typer.Option(
        None, "--page", metavar="FILE.html", help="A page that draws the model beside what it was fitted to."
    ),
    as_json: Json = False,
    language: Language = "",  # noqa: ARG001 — its callback takes it
    *,
    reading: Reading,
) -> None:
    """Fit a plant's parameters to all recordings together and write a model file."""
    from hil import api
    from hil.cli.places import check_distinct, check_file
    from hil.cli.progress import shown
    from hil.record.plain import to_json

    check_distinct(recordings)
    check_file(out, recordings)
    if page is not None:
        check_file(page, (out, *recordings))
    assumed: list[str] = []
    with shown() as progress:
        found = api.identify(
            recordings, plant, free=[name for names in free for name in names.split(",") if name], inputs=input_name,
            output=output_name, poles=poles, zeros=zeros, dead_time=dead_time, weights=weights, part=part,
            reading=reading, page=page or "",
            notes=teller(aside=as_json, kept=assumed), progress=progress,
        )  # fmt: skip
    api.save_model(found.model, out)
    typer.echo(to_json({**found.as_dict(), "assumed": assumed}) if as_json else found.text)
