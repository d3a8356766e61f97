"""A run while it is driven: strip chart, Bode plot, time left, hold, and its verdict at the end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from hil.console.after import next_unit, reasons_of
from hil.console.console import Console
from hil.console.ending import ending_before, ending_of
from hil.console.page import page
from hil.console.stops import ask_listener, promptly
from hil.console.underway import control_of, run_of
from hil.console.uploads import form_of
from hil.errors import FileError, HilError
from hil.findings.results import read_results
from hil.language.words import _
from hil.record.measurement import RESULTS_FILE
from hil.record.run_folder.process_liveness import is_alive
from hil.record.run_folder.progress import WrittenProgress, progress_of
from hil.untrusted import is_regular

_SIGNALS = 128  # from here on an exit status says which signal ended a program
_LEFT = (" left", "almost done", "longer than expected")


def show(request: Request) -> Response:
    """The page of a run; one that has only just been started has no folder yet."""
    name = request.path_params["run"]
    return page(request, "live.html", name=name, state=_state(Console.of(request), name))


def state(request: Request) -> Response:
    """How a run stands, as JSON."""
    return JSONResponse(_state(Console.of(request), request.path_params["run"]))


async def stream(request: Request) -> Response:
    """The run's pictures, as server-sent events."""
    console, name = Console.of(request), request.path_params["run"]
    pictures = console.following.pictures(console.site.run(name), console.pid(name))
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(pictures, media_type="text/event-stream", headers=headers)


async def hold(request: Request) -> Response:
    """Hold a run, or let it go on; what its listener says."""
    console, name = Console.of(request), request.path_params["run"]
    wanted = str((await form_of(request)).get("hold", ""))
    folder = console.site.run(name)
    answer = await promptly(ask_listener, folder, control_of(folder), "hold", hold=wanted)
    if wanted:
        console.audit(request, "hold" if wanted == "1" else "go on", {"run": name})
    return JSONResponse(answer)


def _state(console: Console, name: str) -> dict[str, Any]:
    """State, last words and verdict of a run."""
    started = console.started.get(name)
    status = started.exit_status if started else None
    message = started.last_line if started else ""
    state: dict[str, Any] = {
        "run": name,
        "text": message,
        "share": None,
        "left": "",
        "exit_status": status,
        "outcome": "",
        "verdict": None,
        "judged": False,
        "missed": [],
        "report": False,
    }
    try:
        folder = console.site.run(name)
        run = run_of(folder, console.pid(name))
    except FileError:
        if started is None:
            raise
        if status is None:
            return {**state, "state": "starting"}
        if status < 0 or status >= _SIGNALS:
            press = console.stopped.get(name)
            ending = {"ending": ending_before(press)} if press else {}
            return {**state, **ending, "state": "ended", "outcome": _("stopped; nothing was driven")}
        return {**state, "state": "refused", "outcome": message}
    done = progress_of(folder)
    evaluating = run.state == "ended" and done is not None and is_alive(done.pid)
    evaluation = {"state": "evaluating"} if evaluating else {}
    return {
        **state, **_progress(done), **run.for_page, "ending": ending_of(folder), **evaluation, **_verdict(folder),
        "report": is_regular(folder, "report.html"),
        "next_unit": next_unit(console.site, run.meta) if run.state == "ended" else "",
    }  # fmt: skip


def _progress(done: WrittenProgress | None) -> dict[str, Any]:
    """The share done, the time left and what is going on, as the run's own folder has it."""
    if done is None:
        return {}
    left = next((part.strip() for part in done.text.split(";") if part.strip().endswith(_LEFT)), "")
    return {"share": done.share, "left": left, "text": done.text}


def _verdict(folder: Path) -> dict[str, Any]:
    """The verdict, whether there are results at all, why it is no pass and what to do now."""
    if not is_regular(folder, RESULTS_FILE):
        return {}
    try:
        results = read_results(folder / RESULTS_FILE)
    except HilError:
        return {}
    return {"verdict": results.verdict, "judged": True, "missed": reasons_of(results)}


ROUTES = [
    Route("/live/{run}", show),
    Route("/live/{run}/state", state),
    Route("/live/{run}/stream", stream),
    Route("/live/{run}/hold", hold, methods=["POST"]),
]
