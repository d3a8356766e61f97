"""Stop, as pages send it to the console beside the runs' own listeners; it asks for no account."""

from __future__ import annotations

from contextlib import suppress

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from hil.console.console import Console
from hil.console.page import controls_of
from hil.console.stops import press_stop, promptly
from hil.console.uploads import form_of
from hil.errors import SettingError, StorageError


def controls(request: Request) -> Response:
    """Every run under way, where each is stopped, and whether stop is pressed."""
    return JSONResponse(controls_of(request))


async def press(request: Request) -> Response:
    """Stop what is under way, whatever the form holds; what became of it."""
    console, asked = Console.of(request), list[str]()
    with suppress(SettingError, ClientDisconnect):
        asked = [str(name) for name in (await form_of(request)).getlist("run")]
    answer = await promptly(press_stop, console, request.scope.get("hil.account", ""), asked)
    with suppress(StorageError):  # the stop is done
        console.audit(
            request, "press stop", {"stopped": sorted({*answer["answers"], *asked}), "starting": answer["starting"]}
        )
    return JSONResponse(answer)


async def release(request: Request) -> Response:
    """Runs may start again."""
    console = Console.of(request)
    console.audit(request, "release stop", {})
    await promptly(console.switch.release)
    return JSONResponse({"pressed": None})


ROUTES = [
    Route("/controls", controls),
    Route("/stop", press, methods=["POST"]),
    Route("/stop/release", release, methods=["POST"]),
]
