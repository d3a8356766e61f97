"""Work that takes a while and drives nothing: a passport, a diagnosis, a report. Each is a process; some at a time."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from hil.console.console import Console
from hil.console.page import page
from hil.errors import FileError
from hil.language.words import _


def begin(request: Request, kind: str, arguments: list[str], product: str, name: str = "") -> Response:
    """Start a job and lead to its page.

    Args:
        request: that asks for it.
        kind: of the job, as in its name.
        arguments: of `hil`.
        product: the address at which its product is found when it has ended well.
        name: if not a new one.
    """
    console = Console.of(request)
    name = name or console.new_name(kind)
    console.begin_job(arguments, name, product, request.scope.get("hil.account", ""))
    return RedirectResponse(f"/jobs/{name}", 303)


def show(request: Request) -> Response:
    """The page of a job."""
    name = request.path_params["job"]
    return page(request, "job.html", name=name, state=_state(Console.of(request), name))


def state(request: Request) -> Response:
    """How it stands."""
    return JSONResponse(_state(Console.of(request), request.path_params["job"]))


def _state(console: Console, name: str) -> dict[str, Any]:
    made, product = console.started.get(name), console.products.get(name)
    if name in console.waiting:
        before = list(console.waiting).index(name) + 1
        return {
            "job": name,
            "state": "waiting",
            "text": "",
            "lines": [_("number {place} of those that wait").format(place=before)],
            "product": "",
        }
    if made is None or product is None:
        raise FileError(f"no job '{name:.80}'; it was started by a console that has ended")
    status = made.exit_status
    # 1 is a verdict, not a failure
    state = "running" if status is None else "done" if status in (0, 1) else "refused"
    return {"job": name, "state": state, "text": made.last_line, "lines": made.lines[-30:],
            "product": product if state == "done" else ""}  # fmt: skip


ROUTES = [Route("/jobs/{job}", show), Route("/jobs/{job}/state", state)]
