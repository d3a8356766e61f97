"""`hil convert`: a recording in another format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hil.cli.options import Json, argument, option
from hil.cli.printed import printed
from hil.cli.reading import options, takes_reading
from hil.errors import FileError, HilError
from hil.record.reading import Reading

if TYPE_CHECKING:
    from hil.record.recording import Recording
    from hil.record.table.response_table import ResponseTable


@takes_reading
def command(
    sources: list[Path] = argument(
        ..., "SRC...", "Recording, table or run folder to read; several recordings of one clock are joined."
    ),
    target: Path = argument(..., "DST", "File to write; its ending says the format."),
    overwrite: bool = option(False, "--overwrite", help="Replace DST if it exists."),
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Convert recordings between formats, several into one; DST without an ending becomes a run folder."""
    from hil import api
    from hil.cli.places import check_distinct, check_file
    from hil.record.invalid_samples import notes_of_reading
    from hil.record.table.joined import joined
    from hil.record.table.response_table import ResponseTable
    from hil.session.sources import all_samples

    if target.exists() and not overwrite:
        raise FileError(f"{target}: exists already; --overwrite replaces it")
    if not target.is_dir():  # a run folder that exists is refused where it would be made
        check_file(target)
    check_distinct(sources)
    if len(sources) == 1:
        found = api.read(sources[0], **options(reading))
    else:
        found = joined(all_samples(sources, reading))
    api.write(found, target)
    if isinstance(found, ResponseTable):
        notes = list(found.meta.get("assumed", ()))
    else:
        notes = [*notes_of_reading(found.meta), *(note for one in sources for note in _restated(found, one, reading))]
    if isinstance(found, ResponseTable):
        words = f"{target}: {len(found)} frequencies, {found.frequency_hz[0]:g} to {found.frequency_hz[-1]:g} Hz"
    else:
        channels = ", ".join(channel.heading for channel in found.channels.values())
        words = f"{target}: {len(found)} samples, {found.duration_s:g} s, {channels}"
    words = "\n".join([words, *(f"note: {sentence}" for sentence in notes)])
    printed({"schema": "hil.converted/1", "file": target, **_content(found), "assumed": notes}, words, as_json)


def _content(found: Recording | ResponseTable) -> dict[str, object]:
    from hil.record.table.response_table import ResponseTable

    if isinstance(found, ResponseTable):
        band = {"from_hz": found.frequency_hz[0], "to_hz": found.frequency_hz[-1], "unit": found.unit}
        return {"kind": "frequency response", "frequencies": len(found), **band}
    channels = [
        {"name": channel.name, "unit": channel.unit, "samples": len(found.samples(channel.name).values)}
        for channel in found.channels.values()
    ]
    return {"kind": "recording", "samples": len(found), "duration_s": found.duration_s, "channels": channels}


def _restated(found: Recording, source: Path, reading: Reading) -> list[str]:
    """What `--unit` says of a channel whose unit the file stated: its numbers stay as they are."""
    if not reading.units:
        return []
    from dataclasses import replace

    from hil.record.read import read_any
    from hil.record.recording import Recording

    try:
        read = read_any(source, replace(reading, units={}))
    except HilError:  # it can only be read with the units
        return []
    without = read.meta.get("units_missing", ())
    return [
        f"'{name}' was in {channel.unit} and is now said to be in {found.channels[name].unit}; its numbers are the same"
        for name, channel in (read.channels.items() if isinstance(read, Recording) else ())
        if name in found.channels and name not in without and channel.unit != found.channels[name].unit
    ]
