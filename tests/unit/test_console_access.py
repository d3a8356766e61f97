"""Who may use the console: accounts, sessions, origins, limits, the seat and the audit trail, as a browser asks."""

from __future__ import annotations

import asyncio
import json
import os
import stat
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest
from audit_trail import read_audit
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from hil.bench.audit import Audit
from hil.bench.stop.press import StopSwitch
from hil.clock import VirtualClock
from hil.console import access
from hil.console.access import Access, audited
from hil.console.access_accounts import Account, Accounts
from hil.console.access_limits import Limiter, Rate
from hil.console.access_session import Sessions, account_of
from hil.console.access_where import Where, check_where
from hil.console.operator_lock import LAPSES_S, OperatorLock, OperatorLockedError
from hil.errors import FileError, SettingError, StorageError, UnknownNameError
from hil.record.state import state_path

ORIGIN, PASSWORD = "http://127.0.0.1:8123", "twelve chars"
START = "/run/start", {"a": "1"}


@pytest.fixture(autouse=True)
def cheap(monkeypatch, tmp_path):
    """Hashes that cost nothing, and a state folder of its own."""
    from argon2 import PasswordHasher

    hasher = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr("hil.console.access_accounts._hasher", lambda: hasher)
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "state"))
    from hil.console.access_accounts import _nobody

    _nobody.cache_clear()
    yield
    _nobody.cache_clear()


@dataclass
class Browser:
    """Asks the application as a browser does; keeps its cookie."""

    app: Any
    cookie: str = ""
    address: str = "192.0.2.7"
    headers: dict[str, str] = field(default_factory=dict)

    def ask(
        self, path: str, fields: Mapping[str, str] | None = None, *, origin: str | None = ORIGIN, body: bytes = b"",
        host: str = "127.0.0.1:8123", **headers: str,
    ) -> tuple[int, str, dict[str, str]]:  # fmt: skip
        """Status, text and headers of the answer; a POST where there are fields or a body."""
        sent = urlencode(fields).encode() if fields is not None else body
        method = "POST" if fields is not None or body else "GET"
        told = {"host": host, "content-type": "application/x-www-form-urlencoded", **self.headers, **headers}
        if origin is not None and method == "POST":
            told["origin"] = origin
        if self.cookie:
            told["cookie"] = self.cookie
        where, _, query = path.partition("?")
        scope = {
            "type": "http", "method": method, "path": where, "raw_path": where.encode(), "query_string": query.encode(),
            "headers": [(name.lower().replace("_", "-").encode(), value.encode()) for name, value in told.items()],
            "client": (self.address, 1), "server": ("127.0.0.1", 8123), "scheme": "http", "root_path": "",
        }  # fmt: skip
        messages: list[dict[str, Any]] = []
        pieces = [sent[at : at + 60_000] for at in range(0, len(sent), 60_000)] or [b""]

        async def receive() -> dict[str, Any]:
            if not pieces:
                return {"type": "http.disconnect"}
            return {"type": "http.request", "body": pieces.pop(0), "more_body": bool(pieces)}

        async def send(message: dict[str, Any]) -> None:
            messages.append(message)

        asyncio.run(self.app(scope, receive, send))
        got = {name.decode(): value.decode() for name, value in messages[0]["headers"]}
        if "set-cookie" in got:
            self.cookie = got["set-cookie"].partition(";")[0]
        text = b"".join(message.get("body", b"") for message in messages[1:]).decode()
        return messages[0]["status"], text, got

    def logs_in(self, name: str, password: str = PASSWORD, **more: str) -> int:
        """The status of the answer."""
        return self.ask("/login", {"name": name, "password": password}, **more)[0]

    def logged_in(self, name: str) -> Browser:
        assert self.logs_in(name) == 303
        return self


async def _who(request: Request) -> Response:
    fields = dict(await request.form()) if request.method == "POST" else {}
    if request.method == "POST":
        request.app.state.audit(request, "run", {"bench": "b"})
    return JSONResponse({"account": request.scope["hil.account"], "role": request.scope["hil.role"], **fields})


