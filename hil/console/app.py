"""The console as an ASGI application: its pages, its files, and what stands in front of them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from anyio.to_thread import current_default_thread_limiter
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from hil.bench.audit import Audit
from hil.console.access import Access, audited
from hil.console.access_accounts import Accounts
from hil.console.access_where import Where
from hil.console.console import Console
from hil.console.headers import Headers
from hil.console.page import refusal
from hil.console.routes import bench, diagnose, jobs, live, passports, results, run, stop
from hil.console.site import Site
from hil.console.underway import Underway
from hil.errors import HilError

_LOOK_S = 0.3
_PAGES = 4  # made at a time: Python runs one thread at a time, and a stop waits for its turn among them


def application(site: Site, where: Where, accounts: Accounts, audit: Audit) -> Starlette:
    """The console of a site, reached there by those who have an account."""
    console = Console(site, Underway(site.runs), audit=audited(audit))

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        current_default_thread_limiter().total_tokens = _PAGES
        looking = asyncio.create_task(_look_after(console))
        yield
        looking.cancel()
        console.close()

    app = Starlette(
        routes=[
            Route("/", _first), *bench.ROUTES, *run.ROUTES, *stop.ROUTES, *live.ROUTES, *passports.ROUTES,
            *results.ROUTES, *jobs.ROUTES, *diagnose.ROUTES,
            Mount("/static", StaticFiles(packages=[("hil.console", "static")])),
        ],
        middleware=[
            Middleware(Headers, listeners=where.listeners),
            Middleware(Access, where=where, accounts=accounts, audit=audit),
        ],
        exception_handlers={HilError: _refused},
        lifespan=lifespan,
    )  # fmt: skip
    app.state.console = console
    return app


async def _look_after(console: Console) -> None:
    """What has to go on also while no page asks."""
    while True:
        await asyncio.sleep(_LOOK_S)
        with suppress(HilError, OSError):
            await asyncio.to_thread(console.tick)


def _first(_request: Request) -> Response:
    return RedirectResponse("/bench")


def _refused(request: Request, error: Exception) -> Response:
    if not isinstance(error, HilError):
        raise error
    return refusal(request, error)
