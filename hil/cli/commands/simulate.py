"""`hil simulate`: the model's output on a recording's input."""

from __future__ import annotations

from pathlib import Path

from hil.cli.options import Json, option
from hil.cli.printed import printed
from hil.cli.reading import takes_reading, teller
from hil.record.reading import Reading


@takes_reading
def command(
    model: Path = option(..., "--model", help="Model file."),
    recording: Path = option(..., "--input", help="Recording whose input drives the model."),
    out: Path = option(..., "--out", help="File to write: time and output, the same rows."),
    input_name: list[str] = option(
        [], "--input-name", "NAME", "Input channel, if not called so; again for a second one."
    ),
    output_name: str = option("", "--output-name", "NAME", "Output channel, if not called so."),
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Simulate a model on a recording's input.

    Of the recording's output only the first sample is used, to set the initial state. Where the output was sampled at
    times of its own, the rows are those.
    """
    from hil import api
    from hil.cli.places import check_file

    check_file(out, (model, recording))
    assumed: list[str] = []
    notes = teller(aside=as_json, kept=assumed)
    simulated = api.simulate(model, recording, inputs=input_name, output=output_name, reading=reading, notes=notes)
    api.write(simulated, out)
    outputs = [{"name": channel.name, "unit": channel.unit} for channel in simulated.channels.values()]
    document = {"file": out, "samples": len(simulated), "duration_s": simulated.duration_s, "outputs": outputs}
    printed({"schema": "hil.simulated/1", **document, "assumed": assumed}, "", as_json)
