"""Requests to a Modbus device and their answers, each of which is checked to be the answer to just this request."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NoReturn

from drivers._edge import quiet
from drivers._meeting import RequestLine
from drivers._modbus_client import LineSettings, belongs, request
from drivers._ports import TcpPort, host_and_port, serial_port
from drivers._shared_port import SharedPort
from hil.errors import DeviceLostError, LinkError
from hil.system import system


class ModbusLine(RequestLine):
    """A device on its line, asked request by request.

    Args:
        settings: how it is reached.
        heard: told of every valid answer.
    """

    def __init__(self, settings: LineSettings, heard: Callable[[], None]) -> None:
        from pymodbus.framer import FramerRTU, FramerSocket
        from pymodbus.pdu import DecodePDU

        quiet("pymodbus.logging")
        super().__init__(settings, "modbus")
        self._settings, self._on_answer = settings, heard
        self._sent = self._came = b""
        self._number = 0  # of a transaction
        self.has_read = False  # whether readings have come: a device that needs a pause falls silent before
        self._has_answered = False
        self._is_tcp = settings.transport == "tcp"
        self._framer = (FramerSocket if self._is_tcp else FramerRTU)(DecodePDU(False))

    def close(self) -> None:
        """Let go of it: what was sent goes out."""
        self._leave(in_order=True)

    def _opened(self) -> TcpPort | SharedPort:
        settings, behind = self._settings, self._address if self._is_tcp else self._address.partition("socket://")[2]
        if not behind:
            return serial_port(self._place, self._timeout_s, settings.baud, settings.parity, exclusive=True)
        try:
            return TcpPort(*(host_and_port(behind) or ("", 0)), self._timeout_s)
        except OSError as error:
            raise DeviceLostError(f"{self._address}: cannot be reached") from error

    def identity(self) -> str:
        """What the device says of itself; most that say nothing refuse the question at once.

        Raises:
            DeviceLostError: it hung up on the question, which is no answer to it.
        """
        from pymodbus.exceptions import ModbusException
        from pymodbus.pdu.mei_message import ReadDeviceInformationRequest

        self._wait()
        try:
            self.connect()
            answer = self.exchange(ReadDeviceInformationRequest(dev_id=self._settings.unit_id))
            objects: Mapping[int, bytes] = {} if answer.isError() else answer.information
        except OSError as error:
            self._fail(error, DeviceLostError, "the connection is lost")
        except (ModbusException, AttributeError):  # none, or one to another question
            self._give_up()  # the next question begins on a new connection
            return ""
        self._rest_until_s = system.now_s() + self._pause_s
        return " ".join(part.decode("ascii", "replace").strip() for part in objects.values() if isinstance(part, bytes))

    def tell_blindly(self, requests: Sequence[tuple[int, int, Sequence[int]]]) -> None:
        """Send (function, address, values) without waiting for what the device says to them.

        Raises:
            DeviceLostError: who answered last is another device.
        """
        self.meeting.refuse_another()
        with suppress(Exception):  # the checked writing that follows says what is wrong
            self.connect()
            for function, address, values in requests:
                self.exchange(request(function, address, 1, values, self._settings.unit_id), blindly=True)
            if not self._is_tcp:
                self._keep_quiet()  # the device may answer all the same
        self.close()

    def ask(self, function: int, address: int, *, count: int = 1, values: Sequence[int] = ()) -> list[int]:
        """One request and its answer; a device that is busy is asked again, as its specification wants it.

        Raises:
            LinkError: none came, or one that is refused or belongs to another request.
            DeviceLostError: the connection is gone.
        """
        self.meet()
        answer = self._valid_answer(request(function, address, count, values, self._settings.unit_id))
        if answer.isError():
            raise LinkError(
                f"function {function} at register {address:#06x} is refused with exception {answer.exception_code}"
                f"{_EXCEPTIONS.get(answer.exception_code, '')}{_counted_otherwise(answer.exception_code, address)}"
            )
        if not belongs(answer, function, address, count, values):
            echo = ": an adapter that echoes does so, then say echo = true" if self._may_echo else ""
            may_be = ": one to an earlier request may have come late" if echo and self.has_read else echo
            self._fail(
                None, LinkError, f"an answer that does not belong to function {function} at {address:#06x}{may_be}"
            )
        if self._two_came(len(answer.encode()) + _AROUND):
            self._fail(None, LinkError, f"two answers came to function {function} at {address:#06x}: one is another's")
        self._rest_until_s = system.now_s() + self._pause_s
        return [int(bit) for bit in answer.bits[:count]] if function in (1, 2) else list(answer.registers)

    def _valid_answer(self, asked: Any) -> Any:
        try:
            answer = self.exchange(asked)
        except OSError as error:
            self._fail(error, DeviceLostError, "the connection is lost")
        except Exception as error:  # whatever the library makes of what came
            self._fail(error, LinkError, f"no valid answer within {self._timeout_s:g} s{self._what_came()}")
        self._on_answer()
        self._has_answered = True
        return answer

    def exchange(self, asked: Any, *, blindly: bool = False) -> Any:
        """A request of the library on the open line, and its answer; `blindly` without waiting for it.

        Who is busy is asked again while an answer as quick as that one would come in time, and holds the line no
        longer than one who is silent.

        Raises:
            OSError: the connection is gone.
            ModbusException: no answer came in time.
        """
        with self._port.line:
            until_s = system.now_s() + self._timeout_s
            while True:
                begun_s = system.now_s()
                self._send(asked)
                if blindly:
                    return None
                answer = self._answer_to(asked, until_s)
                again_s = max(self._pause_s, _AGAIN_S)
                took_s = system.now_s() - begun_s
                if not _is_busy(answer) or system.now_s() + again_s + took_s > until_s:
                    return answer
                system.sleep(again_s)

    def _send(self, asked: Any) -> None:
        asked.transaction_id = self._number = self._number % 0xFFFF + 1
        self._sent, self._came = self._framer.buildFrame(asked), b""
        self._log.debug("→ %s", self._sent.hex(" "))
        self._port.write(self._sent)

    def _answer_to(self, asked: Any, until_s: float) -> Any:
        """What comes under the number of a request."""
        from pymodbus.exceptions import ModbusIOException

        received = b""
        while True:
            left_s = until_s - system.now_s()
            received += (more := self._port.read(left_s))
            if more:
                self._take(received)
                _, answer = self._framer.handleFrame(self._came, asked.dev_id, asked.transaction_id)
                if answer is not None:
                    return answer
            elif left_s <= 0.0:
                raise ModbusIOException("no answer")

    def _take(self, received: bytes) -> None:
        """What has come up to now, without the echo of what was sent."""
        self._log.debug("← %s", received.hex(" "))
        came = self._without_echo(self._sent, received)
        self._came = came if self._is_tcp else self._from_the_answer_on(came)

    def _two_came(self, length: int) -> bool:
        """Whether behind an answer on a serial line there is another one: which is which nobody can tell.

        The same one twice is one; a byte of noise behind an answer is none.
        """
        if self._is_tcp:
            return False
        answer, rest = self._came[:length], self._came[length:]
        return self._sent[:2] in rest and not answer.startswith(rest[:length])  # of the second a part may have come

    def _what_came(self) -> str:
        """What can be said of an answer that was none."""
        if not self._came:
            may_rest = not self._is_tcp or self._has_answered  # behind a gateway too
            never = may_rest and not self.has_read and not self._pause_s
            return "; if it answers now and then, it may need a pause between frames: say pause_s" if never else ""
        if self._is_tcp and self._came[:2] != self._sent[:2]:
            came, sent = (int.from_bytes(frame[:2], "big") for frame in (self._came, self._sent))
            return (
                f": one came, but with transaction number {came} instead of {sent}: a gateway that numbers by itself, "
                f"which cannot be used, or answers that come late"
            )
        if (unit := self._came[self._unit_at :][:1]) and unit != self._sent[self._unit_at :][:1]:
            return f": unit {unit[0]} answered, and unit {self._settings.unit_id} was asked; check unit_id"
        if self._may_echo and self._came.startswith(self._sent):
            return ": what was sent came back: the adapter echoes, say echo = true"
        return f": what came is none ({self._came[:20].hex(' ')})"

    @property
    def _unit_at(self) -> int:
        """Where in a frame the unit number stands."""
        return 6 if self._is_tcp else 0

    @property
    def _may_echo(self) -> bool:
        return not self._is_tcp and not self._echo

    def _from_the_answer_on(self, frame: bytes) -> bytes:
        """What came on a serial line without the noise of its turning around: the library takes that for an answer."""
        unit_id, function = self._sent[:2]
        starts = (i for i in range(len(frame) - 1) if frame[i] == unit_id and frame[i + 1] & 0x7F == function)
        return frame[next(starts, 0) :]

    def _fail(self, error: Exception | None, kind: type[Exception], text: str) -> NoReturn:
        self._give_up(is_lost=kind is DeviceLostError)
        raise kind(text) from error

    def _give_up(self, *, is_lost: bool = False) -> None:
        """Drop the connection; on a serial line that is not lost a late answer may still come."""
        if not self._is_tcp and not is_lost:
            self._keep_quiet()
        self.drop()


_AROUND = 4  # bytes of an answer on a serial line beside its data: unit, function, checksum
_EXCEPTIONS = {
    1: " (unknown function)",
    2: " (no such register)",
    3: " (value not allowed)",
    4: " (device failure)",
    5: " (accepted, but it takes long)",
    6: " (device busy)",
    8: " (memory of the device is at fault)",
    10: " (gateway: no path to the device; check its port and unit_id)",
    11: " (gateway: the device behind it does not answer; check unit_id, wiring and baud rate there)",
}
_NO_SUCH_REGISTER, _BUSY = 2, 6
_AGAIN_S = 0.02  # to who was busy


def _is_busy(answer: Any) -> bool:
    return bool(answer.isError() and answer.exception_code == _BUSY)


def _counted_otherwise(code: int, address: int) -> str:
    """A register that there is not is mostly one that the manual counts otherwise."""
    if code != _NO_SUCH_REGISTER:
        return ""
    for first, table in ((400001, "holding"), (300001, "input"), (40001, "holding"), (30001, "input")):
        if first <= address <= first + 9998:
            return f"; what a manual calls {address} is usually {table} register {address - first} on the wire"
    return f"; a manual that counts from 1 calls this one {address + 1}"
