"""A line of text to a device and one back: what the serial drivers have in common."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

from pydantic import ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._edge import discarded, guard_port, wire_log
from drivers._meeting import Meeting
from drivers._start_up import once_started
from hil.daq.address import Port, address_fault
from hil.daq.channel import Wiring
from hil.daq.connection import close, is_hung_up
from hil.description.named import Described
from hil.description.text import ENDS, Talk
from hil.errors import DeviceLostError, LinkError

_NOISE = b"\x00\xff\r\n"  # what a line reads as while a transceiver turns around, and ends that are longer than ours
_LOOK_S = 0.02  # how often the clock is looked at while an answer is waited for
_LONGEST = 4096  # an answer without an end
_FIRST = 10  # answers on a line: a device that needs a pause falls silent among them


class SerialSettings(Described):
    """How a device that answers lines of text is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
        address: a serial port, `socket://host:port`, or `rfc2217://host:port`.
        baud: of a serial port.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: after a failure nothing is asked for so long, so that a late answer passes.
        echo: what is sent comes back before the answer, as some RS-485 adapters do.
        pause_s: so long nothing is asked after an answer, for adapters that need to turn around.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str
    baud: PositiveInt = 9600
    timeout_s: PositiveFloat = 0.5
    longest_reply_s: PositiveFloat = 1.0
    echo: bool = False
    pause_s: float = Field(default=0.0, ge=0.0, le=1.0)


def answering(settings: Any, wiring: Wiring, talk: Talk, hello: str, end: str, *, driver: str) -> Line:
    """A line whose device has answered to `hello`; only open where there is nothing to ask.

    Where nothing is wanted but that outputs become safe, the line is handed over without an answer too.

    Raises:
        LinkError: it did not, in the time of its start-up.
    """

    def asked() -> Line:
        line = Line(
            settings.address, settings.baud, end, settings.timeout_s, settings.longest_reply_s, driver=driver,
            echo=settings.echo or talk.echo, pause_s=max(settings.pause_s, talk.pause_s),
            answer_end=ENDS[talk.answer_end] if talk.answer_end else "",
        )  # fmt: skip
        try:
            ask = line.ask if wiring.only_safe else line.ask_first
            line.meeting.met(ask(hello).strip() if hello else "", lambda: line.ask(hello).strip())
            return line
        except LinkError:
            if wiring.only_safe:
                return line
            line.close()
            raise
        except BaseException:
            line.close()
            raise

    return once_started(0.0 if wiring.only_safe else settings.startup_s, asked)