@pytest.fixture
def accounts():
    made = Accounts(state_path("console", "accounts", ".json"))
    for name, role in (("vera", "viewer"), ("otto", "operator"), ("olga", "operator"), ("emil", "engineer")):
        made.add(name, role, PASSWORD)
    return made


def console(
    accounts: Accounts, where: Where | None = None, audit: Audit | None = None, lock: OperatorLock | None = None
) -> Starlette:
    """A small application behind the door; its login page is a word."""
    audit = audit or Audit()
    told = where or Where("127.0.0.1", 8123)
    paths = (
        "/bench",
        "/run/start",
        "/run/check",
        "/diagnose/accept",
        "/diagnose/upload",
        "/controls",
        "/static/stop.js",
    )
    app = Starlette(
        routes=[Route(path, _who, methods=["GET", "POST"]) for path in paths],
        middleware=[Middleware(Access, where=told, accounts=accounts, audit=audit, lock=lock)],
    )
    app.state.audit = audited(audit)
    return app


@pytest.fixture(autouse=True)
def plain_login(monkeypatch):
    monkeypatch.setattr(access, "page", lambda _request, name, status, **told: JSONResponse(told, status))


def test_on_this_computer_without_accounts_whoever_started_it_is_an_engineer(tmp_path):
    status, text, told = Browser(console(Accounts(tmp_path / "none"))).ask("/diagnose/accept", {"a": "1"})
    assert status == 200 and json.loads(text)["role"] == "engineer" and json.loads(text)["account"]
    assert "HttpOnly" in told["set-cookie"] and "SameSite=strict" in told["set-cookie"]


@pytest.mark.parametrize(
    ("name", "allowed"),
    [("vera", ["/bench"]), ("otto", ["/bench", "/run/start"]), ("emil", ["/bench", "/run/start", "/diagnose/accept"])],
)
def test_role_says_what_an_account_may(name, allowed, accounts):
    browser = Browser(console(accounts)).logged_in(name)
    asked = {"/bench": None, "/run/start": {"a": "1"}, "/diagnose/accept": {"a": "1"}}
    answers = {path: browser.ask(path, fields)[0] for path, fields in asked.items()}
    assert answers == {path: 200 if path in allowed else 403 for path in asked}


def test_nobody_sees_anything_but_what_a_stop_needs(accounts):
    browser = Browser(console(accounts))
    assert browser.ask("/bench")[0] == 303 and browser.ask("/bench")[2]["location"] == "/login?next=/bench"
    assert browser.ask("/bench", accept="application/json")[0] == 401
    assert browser.ask(*START)[0] == 401
    assert [browser.ask(path)[0] for path in ("/controls", "/static/stop.js", "/login")] == [200, 200, 200]


def test_account_that_is_removed_or_has_another_password_is_out_at_once(accounts):
    browser, other = (Browser(console(accounts)).logged_in(name) for name in ("otto", "emil"))
    assert browser.ask("/bench")[0] == other.ask("/bench")[0] == 200
    accounts.remove("otto")
    accounts.add("emil", "engineer", "another password")
    assert browser.ask("/bench")[0] == other.ask("/bench")[0] == 303
    with pytest.raises(UnknownNameError):
        accounts.remove("otto")


def test_cookie_that_was_changed_is_nobodys(accounts):
    app = console(accounts)
    cookie = Browser(app).logged_in("otto").cookie
    name, _, value = cookie.partition("=")
    for at in range(0, len(value), 7):
        changed = value[:at] + ("A" if value[at] != "A" else "B") + value[at + 1 :]
        assert Browser(app, f"{name}={changed}").ask("/bench")[0] == 303
    assert Browser(app, cookie).ask("/bench")[0] == 200


def test_session_ends_with_its_time(accounts, monkeypatch):
    app = console(accounts)
    browser = Browser(app).logged_in("otto")
    monkeypatch.setattr("hil.console.access_session.LASTS_S", -1)
    assert browser.ask("/bench")[0] == 303


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:8124", "null", "https://127.0.0.1:8123", None]
)
def test_act_from_another_page_is_refused(origin, accounts):
    browser = Browser(console(accounts)).logged_in("emil")
    assert browser.ask(*START, origin=origin)[0] == 403
    assert browser.ask(*START, origin="http://localhost:8123")[0] == 200


