"""A line of text to a device and one back: what the serial drivers have in common."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from pydantic import PositiveFloat, PositiveInt

from drivers._edge import message_of
from drivers._meeting import RequestLine, RequestSettings
from drivers._ports import TcpPort, host_and_port, serial_port
from drivers._shared_port import SharedPort
from drivers._start_up import once_started
from drivers._visa import VisaPort
from hil.daq.address import address_fault, is_visa
from hil.daq.channel import Wiring
from hil.description.named import Described
from hil.description.text import ENDS, Talk
from hil.errors import DeviceLostError, LinkError
from hil.system import system

_NOISE = b"\x00\xff\r\n"  # what a line reads as while a transceiver turns around, and ends that are longer than ours
_LONGEST = 4096  # an answer without an end
_FIRST = 10  # answers on a line: a device that needs a pause falls silent among them


class SerialSettings(RequestSettings, Described):
    """How a device that answers lines of text is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
        address: a serial port, `usb:` with the number or place of its adapter, `socket://host:port`,
            `rfc2217://host:port`, or a resource of VISA.
        baud: of a serial port.
        timeout_s, longest_reply_s, echo, pause_s: see `RequestSettings`.
    """

    baud: PositiveInt = 9600
    timeout_s: PositiveFloat = 0.5


def needed_for(settings: SerialSettings) -> tuple[str, ...]:
    """Packages that must be installed to reach it."""
    return ("pyvisa_py" if is_visa(settings.address) else "serial",)


def answering(settings: Any, wiring: Wiring, talk: Talk, hello: str, end: str, *, driver: str) -> Line:
    """A line whose device has answered to `hello`; only open where there is nothing to ask.

    Where nothing is wanted but that outputs become safe, the line is handed over without an answer too.

    Raises:
        LinkError: it did not, in the time of its start-up.
    """
    reached = settings.model_copy(
        update={"echo": settings.echo or talk.echo, "pause_s": max(settings.pause_s, talk.pause_s)}
    )

    def asked() -> Line:
        line = Line(reached, end, ENDS[talk.answer_end] if talk.answer_end else end, driver=driver)
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


class Line(RequestLine):
    """A serial port (`/dev/ttyUSB0`), a serial server (`socket://host:port`), one by RFC 2217, or a resource of VISA.

    An answer on such a line has no number. So after a failure nothing is asked until no late answer can come any
    more, and then the line begins empty.

    Args:
        settings: how it is reached.
        end: of requests.
        answer_end: of answers.
        driver: whose line it is, for the log of its frames.

    Raises:
        DeviceLostError: the port cannot be opened.
    """

    def __init__(self, settings: SerialSettings, end: str, answer_end: str, *, driver: str) -> None:
        super().__init__(settings, driver)
        self._baud, self._end, self._answer_end = settings.baud, end.encode("ascii"), answer_end.encode("ascii")
        self._answers = 0
        self.connect()

    def ask(self, request: str) -> str:
        """The answer to a request, without its end.

        Raises:
            LinkError: none came in time, or one that is no text.
            DeviceLostError: the port is gone.
        """
        self.meet()
        answer = self._answer_to(request)
        self._answers += 1
        self._rest_until_s = system.now_s() + self._pause_s
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
        """Send what has no answer after no more than a pause: also while a late answer may still come.

        Raises:
            DeviceLostError: the port is gone, or who answered last on it is another device.
        """
        self.connect()
        if was_clean := self.is_clean:
            with suppress(LinkError):  # nobody says what it is: on its own port a safe value is sent all the same
                self.meeting.take_place()
        self.meeting.refuse_another()
        system.sleep(max(0.0, self._rest_until_s - system.now_s()))
        self._send(request)
        self._rest_until_s = system.now_s() + self._pause_s
        if not was_clean:  # one that is sent into a silence may be answered all the same
            self._keep_quiet()

    def failed(self, text: str) -> LinkError:
        """After an answer that cannot be used nothing is asked for a while; what comes then is thrown away."""
        self._keep_quiet()
        if isinstance(self._port, VisaPort):  # what the instrument still says would be its next answer
            self.drop()
        elif self._port is not None:
            self._port.hold_nothing_back()
        return LinkError(text)

    def _opened(self) -> TcpPort | SharedPort | VisaPort:
        if fault := address_fault(self._address):
            raise DeviceLostError(fault)
        if is_visa(self._address):
            try:
                return VisaPort(self._address, self._timeout_s, self._answer_end)
            except Exception as error:
                raise DeviceLostError(f"{self._address}: cannot be opened: {message_of(error)}") from None
        behind = host_and_port(self._address.partition("socket://")[2])
        if behind is None:
            return serial_port(self._place, self._timeout_s, self._baud, "N", exclusive=None)
        try:
            return TcpPort(*behind, self._timeout_s)
        except OSError as error:
            raise DeviceLostError(f"{self._address}: cannot be opened: {error}") from None

    def _send(self, request: str) -> bytes:
        sent = request.encode("ascii") + self._end
        self._done(lambda: self._port.write(sent))
        self._log.debug("→ %r", sent)
        return sent

    def _answer_to(self, request: str) -> bytes:
        """What comes up to the end of the answer, without noise around it."""
        with self._port.line:
            until_s, sent = system.now_s() + self._timeout_s, self._send(request)
            end, came = self._answer_end[-1:], b""  # an answer may end with it alone
            while end not in (received := self._without_echo(sent, came)).lstrip(_NOISE):
                left_s = until_s - system.now_s()
                if left_s <= 0.0 or len(came) > _LONGEST:
                    cut = f", only {received!r}" if received else ""
                    raise self.failed(f"no answer within {self._timeout_s:g} s{cut or self._may_rest()}")
                came += self._done(lambda: self._port.read(left_s))  # noqa: B023 - at once
        self._log.debug("← %r", received)
        answer, _, more = received.lstrip(_NOISE).partition(end)
        if more.strip(_NOISE):
            raise self.failed(f"more came than was asked for: {received!r}")
        return answer.removesuffix(b"\r")  # some instruments end with CR LF whatever they are told

    def _may_rest(self) -> str:
        """A device that falls silent between its first answers may be one that needs a pause."""
        first = 0 < self._answers < _FIRST and not self._pause_s
        return "; if it answers now and then, it may need a pause between frames: say pause_s" if first else ""

    def _done(self, what: Callable[[], Any]) -> Any:
        try:
            return what()
        except Exception as error:  # pyserial raises its own, those of the system, and those of its protocols
            self.drop()
            raise DeviceLostError(f"{self._address}: the line is gone: {error or type(error).__name__}") from error
