"""The stop button of a page in a real browser, speaking to real listeners; the web server may be dead."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any

from playwright.sync_api import Browser, Page

from hil.bench.stop.consoles import Console, announced
from hil.bench.stop.listener import Listener
from hil.safety.outputs import Output, State
from tests.chromium import chromium
from tests.stops import SAFE, listening, tell_safe
from tests.waits import PATIENCE_S

SCRIPT = (files("hil") / "console" / "static" / "stop.js").read_text(encoding="utf-8")
PAGE = """<!DOCTYPE html><html lang="en"><head><title>t</title><script type="application/json" id="controls">%s</script>
<script type="application/json" id="words">{}</script>
<script src="/stop.js"></script></head><body><input id="field"><iframe id="frame" src="/empty"></iframe>
<section id="stop"></section></body></html>"""
CSP = "default-src 'none'; script-src 'self'; style-src 'self'; frame-src 'self'; connect-src 'self' http://127.0.0.1:*"
COUNT_BEEPS = """window.beeps = 0; const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (...at) { window.beeps += 1; return start.apply(this, at); };"""

# One question alone, however long a busy machine takes for its answer.
PATIENT = "AbortSignal.timeout = () => new AbortController().signal;"


@contextmanager
def web_server(
    runs: Sequence[dict[str, Any]], body_may_come: threading.Event | None = None
) -> Iterator[ThreadingHTTPServer]:
    """Serves one page with these runs, announced as a console; its body only when it may come."""
    answer = {"pressed": None, "answers": {}, "starting": []}  # as a console that leaves all to the page
    contents = {
        "/": ("text/html", PAGE % json.dumps({"runs": runs, "pressed": None})), "/stop.js": ("text/javascript", SCRIPT),
        "/empty": ("text/html", "<p>x"),
    }  # fmt: skip

    class Pages(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            kind, text = contents.get(self.path, ("text/plain", ""))
            self.send_response(200)
            for name, value in (("Content-Type", f"{kind}; charset=utf-8"), ("Content-Security-Policy", CSP)):
                self.send_header(name, value)
            self.end_headers()
            head, mark, body = text.partition("<body>")
            self.wfile.write(head.encode())
            if mark and body_may_come is not None:
                body_may_come.wait(PATIENCE_S)
            self.wfile.write((mark + body).encode())

        def do_POST(self) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(json.dumps(answer).encode())

        def log_message(self, *_: Any) -> None:
            """Nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Pages)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    origin = f"http://127.0.0.1:{server.server_port}"
    try:
        with announced(Console(pid=os.getpid(), origins=(origin,), host="127.0.0.1")):
            yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def run_at(listener: Listener, name: str = "hpv41-7", **more: Any) -> dict[str, Any]:
    control = listener.control
    url = f"{control.url}/stop"
    return {"run": name, "state": "running", "stop_url": url, "stop_urls": [url], "token": control.tokens.stop, **more}


def told(page: Page, *runs: dict[str, Any], pressed: dict[str, Any] | None = None) -> None:
    """What the console says now of runs under way."""
    page.evaluate("now => document.dispatchEvent(new CustomEvent('hil:controls', {detail: now}))",
                  {"runs": runs, "pressed": pressed})  # fmt: skip


def shown(page: Page) -> str:
    return page.locator("#stop").inner_text()


def waited(page: Page, text: str) -> None:
    """Return when a text is shown."""
    page.wait_for_function("text => document.getElementById('stop')?.innerText.includes(text)", arg=text, polling=10,
                           timeout=1000.0 * PATIENCE_S)  # fmt: skip


@contextmanager
def opened(browser: Browser, *runs: dict[str, Any], script: str = "") -> Iterator[Page]:
    """A page that shows these runs, with a script of its own before all others."""
    with web_server(runs) as server, browser.new_page() as page:
        page.add_init_script(script)
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        yield page


