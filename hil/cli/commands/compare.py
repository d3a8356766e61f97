"""`hil compare`: a model beside recordings, two runs side by side, units in their population."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.options import Archive, Json, Language, argument, option
from hil.cli.places import check_file
from hil.cli.population import compare_population
from hil.cli.printed import in_short, printed
from hil.cli.reading import Inputs, Output, takes_reading, teller
from hil.record.reading import Reading

if TYPE_CHECKING:
    from hil.session.run_comparison import RunComparison

_SHOWN_AFTER_S = 2.0


@takes_reading
def command(
    recordings: list[Path] = argument(
        ..., "RECORDING...", "Recordings or tables of a frequency response; without --model two runs."
    ),
    model: Path | None = option(None, "--model", help="Model file."),
    page: Path | None = option(
        None, "--page", "FILE.html", "A page that draws the model beside the recordings, or two runs."
    ),
    population: bool = option(
        False, "--population", help="Runs of a unit, or of a batch, beside the other units of the archive."
    ),
    csv: Path | None = option(
        None, "--csv", "FILE.csv", "With --population: the limits of a batch, most missed first."
    ),
    archive: Archive = "",
    as_json: Json = False,
    input_name: Inputs = [],  # noqa: B006 — typer makes a new one
    output_name: Output = "",
    language: Language = "",  # noqa: ARG001 — its callback takes it
    *,
    reading: Reading,
) -> None:
    """Compare a model with recordings: fit, ceiling by the noise, and where the model fails.

    Without `--model`: two runs of one procedure, the earlier and the later, each change with its significance. Of one
    unit that failed and does no more these are *as found* and *as left*.
    With `--population`: each value of a unit beside mean and scatter of the other units that did the same
    procedure; of several units also yield, first-pass yield, Cpk and the limits that are missed most.
    """
    if csv is not None and not population:
        raise typer.BadParameter("--csv goes with --population")
    if population:
        if model is not None or page is not None:
            raise typer.BadParameter("--population goes with neither --model nor --page")
        compare_population(recordings, archive, as_json, csv)
        return
    if model is None:
        _compare_runs(recordings, as_json, page)
        return
    from hil import api
    from hil.cli.progress import shown

    if page is not None:
        check_file(page, (model, *recordings))
    assumed: list[str] = []
    with shown(_SHOWN_AFTER_S) as progress:
        found = api.compare(
            model, recordings, inputs=input_name, output=output_name, reading=reading,
            page=page or "", notes=teller(aside=as_json, kept=assumed), progress=progress,
        )  # fmt: skip
    document = {"schema": "hil.compare/1", "model": model, "recordings": [c.as_dict() for c in found]}
    printed({**document, "assumed": assumed}, "\n".join(c.as_text() for c in found), as_json)


def _compare_runs(runs: list[Path], as_json: bool, page: Path | None) -> None:
    from hil.session.run_comparison import compare_runs

    if len(runs) != 2:
        raise typer.BadParameter(f"two runs are compared, {len(runs)} given; with --model any number of recordings")
    found = compare_runs(*runs)
    if page is not None:
        from hil.report.comparison_page import write_comparison_page

        check_file(page)
        write_comparison_page(found.first, found.second, found.differences, found.one_bench, page)
    print_comparison(found, as_json)


def print_comparison(found: RunComparison, as_json: bool) -> None:
    """Print two runs side by side, in words or by schema `hil.run-comparison/1`."""
    rows = [
        {
            "name": one.name, "unit": one.unit,
            "first": in_short(one.first), "second": in_short(one.second),
            "change": one.change, "std": one.std, "chance": one.chance, "meaning": one.meaning,
        }
        for one in found.differences
    ]  # fmt: skip
    runs = (found.first, found.second)
    document = {
        "schema": "hil.run-comparison/1", "runs": [one.run for one in runs],
        "started_utc": [one.started_utc for one in runs],
        "serials": [one.serial for one in runs], "simulated": [one.simulated for one in runs],
        "same_instruments": found.one_bench, "differences": rows,
    }  # fmt: skip
    printed(document, _comparison_table(found), as_json, indent=1)


def _comparison_table(found: RunComparison) -> str:
    """Two runs side by side, each difference with its significance, for a terminal."""
    from hil.record.simulated import marked
    from hil.report import comparison_page as page
    from hil.report.number import unit_text
    from hil.report.terminal import aligned, typed

    both = (found.first, found.second)
    runs = (marked(head, simulated=one.simulated) for head, one in zip(page.run_heads(*both), both, strict=True))
    rows = [("quantity", "unit", *runs, "verdict", "change", "")]
    for one in found.differences:
        values = (page.value_text(one.first), page.value_text(one.second), page.verdict_change(one))
        rows.append((one.name, unit_text(one.unit), *values, page.change_text(one), one.meaning))
    below = (page.headline(found.differences), page.verdicts_sentence(*both), page.order_sentence(*both))
    return typed("\n".join([*aligned(rows), *filter(None, below), page.shared_sentence(found.one_bench)]))
