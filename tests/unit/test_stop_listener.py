"""The listener for a stop: what it answers, and that nothing which arrives there hurts it."""

from __future__ import annotations

import asyncio
import os
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from hil.bench.stop import listener as module
from hil.bench.stop.consoles import Console, announced
from hil.bench.stop.control import asking
from hil.bench.stop.door import Door
from hil.bench.stop.listener import Listener
from hil.bench.stop.stop_service import StopService
from hil.safety.outputs import Output, State
from tests.certificates import holder
from tests.stops import SAFE, listening, posted, sent, stopped, tell_safe
from tests.waits import PATIENCE_S, until

REAL_ANSWER_S = module.ANSWER_S


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """Whoever confirms has the time that a busy computer takes; who says nothing is kept."""
    monkeypatch.setattr(module, "ANSWER_S", PATIENCE_S)
    monkeypatch.setattr(module, "_SAYS_S", PATIENCE_S)


def test_stop_is_confirmed_when_it_was_read_back_and_not_before():
    with listening(tell_safe) as (listener, wishes):
        answer = stopped(listener)
    assert wishes == ["stop"]
    assert answer.pop("seconds") >= 0.02
    assert answer["outputs"]["valve"].pop("at_utc")
    outputs = {"valve": {"state": "safe", "read_back": True, "at": 0.0, "unit": "V"}}
    assert answer == {"state": "confirmed", "outputs": outputs, "by": "run"}


def test_stop_that_nobody_confirms_is_answered_so_within_a_second(monkeypatch):
    assert REAL_ANSWER_S < 1.0
    monkeypatch.setattr(module, "ANSWER_S", REAL_ANSWER_S)
    with listening() as (listener, wishes):
        answer = stopped(listener)
    assert (answer["state"], answer["outputs"]["valve"]["state"], wishes) == ("unconfirmed", "unknown", ["stop"])


@pytest.mark.parametrize(
    "output",
    [
        Output(State.DRIVEN, "V", 4.0), Output(State.UNKNOWN, "V"), Output(State.UNCONFIRMED, "V"),
        Output(State.UNCONFIRMED, "V", can=False),
    ],
)  # fmt: skip
def test_nothing_but_read_back_safe_is_called_confirmed(output, monkeypatch):
    monkeypatch.setattr(module, "ANSWER_S", 0.1)
    with listening(lambda service, _wish: service.tell({"valve": output}, "run")) as (listener, _):
        assert stopped(listener)["state"] == "unconfirmed"


def test_one_of_two_outputs_confirms_nothing(monkeypatch):
    monkeypatch.setattr(module, "ANSWER_S", 0.1)
    service = StopService({"valve": "V", "enable": "V"}, "watchdog", lambda _wish: None)
    listener = Listener(service, "watchdog")
    try:
        service.tell(SAFE, "watchdog")
        assert stopped(listener)["state"] == "unconfirmed"
        service.tell({"enable": Output(State.SAFE, "V", 0.0)}, "watchdog")
        assert stopped(listener)["state"] == "confirmed"
    finally:
        listener.close()


def test_wrong_token_moves_nothing():
    with listening(tell_safe) as (listener, wishes):
        tokens, url = listener.control.tokens, listener.control.url
        for path, token in (("stop", ""), ("stop", tokens.stop[:-1]), ("stop", tokens.hold), ("hold", tokens.stop)):
            assert posted(f"{url}/{path}", {"token": token, "hold": "1"})[0] == 403
        assert posted(f"{url}/stop", {})[0] == 403
        assert posted(f"{url}/", {"token": tokens.stop})[0] == 404
        assert sent(f"{url}/stop", b"GET /stop HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 405 ")
        assert wishes == []


def test_who_stops_is_believed_where_a_console_vouches_for_it():
    for forged in (False, True):
        with listening(tell_safe) as (listener, _):
            control = listener.control.as_dict(Path("run"))
            said = asking("olga", control)
            told = {"token": control["token"], **said, **({"account": "emil"} if forged else {})}
            assert posted(control["stop_url"], told)[0] == 200
            posted(control["stop_url"], {"token": control["token"], **asking("otto", control)})
            assert listener.service.stopped_by == ("" if forged else "olga")


def test_hold_is_asked_for_by_who_knows_its_token():
    with listening() as (listener, wishes):
        url, token = f"{listener.control.url}/hold", listener.control.tokens.hold
        assert posted(url, {"token": token})[1] == {"state": "running"}
        assert posted(url, {"token": token, "hold": "1"})[1] == {"state": "asked"}
        listener.service.holds(True)
        assert posted(url, {"token": token})[1] == {"state": "holding"}
        assert posted(url, {"token": token, "hold": "0"})[1] == {"state": "running"}
        assert posted(url, {"token": token, "hold": "x"})[0] == 400
    assert wishes == ["hold", "resume"]