def test_page_stops_what_it_shows(subtests):
    with ExitStack() as stack:
        browser = stack.enter_context(chromium())

        with subtests.test("F12 in a field: confirmed, with the time it took"):
            one, wishes = stack.enter_context(listening(tell_safe))
            with opened(browser, run_at(one), script=PATIENT) as page:
                assert "ends hpv41-7" in shown(page) and wishes == []
                page.focus("#field")
                page.keyboard.press("F12")
                waited(page, "hpv41-7: stop confirmed, outputs read back safe after ")
                assert "valve 0 V" in shown(page) and "UNCONFIRMED" not in shown(page) and wishes == ["stop"]

        with subtests.test("F12 while the page is still being read"):
            early, wishes = stack.enter_context(listening(tell_safe))
            body_may_come = threading.Event()
            with web_server([run_at(early)], body_may_come) as server, browser.new_page() as page:
                page.add_init_script(PATIENT)
                page.goto(f"http://127.0.0.1:{server.server_port}/", wait_until="commit")
                page.wait_for_function("() => window.hilStop", polling=10, timeout=1000.0 * PATIENCE_S)
                # A browser gives keys to a page from its first paint on; this one comes with it.
                page.evaluate("window.dispatchEvent(new KeyboardEvent('keydown', {key: 'F12'}))")
                body_may_come.set()
                waited(page, "hpv41-7: stop confirmed")
                assert wishes == ["stop"]

        with subtests.test("the web server is dead"):
            two, wishes = stack.enter_context(listening(tell_safe))
            with browser.new_page() as page:
                with web_server([run_at(two)]) as server:
                    page.goto(f"http://127.0.0.1:{server.server_port}/")
                    origin = f"http://127.0.0.1:{server.server_port}"
                stack.enter_context(announced(Console(pid=os.getpid(), origins=(origin,), host="127.0.0.1")))
                page.click("#stop button.press")
                waited(page, "stop confirmed")
            assert wishes == ["stop"]

        with subtests.test("nobody confirms: said so within a second, with sound, for each run"):
            three, wishes = stack.enter_context(listening())
            url = "http://127.0.0.1:1/stop"
            dead = {"run": "gone", "state": "lost", "stop_url": url, "stop_urls": [url], "token": "x"}
            deaf = {"run": "by hand", "state": "running"}
            with opened(browser, run_at(three), dead, deaf, script=COUNT_BEEPS) as page:
                page.keyboard.press("F12")
                waited(page, "hpv41-7: UNCONFIRMED: use the emergency stop")
                for name in ("gone", "by hand"):
                    assert f"{name}: UNCONFIRMED: use the emergency stop" in shown(page)
                assert page.evaluate("window.beeps") > 0
                three.service.tell(SAFE, "watchdog")
                waited(page, "hpv41-7: stop confirmed")  # it asks again
                page.click("#stop button.mute")
                assert page.locator("#stop button.mute").is_hidden()

        with subtests.test("it shows when the key does not reach it"), opened(browser) as page:
            waited(page, "F12 stops too")
            assert "no run is under way here" in shown(page)
            page.frame_locator("#frame").locator("p").click()
            page.evaluate("document.getElementById('frame').focus()")
            waited(page, "F12 does not reach this page")
            page.click("#stop .keys")
            waited(page, "F12 stops too")

        with subtests.test("runs that begin later are stopped too; a run that has ended is not asked"):
            four, wishes = stack.enter_context(listening(tell_safe))
            with opened(browser) as page:
                told(page, run_at(four), {**run_at(four, "old"), "state": "ended", "outcome": "completed"})
                page.keyboard.press("F12")
                waited(page, "hpv41-7: stop confirmed")
                assert "old" not in shown(page)

                told(page, {**run_at(four), "state": "ended", "outcome": "Halted", "is_safe": True})
                assert "hpv41-7: stop confirmed" in shown(page), "until another run is under way"
                told(page, run_at(four, "hpv41-8"))
                assert "confirmed" not in shown(page), "the word of a run goes with it"
                assert "ends hpv41-8" in shown(page)

        with subtests.test("a server that does not answer: what is under way is not known"), opened(browser) as page:
            page.evaluate("document.dispatchEvent(new CustomEvent('hil:connection', {detail: false}))")
            waited(page, "Not known whether a run is under way: use the emergency stop.")
            assert "no run is under way here" not in shown(page)
            page.route("**/stop", lambda route: route.abort())
            page.keyboard.press("F12")
            waited(page, "UNCONFIRMED: use the emergency stop (the console does not answer)")

        with subtests.test("what this page does not reach says so before it is pressed"):
            there = {"run": "there", "state": "running", "stop_url": "http://127.0.0.1:1/stop", "token": "x",
                     "stop_urls": ["https://192.0.2.1:1/stop"]}  # fmt: skip
            with opened(browser, there) as page:
                waited(page, "there: is stopped through the console, while that answers")
                page.evaluate("document.dispatchEvent(new CustomEvent('hil:connection', {detail: false}))")
                waited(page, "there: cannot be stopped from here")

        with (
            subtests.test("pressed where nothing is under way: it says that no run can start, and how it is released"),
            opened(browser) as page,
        ):
            press = {"at_utc": "2026-11-26T12:00:00Z", "account": "otto", "runs": []}
            told(page, pressed=press)
            assert "otto): no run can start." in shown(page) and "no run is under way" not in shown(page)
            page.evaluate("document.addEventListener('hil:release', () => { window.released = true; })")
            page.get_by_role("button", name="Release").click()
            assert page.evaluate("window.released")
            told(page)
            assert "no run is under way here" in shown(page)


def test_page_says_safe_while_only_time_is_missing():
    waits = {"valve": Output(State.UNCONFIRMED, "V", 0.0, confirmed_in_s=1.5)}

    def confirm_in_time(desk, _wish):
        desk.tell(waits if len(asked) == 1 else SAFE, "watchdog")

    with ExitStack() as stack:
        browser = stack.enter_context(chromium())
        one, asked = stack.enter_context(listening(confirm_in_time))
        with web_server([run_at(one)]) as server, browser.new_page() as page:
            page.add_init_script(COUNT_BEEPS + PATIENT)
            page.clock.install(time=0)
            page.goto(f"http://127.0.0.1:{server.server_port}/")
            page.clock.pause_at(60_000)  # the page's second without an answer does not pass on a busy machine either
            page.click("#stop button.press")
            waited(page, "hpv41-7: safe, read back; confirmed in 1.50 s")
            page.clock.run_for(2_000)
            waited(page, "stop confirmed")
            assert page.evaluate("beeps") == 0