def test_another_name_for_this_computer_is_refused(accounts):
    assert Browser(console(accounts)).ask("/controls", host="evil.example:8123")[0] == 421


def test_console_at_every_address_takes_acts_of_the_page_that_it_served(accounts):
    there = Where("0.0.0.0", 8123, Path("c"), Path("k"))
    browser = Browser(console(accounts, there))
    answers = [
        browser.logs_in("otto", origin=origin, host="bench7:8123")
        for origin in ("https://evil.example", "http://bench7:8123", "https://bench7:8123")
    ]
    assert answers == [403, 403, 303]


def test_who_tries_passwords_is_slowed_and_nobody_else_is(accounts, monkeypatch):
    waited = []

    async def waits(seconds):
        waited.append(round(seconds))

    monkeypatch.setattr("hil.console.access.asyncio.sleep", waits)
    browser = Browser(console(accounts))
    tried = [browser.logs_in("otto", f"wrong {i}") for i in range(14)]
    assert tried == [401] * 10 + [429] * 4 and waited[:5] == [0] * 5
    assert all(0 < found <= most for found, most in zip(waited[5:], [4, 8, 12, 16, 20], strict=True))
    other = Browser(browser.app, address="198.51.100.1")  # the owner of the name, from elsewhere
    assert other.logs_in("otto") == 303 and waited[-1] == 0
    beside = Browser(browser.app)  # another name, from the same address
    assert beside.logs_in("emil") == 303 and waited[-1] == 0


def test_owner_at_the_address_of_who_tries_passwords_logs_in_at_once(accounts, monkeypatch):
    monkeypatch.setattr(access, "_LOGINS", Rate(3.0, 0.0001))
    stranger = Browser(console(accounts))
    owner = Browser(stranger.app).logged_in("otto")
    tried = [stranger.logs_in("otto", f"wrong {i}") for i in range(5)]
    assert tried == [401] * 2 + [429] * 3
    assert owner.logs_in("otto") == 303


def test_a_new_browser_at_the_address_of_who_tries_passwords_logs_in_at_once(accounts, monkeypatch):
    waited = []

    async def waits(seconds):
        waited.append(seconds)

    monkeypatch.setattr("hil.console.access.asyncio.sleep", waits)
    stranger = Browser(console(accounts))
    while stranger.logs_in("otto", "wrong") != 429:
        pass
    owner = Browser(stranger.app)
    assert owner.ask("/login")[0] == 200 and owner.cookie
    assert owner.logs_in("otto") == 303 and waited[-1] == 0.0
    for _ in range(9):  # who takes the page for each try is slowed all the same
        stranger.cookie = ""
        stranger.ask("/login")
        last = stranger.logs_in("otto", "wrong")
    assert last == 429


def test_who_floods_slows_nobody_else_at_the_same_address(accounts, monkeypatch):
    monkeypatch.setattr(access, "_ALL", Rate(20.0, 0.0))
    monkeypatch.setattr(access, "_ACTS", Rate(3.0, 0.0))
    stranger = Browser(console(accounts))
    owner = Browser(stranger.app).logged_in("emil")
    assert [stranger.ask("/bench")[0] for _ in range(21)][-1] == 429
    assert owner.ask("/bench")[0] == owner.ask(*START)[0] == 200


