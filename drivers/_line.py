"""A line of text to a device and one back: what the serial drivers have in common."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

from hil.errors import DeviceLostError, LinkError

_LOOK_S = 0.02  # how often the clock is looked at while an answer is waited for
_LONGEST = 4096  # an answer without an end


class Line:
    """A serial port (`/dev/ttyUSB0`), a serial server (`socket://host:port`) or one by RFC 2217.

    An answer on such a line has no number. So after a failure nothing is asked until no late answer can come any
    more, and then the line begins empty.

    Args:
        address: as pyserial takes it.
        baud: of a real line.
        end: of requests and answers.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: no answer comes later than that.

    Raises:
        DeviceLostError: the port cannot be opened.
    """

    def __init__(self, address: str, baud: int, end: str, timeout_s: float, longest_reply_s: float) -> None:
        self._address, self._baud, self._end = address, baud, end.encode("ascii")
        self._timeout_s, self._longest_reply_s = timeout_s, longest_reply_s
        self._quiet_until_s = 0.0
        self._port: Any = None
        self._open()

    def ask(self, request: str) -> str:
        """The answer to a request, without its end.

        Raises:
            LinkError: none came in time, or one that is no text.
            DeviceLostError: the port is gone.
        """
        self._wait_until_clean()
        self._send(request)
        answer = self._received(time.monotonic() + self._timeout_s)
        try:
            return answer.decode("ascii")
        except UnicodeDecodeError:
            raise self.failed(f"garbled answer {answer!r} to {request}") from None

    def ask_first(self, request: str) -> str:
        """Like `ask`, for the first request on a line: what an earlier program left on it may come in between."""
        try:
            return self.ask(request)
        except LinkError:
            return self.ask(request)

    def tell(self, request: str) -> None:
        """Send what has no answer, at once: also while a late answer may still come."""
        if self._port is None:
            self._open()
        self._send(request)

    @property
    def is_clean(self) -> bool:
        """Whether the next answer can only be that to the next request."""
        return time.monotonic() >= self._quiet_until_s

    def failed(self, text: str) -> LinkError:
        """After an answer that cannot be used nothing is asked for a while; what comes then is thrown away."""
        self._quiet_until_s = time.monotonic() + self._longest_reply_s
        return LinkError(text)

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        if port is not None:
            behind = getattr(port, "_socket", None)  # pyserial leaves it open when the other side is gone
            with suppress(OSError):
                port.close()
            if behind is not None:
                behind.close()

    def _open(self) -> None:
        import serial

        try:
            more: dict[str, Any] = {} if self._address.startswith("rfc2217:") else {"write_timeout": self._timeout_s}
            look_s = min(self._timeout_s, _LOOK_S)  # set once: on some ports a change is a negotiation
            self._port = serial.serial_for_url(self._address, baudrate=self._baud, timeout=look_s, **more)
        except (OSError, ValueError) as error:
            raise DeviceLostError(f"{self._address}: cannot be opened: {error}") from None

    def _send(self, request: str) -> None:
        try:
            if self._port.in_waiting:
                self._port.reset_input_buffer()  # nobody asked for it
            self._port.write(request.encode("ascii") + self._end)
        except OSError as error:
            self.close()
            raise DeviceLostError(f"{self._address}: the line is gone: {error}") from None

    def _received(self, until_s: float) -> bytes:
        received = b""
        while self._end not in received:
            left_s = until_s - time.monotonic()
            if left_s <= 0.0 or len(received) > _LONGEST:
                cut = f", only {received!r}" if received else ""
                raise self.failed(f"no answer within {self._timeout_s:g} s{cut}")
            try:
                received += self._port.read(max(1, self._port.in_waiting))
            except OSError as error:
                self.close()
                raise DeviceLostError(f"{self._address}: the line is gone: {error}") from None
        answer, _, more = received.partition(self._end)
        if more:
            raise self.failed(f"more came than was asked for: {received!r}")
        return answer

    def _wait_until_clean(self) -> None:
        wait_s = self._quiet_until_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        if self._port is None:
            self._open()