def test_answer_may_be_read_by_pages_of_a_console_and_no_others():
    ours = "http://127.0.0.1:8123"
    with listening(tell_safe) as (listener, _):
        told = {"token": listener.control.tokens.stop}
        asked = b"OPTIONS /stop HTTP/1.1\r\nOrigin: http://127.0.0.1:8123\r\n\r\n"
        assert b"Access-Control" not in sent(listener.control.url, asked)
        with announced(Console(pid=os.getpid(), origins=(ours,), host="127.0.0.1")):
            assert posted(f"{listener.control.url}/stop", told, ours)[2]["Access-Control-Allow-Origin"] == ours
            assert b"Allow-Origin: http://127.0.0.1:8123\r\n" in sent(listener.control.url, asked)
            for other in ("http://127.0.0.1:8124", "http://evil.example", "null"):
                assert "Access-Control-Allow-Origin" not in posted(f"{listener.control.url}/stop", told, other)[2]
        with announced(Console(pid=2**22 + 1, origins=(ours,), host="127.0.0.1")):  # it has died
            assert "Access-Control-Allow-Origin" not in posted(f"{listener.control.url}/stop", told, ours)[2]


def test_many_stops_at_once_are_one_stop_and_all_are_answered():
    with listening(tell_safe) as (listener, _), ThreadPoolExecutor(30) as pool:
        answers = list(pool.map(lambda _: stopped(listener)["state"], range(30)))
    assert answers == ["confirmed"] * 30


GARBAGE = (
    b"", b"\0" * 4000, os.urandom(4000), b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"POST",
    b"POST /stop HTTP/1.1\r\n",
    b"POST /stop HTTP/1.1\r\nContent-Length: 1000\r\n\r\ntoken=", b"\r\n\r\n\r\n\r\n", b"x" * 20_000,
)  # fmt: skip


def test_garbage_does_not_keep_a_stop_waiting():
    with ExitStack() as stack:
        listener, wishes = stack.enter_context(listening(tell_safe))
        place = urlsplit(listener.control.url)
        for garbage in GARBAGE * 5:
            line = stack.enter_context(socket.create_connection((place.hostname or "", place.port or 0)))
            line.sendall(garbage)
        assert stopped(listener)["state"] == "confirmed", "while none of them is hung up on"
    assert wishes == ["stop"]


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_connections_that_say_nothing_do_not_keep_a_stop_waiting(count):
    with ExitStack() as stack:
        listener, _ = stack.enter_context(listening(tell_safe))
        place = urlsplit(listener.control.url)
        handles = len(list(Path("/proc/self/fd").iterdir()))
        for _ in range(count):
            line = socket.socket()
            line.connect((place.hostname or "", place.port or 0))
            stack.callback(line.close)
        assert stopped(listener)["state"] == "confirmed", "while none of them is hung up on"
        taken = len(list(Path("/proc/self/fd").iterdir())) - handles - count
        assert taken <= 130, "handles are for the devices"


def test_connection_that_is_slow_to_speak_is_hung_up_on(monkeypatch):
    monkeypatch.setattr(module, "_SAYS_S", 0.1)
    with listening(tell_safe) as (listener, _):
        place = urlsplit(listener.control.url)
        with socket.create_connection((place.hostname or "", place.port or 0), PATIENCE_S) as line:
            line.sendall(b"POST /stop HTTP/1.1\r\n")
            begun_s = time.monotonic()
            assert line.recv(10) == b""
            assert time.monotonic() - begun_s > 0.05


def test_listener_comes_back_after_whatever_ended_its_thread(monkeypatch):
    died = threading.Event()

    async def dies(_listener):
        died.set()
        raise SystemExit("of a library")

    with monkeypatch.context() as patch:
        patch.setattr(Listener, "_serve", dies)
        service = StopService({"valve": "V"}, "run", lambda _wish: None)
        listener = Listener(service, "run")
        assert died.wait(PATIENCE_S)
    try:
        service.tell(SAFE, "run")
        assert stopped(listener)["state"] == "confirmed"
    finally:
        listener.close()


def test_fault_in_an_answer_does_not_end_the_listener(monkeypatch):
    with listening(tell_safe) as (listener, _):
        with monkeypatch.context() as patch:
            patch.setattr(module, "response", lambda *_: 1 / 0)
            assert sent(listener.control.url, b"POST /stop HTTP/1.1\r\n\r\n") == b""
        assert stopped(listener)["state"] == "confirmed"


def test_answer_under_way_is_sent_when_the_listener_closes():
    with ThreadPoolExecutor(1) as pool:
        with listening() as (listener, wishes):
            waiting = pool.submit(stopped, listener)
            while not wishes:
                time.sleep(0.005)
            listener.service.tell(SAFE, "run")
        assert waiting.result()["state"] == "confirmed"