def test_two_consoles_on_one_computer_keep_their_sessions_apart(accounts):
    one, two = (Browser(console(accounts, Where("127.0.0.1", port))) for port in (8123, 8124))
    for browser, port in ((one, 8123), (two, 8124)):
        fields = {"name": "otto", "password": PASSWORD}
        told = browser.ask("/login", fields, origin=f"http://127.0.0.1:{port}", host=f"127.0.0.1:{port}")[2]
        assert told["set-cookie"].startswith(f"hil_session_{port}=")
    one.cookie = two.cookie = f"{one.cookie}; {two.cookie}"  # a browser sends both to both
    assert one.ask("/bench")[0] == two.ask("/bench", host="127.0.0.1:8124")[0] == 200
    away = Browser(console(accounts, Where("bench7", 8123, Path("c"), Path("k"))))
    told = away.ask("/login", fields, origin="https://bench7:8123", host="bench7:8123")[2]["set-cookie"]
    assert told.startswith("__Host-hil_session_8123=") and "; secure" in told.lower() and "; path=/;" in told.lower()


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        ("multipart/form-data", b"x"), ("multipart/form-data; boundary=a", b"nothing"),
        ("application/x-www-form-urlencoded", b"a=1&" * 400),
    ],
)  # fmt: skip
def test_malformed_form_is_refused_in_words(kind, body, accounts):
    browser = Browser(console(accounts)).logged_in("otto")
    browser.headers["content-type"] = kind
    for path in ("/login", "/seat"):
        status, text, _ = browser.ask(path, body=body)
        assert (status, "the form cannot be read" in text) == (400, True)


def test_console_behind_a_proxy_believes_that_one_alone(accounts):
    there = Where("127.0.0.1", 8123, public="https://bench7.lab", proxies=("127.0.0.1",))
    check_where(there, accounts)
    assert (there.is_local, there.origins, there.listeners) == (False, ("https://bench7.lab",), "")
    browser = Browser(console(accounts, there))
    assert browser.ask("/bench", host="127.0.0.1:8123")[0] == 421
    assert browser.logs_in("otto", origin="https://bench7.lab", host="bench7.lab") == 303
    for wrong in (Where("127.0.0.1", 1, public="https://bench7.lab"), Where("127.0.0.1", 1, proxies=("::1",)),
                  Where("127.0.0.1", 1, public="http://bench7.lab", proxies=("::1",))):  # fmt: skip
        with pytest.raises(SettingError, match="--public"):
            check_where(wrong, accounts)


def test_too_many_acts_are_refused(accounts, monkeypatch):
    monkeypatch.setattr(access, "_ACTS", Rate(3.0, 0.0))
    browser = Browser(console(accounts))
    assert [browser.ask(*START)[0] for _ in range(5)] == [401] * 3 + [429] * 2
    assert browser.ask(*START)[2]["connection"] == "close"  # what was sent ahead is not answered


def test_page_for_logging_in_is_made_beside_the_loop(accounts, monkeypatch):
    made = []
    monkeypatch.setattr(access, "page", lambda *_, **__: made.append(threading.current_thread()) or JSONResponse({}))
    assert Browser(console(accounts)).ask("/login")[0] == 200
    assert made and made[0] is not threading.main_thread()  # a flood of them keeps no stop waiting