class Line:
    """A serial port (`/dev/ttyUSB0`), a serial server (`socket://host:port`) or one by RFC 2217.

    An answer on such a line has no number. So after a failure nothing is asked until no late answer can come any
    more, and then the line begins empty.

    Args:
        address: a port, `usb:` with the number or place of its adapter, or a serial server.
        baud: of a real line.
        end: of requests, and of answers where nothing else is said.
        timeout_s: an answer that takes longer counts as none.
        longest_reply_s: no answer comes later than that.
        driver: whose line it is, for the log of its frames.
        echo: what is sent comes back first.
        pause_s: so long nothing is asked after an answer.
        answer_end: of answers, where it is another one.

    Raises:
        DeviceLostError: the port cannot be opened.
    """

    def __init__(
        self, address: str, baud: int, end: str, timeout_s: float, longest_reply_s: float, *, driver: str,
        echo: bool = False, pause_s: float = 0.0, answer_end: str = "",
    ) -> None:  # fmt: skip
        self._address, self._baud, self._end = address, baud, end.encode("ascii")
        self._answer_end = (answer_end or end).encode("ascii")
        self._timeout_s, self._longest_reply_s = timeout_s, longest_reply_s
        self._echo, self._pause_s = echo, pause_s
        self._log = wire_log(driver, address)
        self._quiet_until_s = self._rest_until_s = 0.0
        self._answers = 0
        self._port: Any = None
        self.meeting = Meeting()
        self._place = Port(address)
        self._open()

    def ask(self, request: str) -> str:
        """The answer to a request, without its end.

        Raises:
            LinkError: none came in time, or one that is no text.
            DeviceLostError: the port is gone.
        """
        self._wait_until_clean()
        until_s = time.monotonic() + self._timeout_s
        answer = self._received(self._send(request, until_s), until_s)
        self._answers += 1
        self._rest_until_s = time.monotonic() + self._pause_s
        try:
            text = answer.decode("ascii")
        except UnicodeDecodeError:
            raise self.failed(f"garbled answer {answer!r} to {request}") from None
        if text == request:
            raise self.failed("what was sent came back: the adapter echoes, say echo = true")
        return text

    def ask_first(self, request: str) -> str:
        """Like `ask`, for the first request on a line: what an earlier program left on it may come in between."""
        try:
            return self.ask(request)
        except LinkError:
            return self.ask(request)

    def tell(self, request: str) -> None:
        """Send what has no answer, at once: also while a late answer may still come.

        Raises:
            DeviceLostError: the port is gone, or who answered last on it is another device.
        """
        if self._port is None:
            self._open()
        if self.is_clean:
            with suppress(LinkError):  # nobody says what it is: on its own port a safe value is sent all the same
                self.meeting.take_place()
        self.meeting.refuse_another()
        self._send(request, time.monotonic() + self._timeout_s)
        self._rest_until_s = time.monotonic() + self._pause_s

    @property
    def is_clean(self) -> bool:
        """Whether the next answer can only be that to the next request."""
        return time.monotonic() >= self._quiet_until_s

    @property
    def is_hung_up(self) -> bool:
        """Whether it is not open, or the other side has closed it meanwhile."""
        behind = getattr(self._port, "_socket", None)
        return self._port is None or (behind is not None and is_hung_up(behind))

    def meet(self) -> None:
        """Open it where it is not, and ask who answers; raises as `ask`."""
        self._wait_until_clean()

    def failed(self, text: str) -> LinkError:
        """After an answer that cannot be used nothing is asked for a while; what comes then is thrown away."""
        self._quiet_until_s = time.monotonic() + self._longest_reply_s
        if self._port is not None and getattr(self._port, "_socket", None) is None:
            with suppress(Exception):  # what a held line kept back would go out after what is sent next
                self._port.reset_output_buffer()
        return LinkError(text)

    def close(self) -> None:
        """Close the port; what was sent goes out, unless an answer is missing."""
        port, self._port = self._port, None
        if port is None:
            return
        if not self.is_clean:
            discarded(port)
            return
        behind = getattr(port, "_socket", None)  # pyserial leaves it open when the other side is gone
        if behind is not None:
            close(behind, self._timeout_s)
        with suppress(Exception):
            port.close()

    def _open(self) -> None:
        import serial

        if fault := address_fault(self._address):
            raise DeviceLostError(fault)
        path = self._place.path()
        try:
            more: dict[str, Any] = {} if self._address.startswith("rfc2217:") else {"write_timeout": self._timeout_s}
            look_s = min(self._timeout_s, _LOOK_S)  # set once: on some ports a change is a negotiation
            self._port = serial.serial_for_url(path, baudrate=self._baud, timeout=look_s, **more)
            guard_port(self._port, self._timeout_s)
            self.meeting.is_due()
        except (OSError, ValueError) as error:
            raise DeviceLostError(f"{self._address}: cannot be opened: {_cause(error, path)}") from None

    def _send(self, request: str, until_s: float) -> bytes:
        """Send; returns what has come of the answer while the echo was waited for."""
        sent = request.encode("ascii") + self._end
        try:
            if self._port.in_waiting:
                self._port.reset_input_buffer()  # nobody asked for it
            self._port.write(sent)
        except Exception as error:  # pyserial raises its own, those of the system, and those of its protocols
            raise self._gone(error) from error
        self._log.debug("→ %r", sent)
        came = b""
        while self._echo and came != sent and sent.startswith(came) and time.monotonic() < until_s:
            came += self._read(len(sent) - len(came))
        return b"" if came == sent else came

    def _received(self, received: bytes, until_s: float) -> bytes:
        """What comes up to the end of the answer, without noise around it."""
        end = self._answer_end[-1:]  # an answer may end with it alone
        while end not in received.lstrip(_NOISE):
            left_s = until_s - time.monotonic()
            if left_s <= 0.0 or len(received) > _LONGEST:
                cut = f", only {received!r}" if received else ""
                raise self.failed(f"no answer within {self._timeout_s:g} s{cut or self._may_rest()}")
            received += self._read(_LONGEST)
        self._log.debug("← %r", received)
        answer, _, more = received.lstrip(_NOISE).partition(end)
        if more.strip(_NOISE):
            raise self.failed(f"more came than was asked for: {received!r}")
        return answer.removesuffix(b"\r")  # some instruments end with CR LF whatever they are told

    def _may_rest(self) -> str:
        """A device that falls silent between its first answers may be one that needs a pause."""
        first = 0 < self._answers < _FIRST and not self._pause_s
        return "; if it answers now and then, it may need a pause between frames: say pause_s" if first else ""

    def _read(self, most: int) -> bytes:
        try:
            return bytes(self._port.read(max(1, min(most, self._port.in_waiting))))
        except Exception as error:
            raise self._gone(error) from error

    def _gone(self, error: Exception) -> DeviceLostError:
        port, self._port = self._port, None
        discarded(port)
        return DeviceLostError(f"{self._address}: the line is gone: {error or type(error).__name__}")

    def _wait_until_clean(self) -> None:
        wait_s = max(self._quiet_until_s, self._rest_until_s) - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        if self._port is None:
            self._open()
        self.meeting.take_place()


def _cause(error: Exception, path: str) -> str:
    """Why a port cannot be opened, without its name, which the library says once more."""
    return str(error).partition(f"ould not open port {path}: ")[2] or str(error)
