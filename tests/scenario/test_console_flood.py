"""Connections that say nothing, half a head or half a body: pages and the stop are answered, and no disk is filled."""

from __future__ import annotations

import resource
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import pytest

from tests.consoles import Lab, console
from tests.limited import limited

pytestmark = pytest.mark.xdist_group("console")
SAID = {
    "silent": b"", "head": b"GET /bench HTTP/1.1\r\nHost: %s\r\n",
    "body": b"POST /login HTTP/1.1\r\nHost: %s\r\nOrigin: http://%s\r\nContent-Length: 1000000\r\n"
    b"Content-Type: application/x-www-form-urlencoded\r\n\r\na",
}  # fmt: skip
PAGES = ("/bench", "/run", "/results", "/diagnose", "/controls")


@contextmanager
def flooded(lab: Lab, count: int, said: bytes) -> Iterator[None]:
    """So many connections that are held open, whatever the console does with them."""
    place = urlsplit(lab.address)
    host = place.netloc.encode()
    text = said.replace(b"%s", host)
    with ExitStack() as stack:
        for _ in range(count):
            line = stack.enter_context(socket.create_connection((place.hostname or "", place.port or 0), 10.0))
            line.sendall(text)
        yield


def answered_s(lab: Lab, path: str, body: bytes | None = None) -> float:
    """How long it takes until an answer is there whole."""
    begun_s = time.monotonic()
    with urlopen(Request(f"{lab.address}{path}", body, {"Origin": lab.address}), timeout=600.0) as answer:
        answer.read()
    return time.monotonic() - begun_s


@contextmanager
def bounded(folder: Path, handles: int, capfd: pytest.CaptureFixture[str]) -> Iterator[Lab]:
    """A console with so many descriptors; afterwards its log is short."""
    with console(folder) as lab:
        resource.prlimit(lab.process.pid, resource.RLIMIT_NOFILE, (handles, handles))
        yield lab
    assert len(capfd.readouterr().err.splitlines()) <= 3


def test_silence_keeps_no_page_and_no_stop_waiting(tmp_path, capfd):
    with bounded(tmp_path, 300, capfd) as lab:
        for said in SAID.values():
            with flooded(lab, 400, said):
                answered_s(lab, "/bench")  # what is not answered is an error after a minute
                answered_s(lab, "/stop", b"")


@pytest.mark.alone
@pytest.mark.slow
@pytest.mark.parametrize("kind", SAID)
def test_eleven_hundred_silent_ones_delay_nothing(kind, tmp_path, capfd):
    with limited(resource.RLIMIT_NOFILE, 4096), bounded(tmp_path, 1024, capfd) as lab:
        for page in PAGES:
            answered_s(lab, page)  # the first of each loads what it needs
        late = threading.Event()
        with flooded(lab, 1100, SAID[kind]):
            threading.Timer(12.0, late.set).start()
            while not late.is_set():
                for page in PAGES:
                    assert answered_s(lab, page) <= 2.0
                assert answered_s(lab, "/stop", b"") <= 0.5
