"""Who may: what stands in front of every page of the console.

A request comes through here first: is it meant for this console (host), does it come from one of its pages (origin),
not too often and not too much, from whom, and may they. A stop does not pass here: it goes to the run's own listener.
What a page needs for that (`/controls`, scripts) asks for no role either.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from getpass import getuser
from http import HTTPStatus
from typing import Any
from urllib.parse import urlencode

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hil.bench.audit import Audit
from hil.console.access_accounts import ROLES, Accounts, Role
from hil.console.access_limits import Limiter, Rate, TooLargeError, limited
from hil.console.access_session import LASTS_S, Session, Sessions, account_of
from hil.console.access_where import Where
from hil.console.operator_lock import OperatorLock, OperatorLockedError
from hil.console.page import language_of, page
from hil.console.uploads import form_of
from hil.errors import HilError, SettingError, StorageError
from hil.language.note import error_text
from hil.language.words import marked, speaking

_ASKS_FOR_NOBODY = ("/login", "/logout", "/controls", "/stop")  # and what lies below /static/
_NEEDS_NO_LOCK = ("/run/check", "/seat", "/login", "/logout")
_ENGINEERS = "/diagnose/accept"  # what others are judged by
_UPLOADS = "/diagnose/"
_SMALL, _LARGE = 1 << 20, 256 << 20
_ALL, _ACTS, _LOGINS = Rate(1000.0, 400.0), Rate(60.0, 10.0), Rate(5.0, 0.25)
_LOGIN_WAITS_S = 20.0
_NEW_BROWSERS, _TRIES = (
    Rate(3.0, 0.05),
    Rate(3.0, 0.0),
)  # for a name at one address, and of each
_SAFE = ("GET", "HEAD", "OPTIONS")


class Access:
    """The door: middleware for any Starlette or FastAPI application.

    A request that passes has in its scope `hil.account` (the name; empty for nobody), `hil.role` and `hil.session`. On
    this computer, without accounts, everybody is who has started the console, as an engineer.

    Args:
        app: what stands behind it.
        where: it is reached.
        accounts: who may come in.
        audit: where it is written down who came in, and who took the seat.
        seat: who operates.
    """

    def __init__(
        self, app: ASGIApp, where: Where, accounts: Accounts, audit: Audit, lock: OperatorLock | None = None
    ) -> None:
        self._app, self._where, self._accounts, self._audit = app, where, accounts, audit
        self.lock = lock or OperatorLock()
        self._sessions = Sessions()
        self._all, self._acts, self._logins = Limiter(_ALL), Limiter(_ACTS), Limiter(_LOGINS)
        self._new_browsers, self._tries = Limiter(_NEW_BROWSERS), Limiter(_TRIES)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """An ASGI call."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":  # the console has no websockets
            await send({"type": "websocket.close", "code": 1008})
            return
        path = scope["path"]
        begun = False

        async def sent(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        most = _LARGE if path.startswith(_UPLOADS) else _SMALL
        request = Request(scope, limited(receive, most))
        try:
            with speaking(language_of(request)):
                answer = self._refused(request, most) or await self._let_in(request)
                if answer is None:
                    await self._app(scope, request.receive, self._with_cookie(scope, sent))
                    return
        except TooLargeError as error:
            if begun:
                raise
            answer = _no(413, f"the request is too large, or does not end: {error}")
        except ClientDisconnect:
            return
        except StorageError as error:  # of the trail: what cannot be written down is not done
            answer = _no(503, error_text(error))
        except SettingError as error:
            answer = _no(400, error_text(error))
        await answer(scope, receive, send)

    def _refused(self, request: Request, most: int) -> Response | None:
        """What is wrong with a request whoever sends it."""
        caller = self._caller(request)
        host, acts = request.headers.get("host", ""), request.method not in _SAFE
        counts = acts and request.url.path != "/stop"
        if not self._all.admits(caller) or (counts and not self._acts.admits(caller)):
            return _no(429, "too many requests; wait a moment")
        if not self._where.is_everywhere and host not in self._where.hosts:
            return _no(421, f"this console is not {host:.80}; it is {self._where.origins[0]}")
        if acts and not self._is_ours(request, host):
            return _no(403, "this did not come from a page of this console")
        length = request.headers.get("content-length", "0")
        if length.isdecimal() and int(length[:18]) > most:
            return _no(413, f"at most {most} bytes are taken")
        return None

    def _caller(self, request: Request) -> str:
        """By what a request is counted: a browser that has logged in by its session, every other by its address."""
        session = self._session_of(request)
        return session.id if session and (session.name or self._where.is_local) else _address(request)

    def _session_of(self, request: Request) -> Session | None:
        return self._sessions.read(request.cookies.get(self._where.cookie, ""))

    def _is_ours(self, request: Request, host: str) -> bool:
        origin = request.headers.get("origin", "")
        return (
            origin == f"{self._where.scheme}://{host}" if self._where.is_everywhere else origin in self._where.origins
        )

    async def _let_in(self, request: Request) -> Response | None:
        """Who it is, and whether they may; None when they may."""
        try:
            session, name, role = self._known(request)
        except HilError as error:  # nobody comes in while it is not known who may
            return _no(503, error_text(error))
        request.scope.update({"hil.account": name, "hil.role": role, "hil.session": session})
        self.lock.refresh(session.id)
        path = request.url.path
        if path == "/login":
            if request.method == "POST":
                return await self._login(request)
            return self._keep(await run_in_threadpool(_login_page, request), session)
        if path == "/logout" and request.method == "POST":
            return self._logout(session)
        if path == "/seat":
            return await self._asked_for_lock(request, session, name, role)
        needed = _needed(request.method, path)
        if needed is None:
            return None
        if role is None:
            return _ask_to_log_in(request)
        if ROLES.index(role) < ROLES.index(needed):
            return _no(403, f"{name} is {role}; this needs {needed}")
        return self._seated(request, session, name)

    def _known(self, request: Request) -> tuple[Session, str, Role | None]:
        session = self._session_of(request) or self._sessions.begun()
        if self._where.is_local and not self._accounts.all():
            return session, _local_name(), "engineer"
        account = account_of(session, self._accounts) if session.name else None
        return (session, session.name, account.role) if account else (session, "", None)

    def _seated(self, request: Request, session: Session, name: str) -> Response | None:
        if request.method in _SAFE or request.url.path in _NEEDS_NO_LOCK:
            return None
        try:
            if self.lock.take(session.id, name):
                self._audit.write(name, "operates", {"address": _address(request)})
        except OperatorLockedError as taken:
            return _no(409, error_text(taken))
        except HilError as error:
            return _no(503, error_text(error))
        return None

    async def _asked_for_lock(self, request: Request, session: Session, name: str, role: Role | None) -> Response:
        """Who operates; `take=1` takes the seat over, `take=0` lets go of it."""
        if request.method == "POST":
            if role is None or role == "viewer":
                return _no(403, "operating needs the role operator")
            wanted = str((await form_of(request)).get("take", ""))
            if wanted == "1" and self.lock.take(session.id, name, over=True):
                self._audit.write(name, "takes over", {"address": _address(request)})
            elif wanted == "0":
                self.lock.leave(session.id)
        answer = JSONResponse({"operator": self.lock.holder if role else "", "account": name, "role": role})
        return self._keep(answer, session)

    async def _login(self, request: Request) -> Response:
        form = await form_of(request)
        name, password = str(form.get("name", "")), str(form.get("password", ""))
        session: Session = request.scope["hil.session"]
        # A name is slowed at that address alone, and not at a browser that has logged in with it before.
        at = session.id if session.name == name else _address(request)
        wait_s = self._logins.wait_s(f"{at} {name:.64}", _LOGIN_WAITS_S)
        if wait_s != 0.0 and self._is_new_browser(request, name):
            wait_s = self._new_browsers.wait_s(f"{at} {name:.64}", _LOGIN_WAITS_S)
        if wait_s is None:
            return _login_page(request, marked("Too many tries; wait a minute."), 429)
        await asyncio.sleep(wait_s)
        account = await run_in_threadpool(self._accounts.verified, name, password)
        if account is None:
            self._audit.write("", "was refused", {"address": _address(request), "name": f"{name:.64}"})
            return _login_page(request, marked("No account with that name and password."), 401)
        self._audit.write(name, "logs in", {"address": _address(request), "role": account.role})
        return self._keep(RedirectResponse(_path_wanted(request), 303), self._sessions.begun(name, account))

    def _is_new_browser(self, request: Request, name: str) -> bool:
        """Whether it was shown the page and has hardly tried: who tries passwords beside it shall not keep it out.

        Few such are let through: whoever takes the page for every try gains no more than that.
        """
        session = self._session_of(request)
        return session is not None and self._tries.admits(f"{session.id} {name:.64}")

    def _logout(self, session: Session) -> Response:
        self.lock.leave(session.id)
        answer = RedirectResponse("/login", 303)
        answer.delete_cookie(self._where.cookie, httponly=True, samesite="strict", secure=self._where.scheme == "https")
        return answer

    def _keep(self, answer: Response, session: Session) -> Response:
        answer.set_cookie(
            self._where.cookie, self._sessions.signed(session), max_age=LASTS_S, httponly=True, samesite="strict",
            secure=self._where.scheme == "https",
        )  # fmt: skip
        return answer

    def _with_cookie(self, scope: Scope, send: Send) -> Send:
        """A browser that is new here is told its session with its first page."""
        if self._session_of(Request(scope)):
            return send

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                cookie = self._keep(Response(), scope["hil.session"]).headers["set-cookie"]
                message = {**message, "headers": [*message["headers"], (b"set-cookie", cookie.encode("latin-1"))]}
            await send(message)

        return sent


def audited(audit: Audit) -> Any:
    """What an application calls for each act: (request, act, details, operator); the account is the request's."""

    def write(request: Request, act: str, details: Mapping[str, Any], operator: str = "") -> None:
        audit.write(request.scope.get("hil.account", ""), act, {"address": _address(request), **details}, operator)

    return write


def _needed(method: str, path: str) -> Role | None:
    """The role that a request needs; None where it needs none."""
    if path in _ASKS_FOR_NOBODY or path.startswith("/static/"):
        return None
    if method in _SAFE:
        return "viewer"
    return "engineer" if path.startswith(_ENGINEERS) else "operator"


def _ask_to_log_in(request: Request) -> Response:
    wants_page = request.method in _SAFE and "application/json" not in request.headers.get("accept", "")
    return RedirectResponse(f"/login?next={request.url.path}", 303) if wants_page else _no(401, "log in first")


def _path_wanted(request: Request) -> str:
    """Where somebody wanted to go: a path of this console, never another place."""
    path = request.query_params.get("next", "")
    return path if path.startswith("/") and not path.startswith(("//", "/\\")) and path.isprintable() else "/"


def _address(request: Request) -> str:
    return request.client.host if request.client else ""


def _local_name() -> str:
    with suppress(OSError, KeyError):
        return getuser()
    return "local"


def _no(status: int, text: str) -> Response:
    """Refused; who asks too often is hung up on, so that what it has sent ahead is not answered one by one."""
    headers = {"Connection": "close"} if status == HTTPStatus.TOO_MANY_REQUESTS else None
    return JSONResponse({"error": text}, status, headers)


def _login_page(request: Request, why: str = "", status: int = 200) -> Response:
    return page(request, "login.html", status, why=why, target=f"/login?{urlencode({'next': _path_wanted(request)})}")
