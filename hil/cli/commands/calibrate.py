"""`hil calibrate`: slope and offset of a channel against a reference, written into the bench file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.options import Archive, Json, Operator, argument, option
from hil.cli.printed import printed
from hil.cli.quantity import quantity
from hil.cli.typed import Typed
from hil.errors import SettingError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.bench.read import BenchFile
    from hil.safety.outputs import Outputs
    from hil.session.calibration import Calibrated


def command(
    bench: Path = argument(..., "BENCH.toml", "Bench file; it is changed when that is confirmed."),
    channel: str = argument(..., "CHANNEL", "An input, or an output."),
    reference: str = option("", "--reference", "TEXT", "What it is compared with, in words."),
    certificate: Path | None = option(
        None, "--certificate", "FILE.xml", "Instead of a reference: the sensor's Digital Calibration Certificate (DCC)."
    ),
    table: str = option("", "--table", "NAME", "Its table of results, where it has several."),
    reference_uncertainty: str = option(
        "", "--reference-uncertainty", "U", "Expanded (k = 2) uncertainty of each of its readings: '0.2 bar'."
    ),
    points: int = option(5, "--points", "N", "At how many places.", min=2, max=1000),
    between: str = option("", "--between", "LOW..HIGH", "Where an output goes; default: its limits."),
    operator: Operator = "",
    valid_days: int = option(365, "--valid-days", "N", "It is due again after so long.", min=1),
    out: Path | None = option(None, "--out", help="Run folder of an output; default: runs/jog-<time>."),
    archive: Archive = "",
    yes: bool = option(False, "--yes", help="Write it without asking."),
    as_json: Json = False,
) -> None:
    """Slope and offset of a channel against a reference, with their uncertainty; written when that is confirmed.

    At each point the reference's reading is asked for: an input is averaged for a second, with no output opened; an
    output is driven through the guard and held until the answer is there, then goes back. The bench file keeps its
    comments, and the values before in a history. A certificate has the points in it: nothing is opened then.
    """
    from hil import api
    from hil.api.bench import bench_of
    from hil.bench.find import own_bench
    from hil.cli.run_end import entered, safely

    file = bench_of(bench)
    own_bench(file.path)
    if channel not in file.bench.channels:
        raise UnknownNameError("channel", channel, file.bench.channels)
    unit = file.bench.channels[channel].unit
    expanded = quantity(reference_uncertainty, unit, "--reference-uncertainty") if reference_uncertainty else None
    ends = between.partition("..")
    limits = (quantity(ends[0], unit, "--between"), quantity(ends[2], unit, "--between")) if between else None
    typed = Typed()
    folder = None if certificate or not reference else _folder(file, channel, out)

    def ask_all(output_states: Outputs | None = None) -> Calibrated:
        return api.calibrate(
            file, channel, reference, _answers(typed, unit), points=points, between=limits, operator=operator,
            reference_uncertainty=expanded, valid_days=valid_days, out=folder or out or "", ask=_ask,
            outputs=output_states, certificate=certificate or "", table=table,
        )  # fmt: skip

    if folder is None:
        found = ask_all()
    else:
        found = safely(ask_all, folder, archive)
        entered(archive, folder)
    typer.echo(_described(found, reference_stated=bool(certificate) or expanded is not None), err=as_json)
    written = yes or _confirmed(f"write this into {bench}? [y/N] ", typed)
    if written:
        found.write()
    typer.echo(f"{'written into' if written else 'not written:'} {bench}", err=as_json)
    document = {"schema": "hil.calibrate/1", "channel": channel, "unit": unit, "points": found.points}
    more = {"line": found.line, "calibration": found.entry.model_dump(), "written": written}
    printed({**document, **more}, "", as_json)


def _folder(file: BenchFile, channel: str, out: Path | None) -> Path | None:
    """Where an output's run is recorded; an input has none."""
    from hil.archive.place import DEFAULT_FOLDER
    from hil.cli.places import check_folder
    from hil.session.labels import new_folder

    if not file.bench.channels[channel].is_output:
        return None
    folder = out or new_folder(DEFAULT_FOLDER, "jog", "")
    check_folder(folder)
    return folder


def _ask(text: str) -> None:
    """Beside what the command prints."""
    typer.echo(text, nl=False, err=True)


def _answers(typed: Typed, unit: str) -> Callable[[], float | None]:
    """What was typed as a number in the channel's unit; what is none is asked for again."""

    def answered() -> float | None:
        line = typed.line()
        try:
            return None if line is None else quantity(line, unit, "the reference")
        except SettingError as error:
            _ask(f"{error}; again: ")
            return None

    return answered


def _described(found: Calibrated, *, reference_stated: bool) -> str:
    from hil.bench.manual.write import narrowed

    file, channel, points, line, new = found.file, found.channel, found.points, found.line, found.entry
    entry = file.bench.channels[channel]
    raw_unit = file.terminal_of(entry).unit
    per = f"{entry.unit} per {raw_unit}"
    rows = [f"  {point.raw:12.6g} {raw_unit}  {point.reference:12.6g} {entry.unit}  residual {rest:+.3g} {entry.unit}"
            for point, rest in zip(points, line.residuals, strict=True)]  # fmt: skip
    span = max(p.reference for p in points) - min(p.reference for p in points)
    bent = (
        f"largest residual {line.non_linearity:.3g} {entry.unit}, {100.0 * line.non_linearity / span:.2g} % of the span"
    )
    verdict = (
        "more than the stated uncertainties can make: not straight, or the reference is worse than stated"
        if line.exceeds
        else "as the stated uncertainties make it" if reference_stated
        else "what the reference has of it cannot be told without --reference-uncertainty"
    )  # fmt: skip
    lines = [
        *rows,
        f"slope  {new.slope:.6g} ± {line.slope_interval:.2g} {per} (95 %; before: {entry.line.slope:.6g})",
        f"offset {new.offset:.6g} ± {line.offset_interval:.2g} {entry.unit} (95 %; before: {entry.line.offset:.6g})",
        f"non-linearity: {bent}; {verdict}",
        f"a value read through it: ± {line.uncertainty:.3g} {entry.unit} (k = 2); due {new.due}",
    ]
    if entry.safe is not None:
        before, after = entry.line.raw_at(entry.safe), (entry.safe - new.offset) / new.slope
        lines.append(
            f"its safe value {entry.safe:g} {entry.unit} becomes {after:.5g} {raw_unit} (before: {before:.5g})"
        )
    for key, value in narrowed(file, channel, new).items():
        lines.append(f"limits.{key} becomes {value:g} {entry.unit}: its terminal gives no more")
    return "\n".join(lines)


def _confirmed(question: str, typed: Typed) -> bool:
    _ask(question)
    return typed.waited().lower() in ("y", "yes")
