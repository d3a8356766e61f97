"""`hil trend`: a measured value of a unit over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.cli.options import Archive, Json, argument, option
from hil.cli.printed import printed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.archive.trend import Drift, Point


def command(
    measurement: str = argument(..., "MEASUREMENT", "Name of a measured value, as in `hil results`."),
    serial: str = option(..., "--serial", "SN", "The unit."),
    procedure: str = option("", "--procedure", "NAME", "Runs of this procedure alone."),
    since: str = option("", "--since", "DATE", "From this local date on."),
    archive: Archive = "",
    as_json: Json = False,
) -> None:
    """Show how a value of a unit went over time, with its limits, and whether it drifts."""
    from hil import api
    from hil.archive.trend import drift_of, points_of
    from hil.cli.searches import date_of, not_entered
    from hil.errors import UnknownNameError

    runs = api.find_runs(
        serial=serial, procedure=procedure, since=date_of(since), archive=archive, notes=not_entered
    )  # fmt: skip
    points = points_of(runs, measurement)
    if not points:
        raise UnknownNameError(f"value of serial {serial}", measurement, {v.name for run in runs for v in run.values})
    series = {name: [p for p in points if p.value.name == name] for name in dict.fromkeys(p.value.name for p in points)}
    drifts = {name: drift_of(mine) for name, mine in series.items()}
    document = {"schema": "hil.trend/1", "serial": serial, "values": _values(series, drifts)}
    table = "\n\n".join("\n".join([name, *_lines(points), drifts[name].sentence]) for name, points in series.items())
    printed(document, table, as_json, indent=1)


_OF_POINT = ("value", "std", "unit", "low", "high", "verdict", "relation", "calibration_std")


def _values(series: dict[str, list[Point]], drifts: dict[str, Drift]) -> list[dict[str, object]]:
    return [
        {
            "name": name,
            "points": [
                {
                    "run": p.run, "started_utc": p.started_utc, "simulated": p.simulated,
                    **{key: getattr(p.value, key) for key in _OF_POINT},
                }
                for p in points
            ],
            "drift": {key: getattr(drifts[name], key) for key in ("per_year", "std", "chance", "is_drift")},
        }
        for name, points in series.items()
    ]  # fmt: skip


def _lines(points: Sequence[Point]) -> list[str]:
    from hil.record.simulated import marked
    from hil.report.local_time import local_text
    from hil.report.number import limits_text
    from hil.report.results import value_text

    lines = []
    for point in points:
        value = point.value
        started = local_text(point.started_utc, "minutes")
        run = marked(point.run, simulated=point.simulated)
        parts = started, value_text(value, value.unit), limits_text(value.low, value.high), value.verdict or "", run
        lines.append("  ".join(parts).rstrip())
    return lines
