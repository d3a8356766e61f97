"""Requests to a Modbus device and their answers, each of which is checked to be the answer to just this request."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import NoReturn

from drivers._edge import wire_log
from drivers._meeting import Meeting
from drivers._modbus_client import LineSettings, belongs, client_of, request
from hil.daq.connection import is_hung_up
from hil.errors import DeviceLostError, LinkError


class ModbusLine:
    """A device on its line, asked request by request.

    Args:
        settings: how it is reached.
        heard: told of every valid answer.
    """

    def __init__(self, settings: LineSettings, heard: Callable[[], None]) -> None:
        self._settings, self._on_answer = settings, heard
        self._quiet_until_s = self._rest_until_s = 0.0
        self._sent = self._came = self._received = b""
        self.has_read = False  # whether readings have come: a device that needs a pause falls silent before
        self._has_answered = False
        self._log = wire_log("modbus", settings.address)
        self.client = client_of(settings, self._trace)
        self.meeting = Meeting()

    def connect(self) -> None:
        """Open the line if it is not.

        Raises:
            DeviceLostError: nobody is there.
        """
        if not self.client.connect():
            raise DeviceLostError(f"{self._settings.address}: cannot be reached")

    def meet(self) -> None:
        """Open it, and ask who answers."""
        self.connect()
        self.meeting.is_due()
        self.meeting.take_place()

    def close(self) -> None:
        """Let go of it."""
        self.client.let_go()

    @property
    def is_hung_up(self) -> bool:
        """Whether the device has closed the connection meanwhile."""
        held = self.client.socket
        return held is None or (isinstance(held, socket.socket) and is_hung_up(held))

    @property
    def is_clean(self) -> bool:
        """Whether the next answer can only be that to the next request."""
        return time.monotonic() >= self._quiet_s

    @property
    def _quiet_s(self) -> float:
        """Until when a late answer may still come, to this device or to another one on its line."""
        return max(self._quiet_until_s, getattr(self.client, "quiet_until_s", 0.0))

    def identity(self) -> str:
        """What the device says of itself; most that say nothing refuse the question at once."""
        from pymodbus.exceptions import ModbusException

        self._wait_until_clean()
        self._came = self._received = b""
        try:
            answer = self.client.read_device_information(device_id=self._settings.unit_id)
            objects: Mapping[int, bytes] = {} if answer.isError() else answer.information
        except (ModbusException, OSError, AttributeError):  # none, or one to another question
            self._give_up()  # the next question begins on a new connection
            return ""
        self._rest_until_s = time.monotonic() + self._settings.pause_s
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
                request(self.client, function, address, 1, values, self._settings.unit_id, blindly=True)
        self.client.let_go()

    def ask(self, function: int, address: int, *, count: int = 1, values: Sequence[int] = ()) -> list[int]:
        """One request and its answer.

        Raises:
            LinkError: none came, or one that is refused or belongs to another request.
            DeviceLostError: the connection is gone.
        """
        from pymodbus.exceptions import ConnectionException

        self._wait_until_clean()
        self._meet_anew()
        self._came = self._received = b""
        try:
            answer = request(self.client, function, address, count, values, self._settings.unit_id)
        except DeviceLostError:  # the port is not there, or not the same one any more
            raise
        except ConnectionException as error:
            self._fail(error, DeviceLostError, "the connection is lost")
        except Exception as error:  # whatever the library makes of what came
            self._fail(error, LinkError, f"no valid answer within {self._settings.timeout_s:g} s{self._what_came()}")
        self._on_answer()
        self._has_answered = True
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
        self._rest_until_s = time.monotonic() + self._settings.pause_s
        return [int(bit) for bit in answer.bits[:count]] if function in (1, 2) else list(answer.registers)

    def _meet_anew(self) -> None:
        if self.client.socket is None:
            if not self.client.connect():
                self._fail(None, DeviceLostError, "the connection is lost")
            self.meeting.is_due()
        self.meeting.take_place()

    def _two_came(self, length: int) -> bool:
        """Whether behind an answer on a serial line there is another one: which is which nobody can tell.

        The same one twice is one; a byte of noise behind an answer is none.
        """
        if self._settings.transport == "tcp":
            return False
        whole = self._received.removeprefix(self._sent) if self._settings.echo else self._received
        answer, rest = whole[:length], whole[length:]
        return self._sent[:2] in rest and not answer.startswith(rest[:length])  # of the second a part may have come

    def _what_came(self) -> str:
        """What can be said of an answer that was none."""
        if not self._came:
            may_rest = self._settings.transport == "rtu" or self._has_answered  # behind a gateway too
            never = may_rest and not self.has_read and not self._settings.pause_s
            return "; if it answers now and then, it may need a pause between frames: say pause_s" if never else ""
        if self._settings.transport == "tcp" and self._came[:2] != self._sent[:2]:
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
        return 6 if self._settings.transport == "tcp" else 0

    @property
    def _may_echo(self) -> bool:
        return self._settings.transport == "rtu" and not self._settings.echo

    def _trace(self, sending: bool, frame: bytes) -> bytes:
        if sending:
            self._sent = frame
        else:
            self._came = frame
        self._log.debug("%s %s", "→" if sending else "←", frame.hex(" "))
        if sending or self._settings.transport == "tcp":
            return frame
        came = self._from_the_answer_on(frame)  # the library shows it grow: the same bytes again, and more
        self._received = came if came.startswith(self._received) else self._received + frame
        return came

    def _from_the_answer_on(self, frame: bytes) -> bytes:
        """What came on a serial line without the noise of its turning around, which the library takes for an answer."""
        unit_id, function = self._sent[:2]
        starts = (i for i in range(len(frame) - 1) if frame[i] == unit_id and frame[i + 1] & 0x7F == function)
        return frame[next(starts, 0) :]

    def _wait_until_clean(self) -> None:
        """Let a late answer pass on a serial line, and a device its pause, before the next request."""
        wait_s = max(self._quiet_s, self._rest_until_s) - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        self._quiet_until_s = 0.0

    def _fail(self, error: Exception | None, kind: type[Exception], text: str) -> NoReturn:
        self._give_up(is_lost=kind is DeviceLostError)
        raise kind(text) from error

    def _give_up(self, *, is_lost: bool = False) -> None:
        """Drop the connection: what arrives on it from now on belongs to nobody; on one that is lost nothing does."""
        self.client.close()
        if self._settings.transport == "rtu" and not is_lost:
            self._quiet_until_s = time.monotonic() + self._settings.longest_reply_s
            if hasattr(self.client, "quiet_until_s"):
                self.client.quiet_until_s = self._quiet_until_s


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
_NO_SUCH_REGISTER = 2


def _counted_otherwise(code: int, address: int) -> str:
    """A register that there is not is mostly one that the manual counts otherwise."""
    if code != _NO_SUCH_REGISTER:
        return ""
    for first, table in ((400001, "holding"), (300001, "input"), (40001, "holding"), (30001, "input")):
        if first <= address <= first + 9998:
            return f"; what a manual calls {address} is usually {table} register {address - first} on the wire"
    return f"; a manual that counts from 1 calls this one {address + 1}"
