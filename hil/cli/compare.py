"""`hil compare`: how well a model fits recordings, and where it fails."""

from __future__ import annotations

import json
from pathlib import Path

import typer


def command(
    recordings: list[Path] = typer.Argument(..., metavar="RECORDING...", help="Recordings to compare with."),
    model: Path = typer.Option(..., "--model", help="Model file."),
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
    input_name: str = typer.Option("", "--input", help="Input channel, if not the model's own."),
    output_name: str = typer.Option("", "--output", help="Output channel, if not the model's own."),
) -> None:
    """Compare a model with recordings: fit, ceiling by the noise, and where the model fails."""
    from hil.identification.compare import compare
    from hil.identification.experiment import for_model
    from hil.physics.model import load_model
    from hil.record.read import read_recording

    loaded = load_model(model)
    found = [compare(loaded, for_model(loaded, read_recording(path), input_name, output_name)) for path in recordings]
    if as_json:
        typer.echo(json.dumps({"model": str(model), "recordings": [c.as_dict() for c in found]}, indent=1))
    else:
        typer.echo("\n".join(c.as_text() for c in found))
