"""Messages to an instrument on VXI-11, HiSLIP, USBTMC or GPIB and back, by pyvisa-py."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from drivers._edge import quiet
from hil.system import system
from hil.system.tcp import close, guard, is_hung_up, kept_by


class VisaPort:
    """A resource of VISA, used as `drivers._ports.TcpPort`.

    An instrument keeps an answer until it is fetched, also for who connects next. So it is cleared when it is opened
    (device clear of IEEE 488.2), and given up after an answer that did not come.

    Args:
        name: of the resource, such as `TCPIP::192.168.1.5::hislip0::INSTR`.
        timeout_s: an answer that takes longer counts as none.
        end: of an answer; where the transport ends a message, it may leave that out.

    Raises:
        Exception: nobody is there; of every method but the last three, what the library finds.
    """

    quiet_until_s = 0.0

    def __init__(self, name: str, timeout_s: float, end: bytes) -> None:
        quiet("pyvisa")
        self._held, self._timeout_s, self._end = system.visa(name, timeout_s), timeout_s, end
        self._sockets: list[Any] = []
        self._is_silent = False
        self.line = system.rlock()
        try:
            interface = self._held.visalib.sessions[self._held.session].interface
            self._sockets = kept_by(interface)
            for made in self._sockets:
                guard(made, timeout_s)
            if hasattr(interface, "destroy_link"):
                self._in_time(interface)
            self._held.timeout = _ms(timeout_s)
            self._held.clear()
        except BaseException:
            self.drop()
            raise

    def _in_time(self, interface: Any) -> None:
        """Have VXI-11 wait no longer than it is told: the library grants an instrument that is gone one more second.

        A link ends with its connection; nobody is asked to end it.
        """
        call = interface.do_call

        def done() -> None:
            interface.timeout = min(interface.timeout, self._held.timeout / 1000.0)
            try:
                call()
            except TimeoutError:  # the library takes that for a fault of its own
                self._is_silent = True
                raise

        interface.do_call, interface.destroy_link = done, lambda _link: 0

    @property
    def is_hung_up(self) -> bool:
        """Whether the instrument has closed it."""
        return any(map(is_hung_up, self._sockets))

    def write(self, data: bytes) -> None:
        """Send one message."""
        self._held.timeout = _ms(self._timeout_s)
        self._held.write_raw(data)

    def read(self, wait_s: float) -> bytes:
        """One whole message, empty where none came in this time."""
        from pyvisa.constants import StatusCode
        from pyvisa.errors import VisaIOError

        self._held.timeout, self._is_silent = _ms(wait_s), False
        try:
            message: bytes = self._held.read_raw()
        except VisaIOError as error:
            if error.error_code != StatusCode.error_timeout and not self._is_silent:
                raise
            return b""
        return message if message.endswith(self._end) else message + self._end

    def hold_nothing_back(self) -> None:
        """It is given up before anything else is sent on it."""

    def drop(self) -> None:
        """Give it up: nothing more is sent on it."""
        self.let_go(0.0)

    def let_go(self, patience_s: float | None = None) -> None:
        """Close it in order."""
        for made in self._sockets:
            close(made, self._timeout_s if patience_s is None else patience_s)
        with suppress(Exception):
            self._held.close()


def _ms(time_s: float) -> int:
    return max(1, round(1000.0 * time_s))
