"""`hil simulate`: the model's output on a recording's input."""

from __future__ import annotations

from pathlib import Path

import typer


def command(
    model: Path = typer.Option(..., "--model", help="Model file."),
    recording: Path = typer.Option(..., "--input", help="Recording whose input drives the model."),
    out: Path = typer.Option(..., "--out", help="File to write: time and output, the same rows."),
    input_name: str = typer.Option("", "--input-name", help="Input channel, if not the plant's own name."),
    output_name: str = typer.Option("", "--output-name", help="Output channel, if not the plant's own name."),
) -> None:
    """Simulate a model on a recording's input.

    Of the recording's output only the first sample is used, to set the initial state.
    """
    from hil.cli.places import check_file
    from hil.identification.experiment import for_model
    from hil.physics.model import load_model
    from hil.record.read import read_recording, write_recording
    from hil.record.recording import recording as make

    check_file(out, (model, recording))
    loaded = load_model(model)
    read = read_recording(recording)
    bound = for_model(loaded, read, input_name, output_name, output_needed=False)
    simulated = bound.respond(loaded.definition, loaded.values, loaded.active_effects)[0]
    write_recording(make(str(out), read.time_s, {loaded.output: simulated}), out)
