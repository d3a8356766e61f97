"""Devices that answer a line of text with a line of text."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from sim_devices._field import Side
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer, serve_stream


class TextDevice:
    """A device whose requests and answers end with `end`. Subclasses say what it answers, None for nothing.

    Attributes:
        side: its terminals.
    """

    end = b"\n"

    def __init__(self, side: Side) -> None:
        self.side = side
        self.heard_s = side.clock.now_s

    def answer_to(self, request: str) -> str | None:
        """The answer to one line."""
        raise NotImplementedError

    def request_in(self, received: bytes) -> tuple[bytes, bytes]:
        """The first whole line, with its end, and what is left."""
        line, end, rest = received.partition(self.end)
        return (line + end, rest) if end else (b"", received)

    def answer(self, request: bytes) -> bytes:
        """The answer to one line of bytes; what is no text is not understood and not answered."""
        try:
            text = request.removesuffix(self.end).decode("ascii")
        except UnicodeDecodeError:
            return b""
        answer = self.answer_to(text)
        return b"" if answer is None else answer.encode("ascii") + self.end

    def restart(self) -> None:
        """Be as after power-on."""

    def tick(self) -> None:
        """Look at the clock."""


def serve_text(
    make: Callable[[Side], TextDevice], settings: Mapping[str, Any], side: Side, quirks: Quirks
) -> StreamServer:
    """Serve a device on a TCP port (`socket://host:port`) or a pseudo terminal of that name."""
    return serve_lines(make(side), settings, side, quirks)


def serve_lines(device: TextDevice, settings: Mapping[str, Any], side: Side, quirks: Quirks) -> StreamServer:
    """The same of a device that is made."""
    return serve_stream(device, side, quirks, str(settings["address"]))