def test_limiter_gives_tokens_back_and_forgets_the_oldest(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("hil.console.access_limits.time.monotonic", lambda: now[0])
    limiter = Limiter(Rate(1.0, 2.0))
    assert [limiter.admits("a"), limiter.admits("a")] == [True, False]
    now[0] = 0.6
    assert limiter.admits("a")
    for number in range(5000):
        limiter.admits(f"caller {number}")
    assert limiter.admits("a")  # in the place of caller 904
    assert [limiter.admits("caller 905"), limiter.admits("caller 904")] == [False, True]


def test_body_that_is_too_large_is_refused(accounts, monkeypatch):
    browser = Browser(console(accounts)).logged_in("emil")
    large = b"a=" + b"x" * (1 << 20)
    assert browser.ask("/run/start", body=large)[0] == 413
    assert browser.ask("/run/start", body=large, content_length=str(len(large)))[0] == 413
    assert browser.ask("/run/start", body=b"a=1", content_length="9" * 400)[0] == 413
    two = b"a=" + b"x" * 700_000 + b"&b=" + b"x" * 700_000
    assert browser.ask("/diagnose/upload", body=two)[0] == 200
    monkeypatch.setattr(access, "_LARGE", 1000)
    assert browser.ask("/diagnose/upload", body=large)[0] == 413


def test_login_leads_back_to_a_page_of_this_console_and_nowhere_else(accounts):
    for wanted, goes in (("/live/run%207?x=1", "/live/run 7"), ("//evil.example", "/"), ("https://evil.example", "/"),
                         ("/\\evil.example", "/"), ("/a%0d%0aSet-Cookie:x", "/")):  # fmt: skip
        browser = Browser(console(accounts), address=wanted)
        told = browser.ask(f"/login?next={wanted}", {"name": "otto", "password": PASSWORD})[2]
        assert told["location"].partition("?")[0].replace("%20", " ") == goes


def test_one_operates_and_the_others_look(accounts):
    clock = VirtualClock(100.0)
    app = console(accounts, lock=OperatorLock(clock))
    first, second = Browser(app).logged_in("otto"), Browser(app).logged_in("olga")
    assert first.ask(*START)[0] == 200
    status, text, _ = second.ask(*START)
    assert status == 409 and "otto operates this console since" in text
    assert second.ask("/bench")[0] == second.ask("/run/check", {"a": "1"})[0] == 200
    assert json.loads(second.ask("/seat")[1])["operator"] == "otto"
    assert "otto" not in Browser(app).ask("/seat")[1]
    assert json.loads(second.ask("/seat", {"take": "1"})[1])["operator"] == "olga"
    assert first.ask(*START)[0] == 409
    second.ask("/seat", {"take": "0"})
    assert first.ask(*START)[0] == 200
    assert Browser(app).logged_in("vera").ask("/seat", {"take": "1"})[0] == 403


def test_seat_lapses_when_its_pages_are_gone():
    clock = VirtualClock(100.0)
    lock = OperatorLock(clock)
    assert lock.take("a", "otto") and not lock.take("a", "otto")
    clock.sleep_until(100.0 + 0.9 * LAPSES_S)
    lock.refresh("a")
    clock.sleep_until(100.0 + 1.8 * LAPSES_S)
    with pytest.raises(OperatorLockedError):
        lock.take("b", "olga")
    clock.sleep_until(100.0 + 2.0 * LAPSES_S)
    assert lock.take("b", "olga") and lock.holder == "olga"


def test_audit_names_who_did_what_and_when(accounts):
    audit = Audit()
    app = console(accounts, audit=audit)
    Browser(app).logged_in("otto").ask(*START)
    Browser(app).ask("/login", {"name": "otto", "password": "wrong"})
    lines = list(read_audit(audit.path))
    assert [(line["account"], line["act"]) for line in lines] == [
        ("otto", "logs in"), ("otto", "operates"), ("otto", "run"), ("", "was refused"),
    ]  # fmt: skip
    assert lines[3]["details"]["name"] == "otto"
    assert lines[2]["details"] == {"address": "192.0.2.7", "bench": "b"} and lines[2]["utc"].endswith("+00:00")
    assert stat.S_IMODE(audit.path.stat().st_mode) == 0o600 and PASSWORD not in audit.path.read_text()


def test_act_is_refused_when_it_cannot_be_written_down(accounts, tmp_path):
    audit = Audit(tmp_path / "file" / "audit.jsonl")
    app = console(accounts, audit=audit)
    browser = Browser(app).logged_in("otto")
    audit.path.unlink()
    audit.path.mkdir()
    assert browser.ask(*START)[0] == 503
    with pytest.raises(StorageError):
        audit.write("otto", "run", {})
    for password in (PASSWORD, "another one"):  # also for who logs in, or tries to
        status, text, _ = Browser(app).ask("/login", {"name": "olga", "password": password})
        assert status == 503 and "the audit trail cannot be written" in text


def test_accounts_are_kept_for_their_owner_alone(accounts):
    path = state_path("console", "accounts", ".json")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert PASSWORD not in path.read_text() and "$argon2id$" in path.read_text()
    path.chmod(0o640)
    with pytest.raises(FileError, match="chmod 600"):
        accounts.all()
    assert Browser(console(accounts)).ask("/bench")[0] == 503


@pytest.mark.parametrize(
    ("name", "role", "password", "says"),
    [("", "viewer", PASSWORD, "NAME"), ("a\nb", "viewer", PASSWORD, "NAME"), ("a", "root", PASSWORD, "--role root"),
     ("a", "viewer", "short", "5 characters"), ("a", "viewer", "x" * 1025, "1025 characters")],
)  # fmt: skip
def test_account_that_is_not_allowed_names_what_is(name, role, password, says):
    with pytest.raises(SettingError, match=says):
        Accounts().add(name, role, password)


def test_password_of_an_account(accounts):
    found = accounts.verified("otto", PASSWORD)
    assert found.role == "operator"
    assert accounts.verified("otto", "wrong") is accounts.verified("nobody", PASSWORD) is None
    sessions = Sessions()
    session = sessions.read(sessions.signed(sessions.begun("otto", found)))
    assert session is not None and account_of(session, accounts) == found
    assert account_of(session, Accounts(Path("/nowhere"))) is None
    assert isinstance(found, Account)


def test_console_beyond_this_computer_needs_accounts_and_a_certificate(accounts, tmp_path):
    cert = tmp_path / "cert.pem"
    cert.touch()
    none = Accounts(tmp_path / "none")
    for where, who, says in (
        (Where("0.0.0.0", 1, cert, cert), none, "has no accounts"), (Where("bench7", 1), accounts, "--cert FILE --key"),
        (Where("127.0.0.1", 1, cert), accounts, "belong together"),
        (Where("::", 1, cert, tmp_path / "no.pem"), accounts, "no such file"),
    ):  # fmt: skip
        with pytest.raises(SettingError, match=says):
            check_where(where, who)
    check_where(Where("0.0.0.0", 1, cert, cert), accounts)
    check_where(Where("localhost", 1), none)


def test_user_add_asks_for_the_password_and_console_refuses_others(command_line):
    console = partial(command_line, "console")
    refused = console("--host", "0.0.0.0")
    assert refused.status == 2 and "has no accounts" in refused.err
    assert console("user", "add", "otto", "--role", "operator", typed=f"{PASSWORD}\n").status == 0
    assert Accounts().verified("otto", PASSWORD) is not None
    assert console("user", "add", "olga", PASSWORD).status == 2, "no password as an argument"
    listed = console("user", "list")
    assert listed.status == 0 and "otto  operator" in listed.out
    refused = console("--host", "0.0.0.0")
    assert refused.status == 2 and "--cert FILE --key FILE" in refused.err
    assert console("user", "add", "otto", "--role", "viewer", typed=f"{PASSWORD}\n").status == 0
    assert console("user", "remove", "otto").status == 0 and not Accounts().all()
    lines = list(read_audit(Audit().path))
    assert [line["act"] for line in lines] == ["add account", "change account", "remove account"]
    assert lines[1]["details"] == {"name": "otto", "role": "viewer", "role before": "operator"} and lines[1]["account"]


def test_nobody_is_told_where_to_stop_and_nothing_else(accounts, tmp_path):
    from hil.archive.place import archive_place
    from hil.console.app import application
    from hil.console.site import Site
    from hil.record.folder import RunWriter

    runs = tmp_path / "runs"
    runs.mkdir()
    about = {"valve": {"serial": "SN 4711"}, "operator": "otto", "procedure": "jog", "bench": "b"}
    with_run = RunWriter.create(runs / "jog-1", about, [("command", "%")])
    told = {"schema": "hil.control/1", "pid": os.getpid(), "listener": "run", "stop_url": "http://127.0.0.1:1/stop"}
    (runs / "jog-1" / "control.json").write_text(json.dumps({**told, "token": "t", "hold_token": "never shown"}))
    site = Site(archive_place(str(runs)), runs, tmp_path, tmp_path / "state")
    app = application(site, Where("127.0.0.1", 8123), accounts, Audit())
    nobody, otto = Browser(app), Browser(app).logged_in("otto")
    (seen,) = json.loads(nobody.ask("/controls")[1])["runs"]
    assert (seen["run"], seen["token"], seen["stop_url"]) == ("jog-1", "t", "http://127.0.0.1:1/stop")
    StopSwitch(runs).press("olga")
    texts = [browser.ask(path)[1] for browser in (nobody, otto) for path in ("/controls", "/login", "/bench")]
    assert not any("olga" in text for text in texts[:3]) and "olga" in texts[3]
    assert not any("never shown" in text for text in texts)
    assert not any("4711" in text for text in texts[:3]) and "4711" in texts[3]
    with_run.close("completed")
