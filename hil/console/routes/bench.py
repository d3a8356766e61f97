"""The page of a bench: every channel, links, interlocks, latched trips."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from hil.bench.manual.reading import Reading
from hil.bench.read import BenchFile
from hil.console.board import RunReader, check_tripped, interlocks_of, lines_of, reset_trip, trips_of
from hil.console.console import Console
from hil.console.page import keep_bench, kept_bench, page
from hil.console.underway import Run
from hil.console.uploads import form_of
from hil.errors import FileError, HilError, InUseError
from hil.language.note import translated
from hil.language.words import _

Levels = dict[str, tuple[float, float]]


def show(request: Request) -> Response:
    """The page; without a name, that of the bench that is driven now, was chosen last, or comes first."""
    console = Console.of(request)
    files = console.site.bench_files()
    name = request.query_params.get("bench") or _driven(console) or kept_bench(request, files) or next(iter(files), "")
    if not name:
        return page(request, "bench.html", benches=[], name="", board=None, fault="")
    try:
        board, fault = _board(console, name), ""
    except HilError as error:
        if name not in files:
            raise
        board, fault = None, str(error)
    return keep_bench(page(request, "bench.html", benches=list(files), name=name, board=board, fault=fault), name)


def state(request: Request) -> Response:
    """The board as JSON."""
    return JSONResponse(_board(Console.of(request), request.path_params["bench"]))


async def watch(request: Request) -> Response:
    """Read the inputs while no run drives the bench, or end that."""
    wanted = (await form_of(request)).get("on") == "1"
    name = request.path_params["bench"]
    await run_in_threadpool(_watch, Console.of(request), name, wanted)
    return RedirectResponse(f"/bench?bench={name}", 303)


async def reset(request: Request) -> Response:
    """Forget a latched trip, by the name of its interlock."""
    console, name = Console.of(request), request.path_params["bench"]
    interlock = str((await form_of(request)).get("interlock", ""))
    file = console.site.bench(name)
    check_tripped(file, interlock)
    console.audit(request, "reset", {"bench": file.bench.name, "interlock": interlock})  # else it is not done
    reset_trip(file, interlock)
    return JSONResponse({"reset": interlock})


def _watch(console: Console, name: str, wanted: bool) -> None:
    path = console.site.bench_path(name)
    if not wanted:
        console.watching.end(name)
        return
    run = console.run_on(console.site.bench(name).bench.name)
    if run is not None:
        raise InUseError(f"bench '{name}': run {run.folder.name} reads it now", None)
    console.watching.begin(name, path)


def _driven(console: Console) -> str:
    """The bench of the run under way."""
    files = console.site.bench_files()
    paths = {str(path.resolve()): name for name, path in files.items()}
    driven = [str(run.meta.get("bench_path", "")) for run in console.underway.look()]
    return next((paths[path] for path in reversed(driven) if path in paths), "")


def _board(console: Console, name: str) -> dict[str, Any]:
    file = console.site.bench(name)
    run = console.run_on(file.bench.name)
    readings, levels, fault, watched = _read(console, name, file, run)
    lines = lines_of(file, readings, levels)
    return {
        "bench": name, "title": file.bench.name, "valve": file.bench.valve.name, "simulated": file.is_simulated,
        "run": run.folder.name if run else "", "watched": watched, "fault": fault,
        "lines": [asdict(line) for line in lines], "interlocks": interlocks_of(file, lines), "trips": trips_of(file),
        "links": _links(file, run, readings, fault),
    }  # fmt: skip


def _read(console: Console, name: str, file: BenchFile, run: Run | None) -> tuple[list[Reading], Levels, str, bool]:
    """(readings, levels, what keeps them from coming, whether `hil watch` reads for this page)."""
    if run is None:
        readings, fault, watched = console.watching.readings(name)
        return readings, {}, fault, watched
    try:
        readings, levels = _reader(console, file, run).read()
    except FileError as error:
        return [], {}, str(error), False
    return readings, levels, "", False


def _reader(console: Console, file: BenchFile, run: Run) -> RunReader:
    """One reader for all who look at this bench; those of runs that are over are let go of."""
    key = run.folder.name
    if key not in console.readers:
        console.readers.clear()
        console.readers[key] = RunReader(file, run.folder)
    return console.readers[key]


def _links(file: BenchFile, run: Run | None, readings: list[Reading], fault: str) -> list[dict[str, str]]:
    """Each device: how it is reached, and whether it answers, as far as somebody asks it now."""
    latency = (run.meta.get("sampling") or {}).get("latency_s") if run else None
    return [
        {
            "name": name, "driver": device.driver or device.simulated,
            "where": str(device.settings.get("address", "")) or (_("in this computer") if device.simulated else ""),
            "latency": f"{1e3 * latency:.3g} ms" if isinstance(latency, float) and latency > 0.0 else "",
            **_answering([r for r in readings if file.bench.channels[r.name].device == name], fault),
        }
        for name, device in file.bench.devices.items()
    ]  # fmt: skip


def _answering(readings: list[Reading], fault: str) -> dict[str, str]:
    if not readings:
        return {"state": "not asked", "tone": "missing", "why": fault}
    silent = [reading for reading in readings if reading.value is None or reading.is_stale]
    if len(silent) == len(readings):
        return {"state": "silent", "tone": "bad", "why": translated(silent[0].state)}
    return {"state": "answers", "tone": "good", "why": ""}


ROUTES = [
    Route("/bench", show),
    Route("/bench/{bench}/state", state),
    Route("/bench/{bench}/watch", watch, methods=["POST"]),
    Route("/bench/{bench}/reset", reset, methods=["POST"]),
]
