"""What a stranger may lie into the folder of runs: no page hangs, breaks, or shows a file from elsewhere."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import stat
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest
from anyio.to_thread import current_default_thread_limiter
from starlette.concurrency import run_in_threadpool

from hil.archive.place import archive_place
from hil.bench.audit import Audit
from hil.bench.stop.consoles import consoles
from hil.bench.stop.press import StopSwitch
from hil.console import underway
from hil.console.access_accounts import Accounts
from hil.console.access_where import Where
from hil.console.app import application
from hil.console.site import Site
from hil.console.stops import ask_listener, promptly
from hil.console.underway import control_of, run_of
from hil.errors import FileError, LinkError
from hil.record.folder import RunWriter
from hil.record.run_folder.header import read_header
from tests.unit.test_console_access import Browser

DEEP = "[" * 100_000
CONTROL = {"schema": "hil.control/1", "pid": os.getpid(), "listener": "run", "token": "t", "hold_token": "h"}
PAGES = ("/bench", "/run", "/results", "/results/trend", "/diagnose", "/controls", "/live/one",
         "/live/one/state", "/results/one", "/results/one/report", "/passports/a.pdf")  # fmt: skip


@pytest.fixture
def lab(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "state"))
    runs = tmp_path / "runs"
    runs.mkdir()
    (tmp_path / "secret").write_text("the secret", encoding="utf-8")
    RunWriter.create(runs / "one", {"procedure": "jog", "bench": "b", "operator": "AM"}, [("command", "%")]).close("ok")
    return tmp_path


def browser(lab: Path) -> Browser:
    site = Site(archive_place(str(lab / "runs")), lab / "runs", lab, lab / "state" / "console")
    return Browser(application(site, Where("127.0.0.1", 8123), Accounts(lab / "none"), Audit()))


def fifo(path: Path) -> None:
    os.mkfifo(path)


def listening(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        here = Path.cwd()
        os.chdir(path.parent)  # an address of a socket is short
        try:
            made.bind(path.name)
        finally:
            os.chdir(here)


def endless(path: Path) -> None:
    path.touch()
    os.truncate(path, 1 << 40)


def deep(path: Path) -> None:
    path.write_text(DEEP, encoding="utf-8")


def linked(path: Path) -> None:
    path.symlink_to(path.parents[2] / "secret")


@pytest.mark.parametrize("made", [fifo, listening, endless, deep, linked], ids=lambda made: made.__name__)
@pytest.mark.parametrize(
    "name",
    ["run.json", "control.json", "end.json", "results.json", "report.html", "events.jsonl", "samples.f8",
     "progress.json", "watchdog.json", "seal.json"],
)  # fmt: skip
def test_bad_file_in_a_run_folder_takes_no_page(name, made, lab):
    path = lab / "runs" / "one" / name
    path.unlink(missing_ok=True)
    made(path)
    there = browser(lab)
    for page in PAGES:
        status, text, _ = there.ask(page)
        assert status < 500 and "the secret" not in text, page


HUGE = "1" + "0" * 400


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("end.json", '"outputs": [1]'), ("end.json", '"outputs": {"command": 1}'), ("run.json", '"instruments": "x"'),
        ("run.json", f'"sampling": {{"latency_s": {HUGE}}}'), ("run.json", '"notes": [1]'),
        ("control.json", '"listener": 1e999, "token": NaN'), ("control.json", '"listener": [1], "token": {"a": 1}'),
        ("progress.json", f'"share": {HUGE}'), ("progress.json", '"share": 1e999'),
    ],
)  # fmt: skip
def test_value_of_another_kind_takes_no_page(name, text, lab):
    folder = lab / "runs" / "one"
    end, here = (folder / "end.json").read_text(encoding="utf-8"), f'"pid": {os.getpid()}'
    (folder / "end.json").unlink()
    control = {**CONTROL, "stop_url": "http://127.0.0.1:1/stop"}
    (folder / "control.json").write_text(json.dumps(control), encoding="utf-8")
    (folder / "progress.json").write_text(f'{{"schema": "hil.progress/1", "text": "", {here}}}', encoding="utf-8")
    there = browser(lab)
    assert '"run":"one"' in there.ask("/controls")[1]  # it is under way, and on every page
    if name == "end.json":
        (folder / name).write_text(end, encoding="utf-8")
    path = folder / name
    old = path.read_text(encoding="utf-8")
    mark = '"meta":' if '"meta":' in old else "{"
    before, _, after = old.partition(mark)
    after = after.lstrip()[1:] if mark != "{" else after
    path.write_text(f"{before}{mark}{'{' if mark != '{' else ''}{text}, {after}".replace(", }", "}"), encoding="utf-8")
    time.sleep(0.15)  # what was seen is told again for a tenth of a second
    for page in PAGES:
        status, _, _ = there.ask(page)
        assert status < 500, page


@pytest.mark.parametrize(
    "name",
    [
        b"\xff\xfe",
        b"a\nb",
        b"\x1b]0;title\x07",
        "\u202eturned".encode(),
        b"x" * 255,
        b"%2e%2e",
        b"-rf",
        b"<script>alert(1)<script>",
    ],
    ids=repr,
)
def test_name_of_a_run_folder_breaks_no_page(name, lab):
    shutil.copytree(os.fsencode(lab / "runs" / "one"), os.path.join(os.fsencode(lab / "runs"), name))  # noqa: PTH118
    there = browser(lab)
    for page in PAGES:
        status, text, _ = there.ask(page)
        assert status < 500 and "<script>alert" not in text and not {"\x1b", "\u202e"} & {*text}, page


@pytest.mark.parametrize(
    "started_utc",
    ["0001-01-01T00:00:00+23:59", "9999-12-31T23:59:59-23:59", "0001-01-01T00:00:00Z", "\ud800"],
    ids=repr,
)
def test_date_that_no_time_zone_has_hides_no_other_run(started_utc, lab, command_line):
    shutil.copytree(lab / "runs" / "one", lab / "runs" / "two")
    header = json.loads((lab / "runs" / "two" / "run.json").read_text(encoding="utf-8"))
    (lab / "runs" / "two" / "run.json").write_text(json.dumps({**header, "started_utc": started_utc}), encoding="utf-8")
    status, text, _ = browser(lab).ask("/results")
    assert status == 200 and "/results/one" in text
    for command, shown in (("runs", "/runs/one"), ("archive rebuild", "1 run")):
        status, out, _ = command_line(*command.split(), "--archive", lab / "runs")
        assert status == 0 and shown in out


def test_linked_folder_and_passport_are_not_followed(lab):
    (lab / "elsewhere").mkdir()
    (lab / "elsewhere" / "a.pdf").write_text("the secret", encoding="utf-8")
    (lab / "elsewhere" / "run.json").write_bytes((lab / "runs" / "one" / "run.json").read_bytes())
    (lab / "elsewhere" / "report.html").write_text("the secret", encoding="utf-8")
    (lab / "runs" / "two").symlink_to(lab / "elsewhere")
    (lab / "runs" / "passports").symlink_to(lab / "elsewhere")
    there = browser(lab)
    for page in ("/results/two", "/results/two/report", "/live/two", "/passports/a.pdf"):
        status, text, _ = there.ask(page)
        assert status in (400, 404) and "the secret" not in text


@pytest.mark.parametrize(
    ("page", "says"),
    [("/results/two", "no run &#39;two&#39; in "), ("/results/one/report", "no file report.html"),
     ("/results/compared/x", "no comparison of that name"), ("/passports/x", "no passport &#39;x&#39;"),
     ("/diagnose/x", "no diagnosis &#39;x&#39;")],
)  # fmt: skip
def test_what_is_not_there_is_not_found_and_called_what_it_is(page, says, lab):
    status, text, _ = browser(lab).ask(page)
    assert (status, says in text) == (404, True), text


def test_runs_that_no_index_holds_yet_can_be_diagnosed(lab):
    assert 'value="one"' in browser(lab).ask("/diagnose")[1]


def test_report_is_served_as_it_lies_there(lab):
    (lab / "runs" / "one" / "report.html").write_text("<p>the report", encoding="utf-8")
    status, text, headers = browser(lab).ask("/results/one/report")
    assert (status, text) == (200, "<p>the report") and "sandbox" in headers["content-security-policy"]


@pytest.mark.parametrize(
    "address",
    ["http://192.0.2.1:80/hold", "http://localhost.evil.example:80/hold", "file:///etc/passwd", "http://[", 7],
)
def test_server_posts_to_this_computer_alone(address, lab):
    with pytest.raises(LinkError, match="an address of this computer was expected"):
        ask_listener(lab / "runs" / "one", {**CONTROL, "hold_url": address}, "hold", hold="1")
    run = lab / "runs" / "one"
    (run / "control.json").write_text(
        json.dumps({**CONTROL, "stop_url": address, "stop_urls": [address, 7, "http://["]})
    )
    assert control_of(run) == {}
    (run / "control.json").write_text(
        json.dumps({**CONTROL, "stop_url": "http://127.0.0.1:1/stop", "stop_urls": [address, 7, "http://["]})
    )
    assert control_of(run)["stop_urls"] == []


def test_server_posts_to_a_listener_and_no_other_path(lab):
    paths = []

    class Other(BaseHTTPRequestHandler):
        def do_POST(self):
            paths.append(self.path)
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"{}")

        def log_message(self, *_):
            """Nothing."""

    with HTTPServer(("127.0.0.1", 0), Other) as server:
        answering = Thread(target=server.handle_request)
        answering.start()
        ask_listener(lab, {**CONTROL, "stop_url": f"http://127.0.0.1:{server.server_port}/cups/delete"}, "stop")
        answering.join()
    assert paths == ["/stop"]


@pytest.mark.parametrize("made", [fifo, endless, deep], ids=lambda made: made.__name__)
def test_file_that_nobody_can_read_is_a_press_and_no_console(made, lab):
    made(lab / "runs" / "stop-pressed.json")
    assert StopSwitch(lab / "runs").pressed is not None
    (lab / "state" / "consoles").mkdir(parents=True)
    made(lab / "state" / "consoles" / "1.json")
    assert consoles() == []
    made(lab / "accounts.json")
    with pytest.raises(FileError):
        Accounts(lab / "accounts.json").all()


def test_stop_that_many_press_at_once_is_refused_to_none(tmp_path):
    switch = StopSwitch(tmp_path)
    with ThreadPoolExecutor(8) as pressing:
        accounts = [press.account for press in pressing.map(switch.press, map(str, range(200)))]
    assert accounts == [str(number) for number in range(200)]
    assert switch.pressed is not None and switch.pressed.account in accounts
    assert [path.name for path in tmp_path.iterdir()] == ["stop-pressed.json"]


def test_large_files_about_a_run_are_not_read_for_every_page(lab, monkeypatch):
    run, read = lab / "runs" / "one", []
    monkeypatch.setattr(underway, "read_header", lambda folder: read.append(folder) or read_header(folder))
    header = json.loads((run / "run.json").read_text(encoding="utf-8"))
    for size in (1, 2):
        (run / "run.json").write_text(json.dumps({**header, "meta": {"notes": {"n": "x" * size}}}), encoding="utf-8")
        assert [run_of(run).meta["notes"]["n"] for _ in range(3)] == ["x" * size] * 3
    assert len(read) == 2
    (run / "control.json").write_text(json.dumps({**CONTROL, "stop_url": "http://127.0.0.1:1", "x": "x" * 70_000}))
    assert control_of(run) == {}
    (run / "run.json").write_text(json.dumps({**header, "meta": {"notes": {"n": "x" * (1 << 22)}}}), encoding="utf-8")
    with pytest.raises(FileError, match=r"run.json: has 4.\d+ MB; at most 4.194 MB are read"):
        run_of(run)


@pytest.mark.parametrize("path", ["/run/check", "/seat"])
def test_null_character_in_a_form_is_refused(path, lab):
    status, text, _ = browser(lab).ask(path, {"bench": "one", "note": "\0"})
    assert (status, "null character" in text) == (400, True), text


def test_a_stop_is_pressed_whatever_its_form_holds(lab):
    page = browser(lab)
    for form in ({"run": "a\0"}, {f"f{k}": "" for k in range(300)}):
        status, text, _ = page.ask("/stop", form)
        assert (status, json.loads(text)["pressed"] is not None) == (200, True), text
        page.ask("/stop/release", {})


def test_at_once_waits_for_no_page():
    async def asked():
        current_default_thread_limiter().total_tokens = 1
        made = threading.Event()
        page = asyncio.create_task(run_in_threadpool(made.wait, 600.0))
        queued = asyncio.create_task(run_in_threadpool(made.wait, 600.0))
        answer = await promptly("stop of {}".format, "one")
        assert not page.done() and not queued.done()
        made.set()
        await asyncio.gather(page, queued)
        return answer

    assert asyncio.run(asked()) == "stop of one"


def test_hard_link_to_a_file_of_another_user_is_not_served(lab, monkeypatch):
    (lab / "secret").write_text("the secret", encoding="utf-8")
    (lab / "runs" / "one" / "report.html").hardlink_to(lab / "secret")
    there, fstat = browser(lab), os.fstat
    assert "the secret" in there.ask("/results/one/report")[1]

    def other_folders(handle):
        found = fstat(handle)
        return os.stat_result((*found[:4], found.st_uid + 1, *found[5:])) if stat.S_ISDIR(found.st_mode) else found

    monkeypatch.setattr(os, "fstat", other_folders)
    status, text, _ = there.ask("/results/one/report")
    assert status in (400, 404) and "the secret" not in text
