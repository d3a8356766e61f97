"""`hil average`: the mean of several frequency responses."""

from __future__ import annotations

from pathlib import Path

from hil.cli.options import Json, Part, argument, option
from hil.cli.printed import printed
from hil.cli.reading import takes_reading
from hil.record.reading import Reading


@takes_reading
def command(
    responses: list[Path] = argument(
        ..., "TABLE|RUN...", "Tables of a frequency response, installed ones by name, or runs."
    ),
    out: Path = option(..., "--out", help="Table to write, .csv."),
    normalised: bool = option(False, "--normalised", help="Each over its gain at the lowest frequency first."),
    part: Part = "",
    as_json: Json = False,
    *,
    reading: Reading,
) -> None:
    """Write the mean of frequency responses on the same frequencies: mean dB and mean phase."""
    from hil import api
    from hil.cli.places import check_distinct, check_file

    check_distinct(responses)
    check_file(out, responses)
    mean = api.average(responses, normalised=normalised, reading=reading, part=part)
    api.write(mean, out)
    document = {"file": out, "frequencies": len(mean), "unit": mean.unit, "assumed": mean.meta["assumed"]}
    words = f"{out}: {len(mean)} frequencies, {mean.meta['assumed'][0]}"
    printed({"schema": "hil.averaged/1", **document}, words, as_json)
