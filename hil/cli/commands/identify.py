"""`hil identify`: fit a plant's parameters to recordings."""

from __future__ import annotations

from pathlib import Path

from hil.cli.options import Json, Language, Part, argument, option
from hil.cli.printed import printed
from hil.cli.reading import Inputs, Output, takes_reading, teller
from hil.record.reading import Reading


@takes_reading
def command(
    recordings: list[Path] = argument(
        ..., "RECORDING...", "Recordings or tables of a frequency response, fitted together."
    ),
    plant: str = option(..., "--plant", help="Plant, or a model to start from: its file or its name."),
    out: Path = option(..., "--out", help="Model file to write."),
    input_name: Inputs = [],  # noqa: B006 — typer makes a new one
    output_name: Output = "",
    free: list[str] = option(
        [], "--free", "NAME,…", "Also estimate these, held fixed otherwise; friction.coulomb of an effect."
    ),
    poles: int | None = option(None, "--poles", min=1, max=5, help="Of a transfer function: so many poles."),
    zeros: int | None = option(None, "--zeros", min=0, max=5, help="Of a transfer function: so many zeros."),
    dead_time: bool | None = option(
        None, "--dead-time/--no-dead-time", help="Of a transfer function: with a dead time, or without."
    ),
    weights: str = option(
        "", "--weights", "relative|uniform", "Of lines without uncertainty: of their size, or all alike."
    ),
    part: Part = "",
    page: Path | None = option(
        None, "--page", "FILE.html", "A page that draws the model beside what it was fitted to."
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
    printed({**found.as_dict(), "assumed": assumed}, found.text, as_json)
