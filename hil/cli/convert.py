"""`hil convert`: a recording in another format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from hil.record.recording import Recording


def command(
    source: Path = typer.Argument(..., metavar="SRC", help="Recording or run folder to read."),
    target: Path = typer.Argument(..., metavar="DST", help="File to write; its ending says the format."),
    unit: list[str] = typer.Option([], "--unit", metavar="NAME=UNIT", help="State a channel's unit, as in flow=l/min."),
    overwrite: bool = typer.Option(False, "--overwrite", help="Replace DST if it exists."),
) -> None:
    """Convert a recording between formats; DST without an ending becomes a run folder."""
    from hil.cli.places import check_file
    from hil.errors import FileError
    from hil.record.read import read_recording, write_recording

    if target.exists() and not overwrite:
        raise FileError(f"{target}: exists already; --overwrite replaces it")
    if not target.is_dir():  # a run folder that exists is refused where it would be made
        check_file(target)
    read = read_recording(source)
    found = read.with_units(_pairs(unit))
    write_recording(found, target)
    channels = ", ".join(channel.heading for channel in found.channels.values())
    typer.echo(f"{target}: {len(found)} samples, {found.duration_s:g} s, {channels}")
    missing = [f"no unit is stated for '{name}', taken as 1" for name in found.meta.get("units_missing", ())]
    for sentence in (*found.meta.get("assumed", ()), *missing, *_restated(read, found)):
        typer.echo(f"note: {sentence}")


def _restated(read: Recording, found: Recording) -> list[str]:
    """What `--unit` says of a channel whose unit the file stated: its numbers stay as they are."""
    without = read.meta.get("units_missing", ())
    return [
        f"'{name}' was in {channel.unit} and is now said to be in {found.channel(name).unit}; its numbers are the same"
        for name, channel in read.channels.items()
        if name not in without and channel.unit != found.channel(name).unit
    ]


def _pairs(texts: list[str]) -> dict[str, str]:
    from hil.errors import SettingError

    for text in texts:
        if not all(text.partition("=")):
            raise SettingError(f"--unit {text}: NAME=UNIT was expected, as in 'flow=l/min'")
    return {name.strip(): unit.strip() for name, _, unit in (text.partition("=") for text in texts)}
