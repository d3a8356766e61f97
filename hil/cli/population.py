"""Runs in their population, as `hil compare --population` prints them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.printed import in_short, printed
from hil.report.number import limits_text, number, rounded, unit_text, with_std
from hil.report.terminal import aligned, typed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.findings.batch import Batch, LimitOfBatch, Yield
    from hil.findings.population import Standing
    from hil.session.population import InPopulation


def compare_population(runs: Sequence[Path], archive: str, as_json: bool, csv: Path | None) -> None:
    """Print where runs lie among the other units of the archive; the limits of a batch go into a CSV file too."""
    from hil.archive.pending import searched
    from hil.cli.searches import not_entered
    from hil.session.population import in_population

    found = searched(archive, lambda place: in_population(runs, place), not_entered)
    if csv is not None:
        _write_csv(found, csv)
    printed(_document(found), _text(found), as_json)


def _document(found: InPopulation) -> dict[str, object]:
    from hil.findings.difference import ALPHA

    rows = [
        {
            "of": one.who, "name": one.name, "unit": one.unit,
            "values": [in_short(value) for value in one.values],
            "units": one.units, "mean": one.mean, "population_std": one.std, "distance": one.distance,
            "std": one.distance_std, "chance": one.chance, "meaning": one.meaning, "why": one.why or None,
        }
        for one in found.standings
    ]  # fmt: skip
    return {
        "schema": "hil.population/1", "procedure": found.runs[0].procedure, "runs": [run.run for run in found.runs],
        "serials": [run.serial for run in found.runs], "others": found.units, "without_serial": found.nameless,
        "same_instruments": found.one_bench, "false_alarm_rate": ALPHA, "values": rows,
        "batch": found.batch,
    }  # fmt: skip


def _write_csv(found: InPopulation, path: Path) -> None:
    from dataclasses import astuple, fields

    from hil.cli.places import check_file
    from hil.findings.batch import LimitOfBatch
    from hil.record.csv_text import write_table

    if found.batch is None:
        raise typer.BadParameter("several runs with limits are needed", param_hint="--csv")
    check_file(path)
    simulated = bool(found.runs[0].simulated)
    heads = (*(field.name for field in fields(LimitOfBatch)), "simulated")
    write_table(heads, ((*astuple(one), simulated) for one in found.batch.limits), path)
    typer.echo(f"{path}: written", err=True)


def _text(found: InPopulation) -> str:
    lines = [*aligned([_HEAD, *map(_row, found.standings)]), *_sentences(found), *_batch(found.batch)]
    return typed("\n".join(lines))


def _batch(batch: Batch | None) -> list[str]:
    if batch is None:
        return []
    rows = [("limit", "unit", "allowed", "units", "fail", "cannot tell", "of all misses", "mean", "std", "Cpk", "")]
    return [
        "",
        f"yield: {_share(batch.final)} pass.",
        f"first-pass yield: {_share(batch.first_pass)} passed in their first run.",
        "Of all misses: with the limits above it. Cpk: with its 95 % interval, measurement uncertainty included.",
        *aligned([*rows, *map(_limit_row, batch.limits)]),
    ]


def _share(found: Yield) -> str:
    percent = (f"{100.0 * share:.0f}" for share in (found.passed / found.judged, found.low, found.high))
    return "{} of {} units ({} %, 95 % interval {} … {} %)".format(found.passed, found.judged, *percent)


def _limit_row(one: LimitOfBatch) -> tuple[str, ...]:
    share = "" if one.cumulative is None else f"{100.0 * one.cumulative:.0f} %"
    mean, std = ("" if value is None else number(value, 4) for value in (one.mean, one.std))
    cpk = f"{one.cpk:.2f} ({one.cpk_low:.2f} … {one.cpk_high:.2f})" if one.cpk is not None else ""
    counts = str(one.units), str(one.failed), str(one.cannot_tell)
    allowed = limits_text(one.low, one.high)
    return one.name, unit_text(one.unit), allowed, *counts, share, mean, std, cpk, one.why


def _row(one: Standing) -> tuple[str, ...]:
    from hil.report.comparison_page import value_text

    value = value_text(one.values[0]) if len(one.values) == 1 else f"mean of {len(one.values)}"
    mean, std = ("", "") if one.mean is None or one.std is None else (rounded(one.mean, one.std)[0], f"{one.std:.2g}")
    distance = "" if one.distance is None else with_std(one.distance, one.distance_std)
    meaning = f"cannot be told: {one.why}" if one.why else one.meaning
    return one.who, one.name, unit_text(one.unit), value, mean, std, str(one.units), distance, meaning


def _sentences(found: InPopulation) -> list[str]:
    from hil.findings.difference import ALPHA

    tested = [one for one in found.standings if one.chance is not None]
    far = sum(one.meaning == "differs" for one in tested)
    lines = [
        f"{far} of {len(tested)} values that can be told differ from the population ({_RATE.format(100 * ALPHA)})."
    ]
    if not tested:
        lines = ["Nothing can be told."]
    if found.nameless:
        lines.append(f"{found.nameless} runs without a serial number belong to no unit and are left out.")
    if found.one_bench:
        return [*lines, "All have the same instruments; what their calibration adds cancels and is left out."]
    return [*lines, "They have different instruments or calibrations; these are in the uncertainty of each distance."]


_HEAD = ("of", "quantity", "unit", "value", "others: mean", "std", "units", "distance", "")
_RATE = "false-alarm rate {:g} % over all values together"
