"""Stops asked for as a browser asks, and a device that is driven meanwhile; the listener shares nothing of it."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlencode, urlsplit

from hil.bench.stop.listener import Listener
from hil.bench.stop.stop_service import StopService
from hil.daq.channel import Wiring
from hil.safety.operator import Asked
from hil.safety.outputs import Output, State
from tests.channels import inputs, outputs
from tests.waits import PATIENCE_S

WIRING = Wiring(outputs({"valve": "out"}), inputs({"pressure": "in"}, low=-20.0, high=20.0))
SAFE = {"valve": Output(State.SAFE, "V", 0.0)}


class Remote:
    """A device on a link that obeys at once and remembers every value that it was given, with its time."""

    watchdog_s: float | None = None
    keep_alive_s: float | None = None

    def __init__(self, deaf: bool = False) -> None:
        self.given: list[tuple[float, float]] = []
        self.deaf = deaf

    @property
    def at(self) -> float:
        return self.given[-1][1] if self.given else 0.0

    def standing(self) -> Mapping[str, float]:
        return {"out": self.at}

    def drive(self, values: Mapping[str, float]) -> None:
        if not (self.deaf and values["out"] == 0.0):
            self.given.append((time.monotonic(), values["out"]))

    def read(self) -> Mapping[str, float]:
        return {"in": 1.0}

    def close(self) -> None:
        """Nothing is held."""


def sent(url: str, what: bytes, timeout_s: float = PATIENCE_S) -> bytes:
    """What comes back for some bytes, until the other side hangs up."""
    place = urlsplit(url)
    with socket.create_connection((place.hostname or "", place.port or 0), timeout_s) as line:
        line.sendall(what)
        answer = b""
        while more := line.recv(4096):
            answer += more
        return answer


def posted(url: str, fields: Mapping[str, str], origin: str = "") -> tuple[int, dict[str, Any], dict[str, str]]:
    """Status, content and headers of the answer to a plain POST."""
    body = urlencode(fields).encode()
    head = [f"POST {urlsplit(url).path} HTTP/1.1", "Host: x", f"Content-Length: {len(body)}"]
    head += [f"Origin: {origin}"] if origin else []
    top, _, content = sent(url, "\r\n".join(head).encode() + b"\r\n\r\n" + body).partition(b"\r\n\r\n")
    first, *lines = top.decode().split("\r\n")
    return int(first.split()[1]), json.loads(content or b"null"), dict(line.split(": ", 1) for line in lines)


def stopped(listener: Listener) -> dict[str, Any]:
    """What a stop is answered."""
    status, content, _ = posted(f"{listener.control.url}/stop", {"token": listener.control.tokens.stop})
    assert status == 200, content
    return content


@contextmanager
def listening(act: Callable[[StopService, Asked], None] | None = None) -> Iterator[tuple[Listener, list[Asked]]]:
    """A listener, and the wishes that came; whoever acts on them tells at the desk."""
    wishes: list[Asked] = []

    def acted(wish: Asked) -> None:
        wishes.append(wish)
        if act is not None:
            threading.Thread(target=act, args=(desk, wish), daemon=True).start()

    desk = StopService({"valve": "V"}, "run", acted)
    listener = Listener(desk, "run")
    try:
        yield listener, wishes
    finally:
        listener.close()


def tell_safe(desk: StopService, _wish: Asked) -> None:
    """The outputs were read back safe, a moment after it was asked for."""
    time.sleep(0.02)
    desk.tell(SAFE, "run")
