"""A page: a template of this package, escaped, in the reader's language, with what every page has."""

from __future__ import annotations

from collections.abc import Container, Mapping
from functools import cache
from hashlib import sha256
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response

from hil.bench.stop.control import asking
from hil.console.console import Console
from hil.console.script_words import SCRIPT_MESSAGES
from hil.console.site import NotHereError
from hil.errors import HilError, UnknownNameError
from hil.language.note import error_text
from hil.language.words import ENGLISH, _, languages, marked, speaking, spoken
from hil.printable import printable
from hil.report.page import templates
from hil.untrusted import read_untrusted
from hil.version import __version__

COOKIE, BENCH_COOKIE = "hil_language", "hil_bench"
_YEAR_S = 31_536_000
_FOR_A_STOP = ("run", "state", "outcome", "is_safe", "by", "listener", "stop_url", "stop_urls", "token")
PAGES = (
    ("bench", marked("Bench")), ("run", marked("Run")), ("results", marked("Results")),
    ("diagnose", marked("Diagnose")),
)  # fmt: skip


def language_of(request: Request) -> str:
    """The reader's language: as chosen on the page, else as the browser asks."""
    chosen = request.query_params.get("lang") or request.cookies.get(COOKIE, "")
    asked = [chosen, *(part.partition(";")[0] for part in request.headers.get("accept-language", "").split(","))]
    return next((short for one in asked if (short := one.strip()[:2].lower()) in languages()), ENGLISH)


def page(request: Request, template: str, status: int = 200, **values: Any) -> HTMLResponse:
    """A template with its values, what is under way, and the texts that scripts say."""
    language = language_of(request)
    with speaking(language):
        text = templates("hil.console", "templates").get_template(template).render(
            **values, language=spoken(), languages=languages(), version=__version__, pages=PAGES, request=request,
            place=request.url.path.split("/")[1] or "bench", controls=controls_of(request), static=static_mark(),
            words={text: _(text) for text in SCRIPT_MESSAGES} if language != ENGLISH else {},
            account=request.scope.get("hil.account"),
            logged_in=bool(getattr(request.scope.get("hil.session"), "name", "")),
        )  # fmt: skip
    response = HTMLResponse(printable(text), status)  # no name turns the direction of what stands beside it
    if request.query_params.get("lang") in languages():
        response.set_cookie(COOKIE, language, max_age=_YEAR_S, samesite="strict", httponly=True)
    return response


def kept_bench(request: Request, known: Container[str]) -> str:
    """The bench that this browser chose last; empty where it is none of those known."""
    name = unquote(request.cookies.get(BENCH_COOKIE, ""))
    return name if name in known else ""


def keep_bench(response: Response, name: str) -> Response:
    """The page of a bench, which the browser takes as chosen."""
    response.set_cookie(BENCH_COOKIE, quote(name), max_age=_YEAR_S, samesite="strict", httponly=True)
    return response


@cache
def static_mark() -> str:
    """The hash of all scripts and styles, which pages ask for them by: so browsers may keep them for good."""
    folder = files("hil.console") / "static"
    contents = sorted((one.name, one.read_bytes()) for one in folder.iterdir())
    return sha256(repr(contents).encode()).hexdigest()[:12]


def file_of(root: Path, name: str, kind: str, headers: Mapping[str, str] | None) -> Response:
    """A file below a folder as it lies there: regular, no link on the way, of bounded size.

    Raises:
        NotHereError: it is none of that.
    """
    try:
        return Response(read_untrusted(root, name), media_type=kind, headers=headers)
    except OSError as error:
        raise NotHereError(f"no file {Path(root, name).name:.80}: {error.strerror}") from None


def controls_of(request: Request) -> dict[str, Any]:
    """Every run under way that this console shows, where each is stopped, and what stop is pressed for.

    Who has no role is told nothing else.
    """
    console, known = Console.of(request), bool(request.scope.get("hil.role"))
    account = str(request.scope.get("hil.account", ""))
    who = {run.folder.name: asking(account, run.control) for run in console.underway.look()}
    runs = [{**run, "who": who.get(run["run"], {})} for run in console.runs()]
    if not known:
        runs = [{key: run[key] for key in _FOR_A_STOP if key in run} for run in runs]
    press = console.switch.pressed
    return {"runs": runs, "pressed": press and press.model_dump(mode="json", exclude=None if known else {"account"})}


def refusal(request: Request, error: HilError) -> Response:
    """What was asked for cannot be done, in one line: as a page, or as JSON for a script."""
    missing = isinstance(error, UnknownNameError | NotHereError)
    status = HTTPStatus.NOT_FOUND if missing else HTTPStatus.BAD_REQUEST
    text = " ".join(error_text(error).split())
    if request.method != "GET" or "application/json" in request.headers.get("accept", ""):
        return JSONResponse({"error": text}, status)
    return page(request, "refused.html", status, why=text)
