"""Passports: issued of the runs that are chosen, and handed out again."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from hil.console.console import Console
from hil.console.page import file_of
from hil.console.routes import jobs
from hil.console.site import NotHereError
from hil.console.uploads import form_of
from hil.errors import SettingError
from hil.record.run_folder.header import read_header, stated

_PASSPORT = re.compile(r"^[A-Za-z0-9][A-Za-z0-9._+-]{0,120}\.pdf$")


async def passport(request: Request) -> Response:
    """Issue a passport of runs of one unit."""
    console = Console.of(request)
    names = [str(name) for name in (await form_of(request)).getlist("run")]
    if not names:
        raise SettingError("a passport is of at least one run; choose runs of one unit")
    folders = [console.site.run(name) for name in names]
    serial = await run_in_threadpool(_serial, folders[0])
    folder = console.site.runs / "passports"
    folder.mkdir(exist_ok=True)
    file = f"{serial}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.pdf"
    console.audit(request, "passport", {"runs": names, "file": file})
    arguments = ["passport", *map(str, folders), "--out", str(folder / file)]
    return jobs.begin(request, "passport", arguments, f"/passports/{file}")


def passport_file(request: Request) -> Response:
    """A passport that was issued here."""
    name = request.path_params["name"]
    if not _PASSPORT.match(name):
        raise NotHereError(f"no passport '{name:.80}'")
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return file_of(Console.of(request).site.runs, f"passports/{name}", "application/pdf", headers)


def passports(runs: Path) -> list[str]:
    """The newest that were issued here, by name."""
    return sorted((path.name for path in (runs / "passports").glob("*.pdf")), reverse=True)[:20]


def _serial(folder: Path) -> str:
    """The unit's serial number as far as the name of a file can hold it."""
    serial = stated(read_header(folder).meta, "valve", "serial")
    return re.sub(r"[^A-Za-z0-9._-]+", "-", serial).strip("-.") or "unit"


ROUTES = [
    Route("/results/passport", passport, methods=["POST"]),
    Route("/passports/{name}", passport_file),
]