def test_stop_that_waits_when_the_listener_closes_is_answered():
    """Another program has taken the bench: nobody here will ever confirm it."""
    answers = []
    with listening() as (listener, wishes):
        waiting = threading.Thread(target=lambda: answers.append(stopped(listener)), daemon=True)
        waiting.start()
        until(lambda: wishes)
    waiting.join(30.0)
    assert [answer["state"] for answer in answers] == ["unconfirmed"]


def test_set_forward_clock_changes_no_answer(monkeypatch):
    real = time.monotonic
    for forward_s in (8 * 3600.0, 2.0**31 / 1000.0, 2.0**32):
        with monkeypatch.context() as patch:
            patch.setattr(time, "monotonic", lambda forward_s=forward_s: real() + forward_s)
            with listening(tell_safe) as (listener, _):
                assert 0.0 < stopped(listener)["seconds"] < PATIENCE_S


def test_desk_forgets_what_a_dead_run_said():
    wishes = []
    service = StopService({"valve": "V"}, "watchdog", wishes.append)
    service.tell(SAFE, "run")
    assert service.stop().done() and not wishes
    service.forget()
    waiting = service.stop()
    assert wishes == ["stop"] and not waiting.done()
    service.tell(SAFE, "watchdog")
    assert waiting.result(0.0).by == "watchdog"


def test_console_from_elsewhere_is_spoken_to_with_its_certificate(tmp_path):
    import ssl

    cert, key, made = tmp_path / "cert.pem", tmp_path / "key.pem", holder("x", bare=True, host="localhost")
    cert.write_bytes(made.certificate_pem)
    key.write_bytes(made.key_pem)
    away = Console(pid=os.getpid(), origins=("https://bench:8123",), host="0.0.0.0", cert=str(cert), key=str(key))
    with announced(away), listening(tell_safe) as (listener, _):
        here, there = listener.control.urls
        assert here.startswith("http://127.0.0.1:") and there.startswith("https://0.0.0.0:")
        assert stopped(listener)["state"] == "confirmed", "pages of this computer stop it too"
        port = urlsplit(there).port or 0
        context = ssl.create_default_context(cafile=str(cert))
        body = f"token={listener.control.tokens.stop}".encode()
        with (
            socket.create_connection(("127.0.0.1", port), PATIENCE_S) as line,
            context.wrap_socket(line, server_hostname="localhost") as safe,
        ):
            safe.sendall(b"POST /stop HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % len(body) + body)
            answer = b""
            while b'"by"' not in answer:
                answer += safe.recv(4096)
        assert b'"confirmed"' in answer
        plain = sent(f"http://127.0.0.1:{port}", b"POST /stop HTTP/1.1\r\n\r\n")
        assert not plain.startswith(b"HTTP")


class Guest(asyncio.Protocol):
    """Somebody who connects and says nothing."""

    transport: asyncio.BaseTransport | None = None
    waits = has_asked = False

    def gone(self) -> None:
        """The door says what is done then."""


def test_who_is_sent_away_before_being_met_is_hung_up_on():
    async def knocked():
        loop = asyncio.get_running_loop()
        with socket.create_server(("127.0.0.1", 0)) as listening, socket.socket() as client:
            door = Door([(listening, None)], Guest, 0, PATIENCE_S)
            client.setblocking(False)
            await loop.sock_connect(client, listening.getsockname())
            try:
                return await asyncio.wait_for(loop.sock_recv(client, 1), PATIENCE_S)
            except ConnectionResetError:
                return b""
            finally:
                door.close()

    assert asyncio.run(knocked()) == b""


class Told(Guest):
    """Somebody whose answer never ends, or who has said nothing yet."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.waits = self.has_asked = True


def test_answers_that_never_end_send_no_newcomer_away():
    async def said(port):
        loop, client = asyncio.get_running_loop(), socket.socket()
        client.setblocking(False)
        await loop.sock_connect(client, ("127.0.0.1", port))
        await loop.sock_sendall(client, b"a")
        await asyncio.sleep(0.02)
        return client

    async def knocked():
        loop = asyncio.get_running_loop()
        with socket.create_server(("127.0.0.1", 0)) as listening:
            door = Door([(listening, None)], Told, 4, PATIENCE_S)
            clients = [await said(listening.getsockname()[1]) for _ in range(5)]
            try:
                first = await asyncio.wait_for(loop.sock_recv(clients[0], 1), PATIENCE_S)
            except ConnectionResetError:
                first = b""
            with pytest.raises(BlockingIOError):
                clients[-1].recv(1)
            door.close()
            for client in clients:
                client.close()
            return first, door.is_busy

    assert asyncio.run(knocked()) == (b"", True)
