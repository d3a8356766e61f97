"""Runs found again: search, values, report, two runs over each other, a value over time, passports."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from hil.archive.archive import Search, find_runs
from hil.archive.entry import UNFINISHED, Entry
from hil.archive.pending import catch_up
from hil.archive.trend import drift_of, points_of
from hil.catalog import entries
from hil.console.after import next_unit, reasons_of
from hil.console.console import Console
from hil.console.ending import ending_of
from hil.console.page import file_of, page
from hil.console.routes import jobs
from hil.console.routes.passports import passports
from hil.console.site import NotHereError
from hil.errors import ArchiveError, HilError, SettingError
from hil.findings.results import Results, read_results
from hil.record.measurement import RESULTS_FILE, present_name
from hil.record.run_folder.header import meta_of
from hil.record.simulated import is_simulated
from hil.report.name import value_words
from hil.session.run_comparison import RunComparison, compare_runs
from hil.untrusted import is_regular

_MOST = 200
_VERDICTS = ("pass", "fail", "cannot tell")
REPORT_HEADERS = {
    # a page of our own making, with its style inside; it may run nothing and reach nothing
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; "
    "frame-ancestors 'self'; sandbox allow-same-origin",
    "X-Frame-Options": "SAMEORIGIN",
}


def show(request: Request) -> Response:
    """The search, the newest run first."""
    console, asked = Console.of(request), request.query_params
    wanted = {name: asked.get(name, "").strip() for name in ("serial", "procedure", "since", "verdict")}
    found, fault = searched(console, **wanted)
    return page(
        request,
        "results.html",
        wanted=wanted,
        runs=found[:_MOST],
        folder=console.site.runs.resolve(),
        count=len(found),
        most=_MOST,
        fault=fault,
        procedures=[entry.name for entry in entries("procedures")],
        verdicts=_VERDICTS,
        passports=passports(console.site.runs),
    )


def one(request: Request) -> Response:
    """A run: verdict, values, and its report."""
    console, name = Console.of(request), request.path_params["run"]
    folder = console.site.run(name)
    results, meta = _results(folder), meta_of(folder)
    return page(
        request,
        "result.html",
        name=name,
        results=results,
        value_words=value_words,
        meta=_facts(meta),
        reasons=reasons_of(results) if results else [],
        next_unit=next_unit(console.site, meta),
        ending=ending_of(folder),
        simulated=is_simulated(meta),
        report=is_regular(folder, "report.html"),
    )


def report(request: Request) -> Response:
    """The report of a run, as it lies in its folder."""
    name = request.path_params["run"]
    return file_of(Console.of(request).site.run(name), "report.html", "text/html", REPORT_HEADERS)


async def report_again(request: Request) -> Response:
    """Make the report again, also of a run that was stopped or tripped."""
    console, name = Console.of(request), request.path_params["run"]
    folder = console.site.run(name)
    return jobs.begin(request, "report", ["report", str(folder)], f"/results/{name}")


def compare(request: Request) -> Response:
    """Two runs side by side, the earlier first, and their curves over each other."""
    from hil.report.comparison_page import dated

    console, asked = Console.of(request), request.query_params
    names = asked.getlist("run")
    if len(names) != 2:
        raise SettingError(f"two runs are compared; {len(names)} were chosen")
    found = compare_runs(*(console.site.run(name) for name in names))
    return page(
        request, "compare.html", runs=[(one.run, dated(one)) for one in (found.first, found.second)],
        page=_compared(console, found).name, simulated=found.first.simulated or found.second.simulated,
    )  # fmt: skip


def compared(request: Request) -> Response:
    """The page of a comparison, as it was made."""
    name = request.path_params["name"]
    if not re.fullmatch(r"[0-9a-f]{16}\.html", name):
        raise NotHereError("no comparison of that name; compare again")
    return file_of(Console.of(request).site.state, f"compared/{name}", "text/html", REPORT_HEADERS)


def trend(request: Request) -> Response:
    """A value of a unit over time, with its limits and a test for drift."""
    console, asked = Console.of(request), request.query_params
    serial, wanted = asked.get("serial", "").strip(), present_name(asked.get("value", ""))
    runs = find_runs(console.site.place, Search(serial), values=True) if serial else []
    names = list(dict.fromkeys(value.name for run in runs for value in run.values if value.value is not None))
    chosen = wanted if wanted in names else next(iter(names), "")
    points = [point for point in points_of(runs, chosen) if point.value.name == chosen]
    shown = [
        {
            **asdict(p.value), "expanded": p.value.expanded, "run": p.run, "simulated": p.simulated,
            "at": p.started_utc.isoformat(), "local": f"{p.started_utc.astimezone():%Y-%m-%d %H:%M %z}",
        }
        for p in points
    ]  # fmt: skip
    return page(
        request,
        "trend.html",
        serial=serial,
        names=names,
        chosen=chosen,
        points=shown,
        drift=drift_of(points).sentence.translated if points else "",
        serials=_serials(console),
    )


def searched(
    console: Console, serial: str = "", procedure: str = "", since: str = "", verdict: str = ""
) -> tuple[list[Entry], str]:
    """(runs, the newest first, and what kept them from being found)."""
    place = console.site.place
    try:
        began = datetime.fromisoformat(since).astimezone() if since else None
    except ValueError:
        return [], f"since {since:.40}: a date was expected, as 2026-11-25"
    try:
        catch_up(place)
        found = find_runs(place, Search(serial, procedure, began, verdict))
    except ArchiveError as error:
        return [], str(error)
    return found[::-1], ""


def _results(folder: Path) -> Results | None:
    try:
        return read_results(folder / RESULTS_FILE)
    except HilError:
        return None


def _facts(meta: Mapping[str, Any]) -> dict[str, str]:
    facts = {"outcome": UNFINISHED, **meta, "serial": (meta.get("valve") or {}).get("serial")}
    return {name: str(facts.get(name) or "") for name in ("serial", "procedure", "operator", "bench", "outcome")}


def _serials(console: Console) -> list[str]:
    try:
        return sorted({entry.serial for entry in find_runs(console.site.place, Search()) if entry.serial})
    except ArchiveError:
        return []


def _compared(console: Console, found: RunComparison) -> Path:
    import hashlib

    from hil.report.comparison_page import write_comparison_page

    folder = console.site.state / "compared"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{hashlib.sha256(f'{found.first.run}|{found.second.run}'.encode()).hexdigest()[:16]}.html"
    write_comparison_page(found.first, found.second, found.differences, found.one_bench, path)
    return path


ROUTES = [
    Route("/results", show),
    Route("/results/compare", compare),
    Route("/results/compared/{name}", compared),
    Route("/results/trend", trend),
    Route("/results/{run}", one),
    Route("/results/{run}/report", report, methods=["GET"]),
    Route("/results/{run}/report", report_again, methods=["POST"]),
]
