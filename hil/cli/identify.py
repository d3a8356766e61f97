"""`hil identify`: fit a plant's parameters to recordings."""

from __future__ import annotations

from pathlib import Path

import typer


def command(
    recordings: list[Path] = typer.Argument(..., metavar="RECORDING...", help="Recordings, fitted together."),
    plant: str = typer.Option(..., "--plant", help="Name of a plant, or a model file to start from."),
    out: Path = typer.Option(..., "--out", help="Model file to write."),
    input_name: str = typer.Option("", "--input", help="Input channel, if not the plant's own name."),
    output_name: str = typer.Option("", "--output", help="Output channel, if not the plant's own name."),
    free: list[str] = typer.Option([], "--free", help="Also estimate this parameter, held fixed otherwise."),
) -> None:
    """Fit a plant's parameters to all recordings together and write a model file."""
    from hil.cli.places import check_distinct, check_file
    from hil.identification.experiment import experiment
    from hil.identification.grey_box import fit_plant, starting_model
    from hil.physics.model import save_model
    from hil.record.read import read_recording

    check_distinct(recordings)
    check_file(out, recordings)
    start = starting_model(plant, free)
    experiments = [
        experiment(read_recording(path), start.definition, input_name or None, output_name or None)
        for path in recordings
    ]
    found = fit_plant(start, experiments, free)
    save_model(found.model, out)
    typer.echo(found.summary())
