"""The devices of a bench, simulated: start them, give them quirks, end them."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from hil.catalog import find
from hil.console import served
from hil.console.console import Console
from hil.console.page import page
from hil.console.site import names_driver
from hil.console.uploads import form_of
from hil.errors import HilError


def show(request: Request) -> Response:
    """What is served, and the form of a bench."""
    console = Console.of(request)
    benches = [name for name, path in console.site.bench_files().items() if names_driver(path)]
    name = request.query_params.get("bench") or next(iter(benches), "")
    devices = _devices(console, name) if name else []
    return page(
        request, "devices.html", benches=benches, name=name, devices=devices, served=served.served(console.site.state)
    )


def state(request: Request) -> Response:
    """The rows of what is served."""
    return page(request, "served.html", served=served.served(Console.of(request).site.state))


async def begin(request: Request) -> Response:
    """Serve the devices of a bench."""
    console, form = Console.of(request), await form_of(request)
    bench = str(form.get("bench", ""))
    path = console.site.bench_path(bench)
    quirks = [
        f"{key.removeprefix('quirk.')}={value.strip()}"
        for key, value in form.items()
        if key.startswith("quirk.") and isinstance(value, str) and value.strip() not in ("", "false")
    ]
    await run_in_threadpool(served.serve, console.site.state, bench, path, quirks)
    console.audit(request, "devices", {"bench": bench, "quirks": quirks})
    return RedirectResponse(f"/devices?bench={bench}", 303)


async def end(request: Request) -> Response:
    """Serve them no longer."""
    console, bench = Console.of(request), request.path_params["bench"]
    await run_in_threadpool(served.end, console.site.state, bench)
    console.audit(request, "devices end", {"bench": bench})
    return RedirectResponse(f"/devices?bench={bench}", 303)


def _devices(console: Console, name: str) -> list[dict[str, Any]]:
    found = []
    for device, entry in console.site.bench(name).bench.devices.items():
        try:
            model: BaseModel = find("devices", entry.driver).load().quirks({})
        except HilError:
            continue
        quirks = [
            {
                "name": key,
                "switch": field.annotation is bool,
                "default": "" if field.default in (None, 0, 0.0) else field.default,
            }
            for key, field in type(model).model_fields.items()
        ]
        found.append(
            {"name": device, "driver": entry.driver, "where": entry.settings.get("address", ""), "quirks": quirks}
        )
    return found


ROUTES = [
    Route("/devices", show),
    Route("/devices/served", state),
    Route("/devices/serve", begin, methods=["POST"]),
    Route("/devices/{bench}/end", end, methods=["POST"]),
]
