"""A serial line of a world, and devices at its end: a module in ASCII, a source in SCPI, an amplifier on Modbus RTU,
a controller in plain text.

Bytes take their time, in order; some may be lost, doubled, garbled or late. A garbled byte has its highest bit set, as
one whose stop bit was missed: a text without a checksum can have no other defence.
"""

from __future__ import annotations

import errno
import re
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Any

from tests.foreign_line import Tables, WholeRequest, ended, serial_frame
from tests.worlds.devices import Device
from tests.worlds.tasks import Hub, Waiters

DELAY_S = (1e-4, 1e-3)
LATE_S = 0.1  # both pieces of an answer come sooner than `longest_reply_s`
QUIET_S = 0.25  # after a request that nothing came to: `longest_reply_s` of the bench file
_SILENCE_S = 0.01  # between two frames of Modbus RTU


class SerialLine:
    """The way between one device and the port of this computer that is open on it.

    Attributes:
        is_out: no byte arrives on either side.
        echoes: what is sent comes back.
        late_chance: of an answer, to come up to `LATE_S` later.
        loses, doubles, garbles: chance of each byte.
        delay_s: least and greatest time that a few bytes take beside their own.
        is_pulled: the adapter is gone; a port that was open on it never works again.
        is_answered: whether the device says something to a request.
        sent: every request of a program: (s, bytes).
        hasty: what a program sent while an answer to an earlier request of it might still come: (s, bytes).
    """

    def __init__(self, hub: Hub, hear: Callable[[bytes], None]) -> None:
        self._hub, self._hear = hub, hear
        self.is_answered: Callable[[bytes], bool] = lambda _request: True
        self.sent: list[tuple[float, bytes]] = []
        self.hasty: list[tuple[float, bytes]] = []
        self._open_s: dict[Any, float] = {}  # by process: since when it waits for an answer
        self._quiet_s: dict[Any, float] = {}  # until when it keeps quiet
        self.is_out = self.is_pulled = self.echoes = False
        self.loses = self.doubles = self.garbles = self.late_chance = 0.0
        self.delay_s = DELAY_S
        self.ports: list[SerialPort] = []
        self._there_s = self._here_s = 0.0

    def pull(self, away_s: float) -> None:
        """The adapter is pulled out, and put back."""
        self.is_pulled = True
        self._open_s.clear()  # with the adapter goes what is on its way
        self._quiet_s.clear()
        for port in self.ports:
            port.break_off()
        self._hub.after(away_s, lambda: setattr(self, "is_pulled", False))

    def to_device(self, data: bytes, byte_s: float) -> Sent:
        """Bytes leave this computer; who has them back before they do keeps them."""
        leaves_s = max(self._hub.now_s, self._there_s) + byte_s * len(data)
        self._there_s = max(self._there_s, leaves_s + self._hub.draw.uniform(*self.delay_s))
        sent = Sent(leaves_s)
        arriving = self._spoiled(data)
        self._hub.at(self._there_s, lambda: None if sent.is_taken_back else self._hear(arriving))
        if self.echoes:
            self._hub.at(leaves_s, lambda: self._arrive(data))
        return sent

    def from_device(self, data: bytes) -> float:
        """An answer, in one piece or in two; when it is there."""
        cut = self._hub.draw.randrange(len(data)) if len(data) > 1 else 0
        for piece in filter(None, (data[:cut], data[cut:])):
            byte_s = self.ports[-1].byte_s if self.ports else 0.0
            takes_s = byte_s * len(piece) + self._hub.draw.uniform(*self.delay_s)
            takes_s += self._hub.draw.uniform(0.0, LATE_S) if self._hub.draw.random() < self.late_chance else 0.0
            self._here_s = max(self._hub.now_s, self._here_s) + takes_s
            arriving = self._spoiled(piece)
            self._hub.at(self._here_s, lambda arriving=arriving: self._arrive(arriving))  # type: ignore[misc]
        return self._here_s

    def asked(self, process: Any, data: bytes) -> None:
        """A program sends a request."""
        self.sent.append((self._hub.now_s, data))
        if (open_s := self._open_s.get(process)) is not None:
            self._quiet_s[process] = max(self._quiet_s.get(process, 0.0), open_s + QUIET_S)
        if self._hub.now_s < self._quiet_s.get(process, 0.0):
            self.hasty.append((self._hub.now_s, data))
        if self.is_answered(data):
            self._open_s[process] = self._hub.now_s

    def _arrive(self, data: bytes) -> None:
        if self.ports and not self.is_pulled:
            self._open_s.pop(self.ports[-1].process, None)
            self.ports[-1].arrived(data)

    def _spoiled(self, data: bytes) -> bytes:
        if self.is_out:
            return b""
        if not (self.loses or self.doubles or self.garbles):
            return data
        draw, out = self._hub.draw, bytearray()
        for byte in data:
            if draw.random() < self.loses:
                continue
            spoiled = byte | 0x80 if draw.random() < self.garbles else byte
            out += bytes([spoiled]) * (2 if draw.random() < self.doubles else 1)
        return bytes(out)


class Sent:
    """Bytes that are in the buffer of a port until `leaves_s`."""

    def __init__(self, leaves_s: float) -> None:
        self.leaves_s, self.is_taken_back = leaves_s, False


class SerialPort:
    """As a port of pyserial, as far as `drivers._shared_port` uses one."""

    end = None

    def __init__(self, hub: Hub, line: SerialLine, process: Any, call: Callable[[], None], speech: Any) -> None:
        self.baudrate, self.parity = speech["baudrate"], speech["parity"]
        self.byte_s = 10.0 / self.baudrate
        self._hub, self._line, self.process, self._call, self._timeout_s = hub, line, process, call, speech["timeout"]
        self._received, self._sent = bytearray(), list[Sent]()
        self._is_closed = self._is_broken = False
        self._changed = Waiters(hub)
        self.holders = 1
        line.ports.append(self)
        process.connected_s.append(hub.now_s)
        process.sockets.append(self)

    @property
    def in_waiting(self) -> int:
        self._check()
        return len(self._received)

    def write(self, data: bytes) -> int:
        self._call()
        self._check()
        self._sent = [sent for sent in self._sent if sent.leaves_s > self._hub.now_s]
        self._line.asked(self.process, bytes(data))
        self._sent.append(self._line.to_device(bytes(data), self.byte_s))
        return len(data)

    def read(self, most: int) -> bytes:
        self._call()
        until_s = self._hub.now_s + self._timeout_s
        while len(self._received) < most and self._hub.now_s < until_s:
            self._check()
            self._changed.wait(until_s)
            self._call()
        self._check()
        came = bytes(self._received[:most])
        del self._received[:most]
        return came

    def reset_input_buffer(self) -> None:
        self._check()
        self._received.clear()

    def reset_output_buffer(self) -> None:
        self._check()
        for sent in self._sent:
            sent.is_taken_back = sent.leaves_s > self._hub.now_s

    def arrived(self, data: bytes) -> None:
        """Of the line."""
        self._received += data
        self._changed.wake()

    def break_off(self) -> None:
        """Its adapter is gone."""
        self._is_broken = True
        self._changed.wake()

    def close(self) -> None:
        self._call()
        self.close_by_system()

    def close_by_system(self) -> None:
        """What was written still leaves."""
        if not self._is_closed:
            self._is_closed = True
            self._line.ports.remove(self)
            self.process.sockets.remove(self)

    def _check(self) -> None:
        if self._is_closed or self._is_broken:
            raise OSError(errno.EIO, "Input/output error")


class OnALine(Device):
    """A device at the end of a serial line; a new request takes the place of one that is not whole after a while.

    Attributes:
        pause_s: so long after an answer it does not listen; rushed: when something came in it, which is lost, as what
            comes while it answers is.
    """

    whole: WholeRequest
    silence_s = float("inf")
    pause_s = 0.0
    safe = b""  # begin of what makes its output safe

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub)
        self.line = SerialLine(hub, self._take)
        self._came, self._came_s = b"", 0.0
        self._answered_s = -float("inf")
        self.rushed = list[float]()

    @abstractmethod
    def answer(self, request: bytes) -> bytes:
        """What it says to a request, nothing where it says nothing."""

    def restart(self, away_s: float) -> None:
        """Off for a while, its output at zero."""
        self.is_on, self._came = False, b""
        self.expire()
        self._hub.after(away_s, lambda: setattr(self, "is_on", True))

    def _take(self, data: bytes) -> None:
        if self.deaf or not self.is_on:
            return
        if (now_s := self._hub.now_s) < self._answered_s + self.pause_s:
            if now_s >= self._answered_s:  # before, who asks has had no answer: he breaks off
                self.rushed.append(now_s)
            return
        self._came = data if self._hub.now_s - self._came_s > self.silence_s else self._came + data
        self._came_s = self._hub.now_s
        whole = type(self).whole
        while count := whole(self._came):
            request, self._came = self._came[:count], self._came[count:]
            at_s = self.soon(5e-4, 3e-3)
            self._hub.at(at_s, lambda request=request: self._do(request))  # type: ignore[misc]

    def _do(self, request: bytes) -> None:
        if not self.is_on or self.deaf:
            return
        answer = self.answer(request)
        if answer and not self.mute:
            self._answered_s = self.line.from_device(answer)


class Module(OnALine):
    """An ADAM-4024 at address 01. Where its own watchdog has put an output it does not tell (see its manual)."""

    whole = staticmethod(ended(b"\r"))
    safe = b"#01C0+00.000"

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub)
        self._volts, self._tenths = 0.0, 0

    def put(self, percent: float) -> None:
        self._volts = percent / 10.0
        self.stands(percent)

    def expire(self) -> None:
        self.stands(0.0)

    def restart(self, away_s: float) -> None:
        self._volts, self._tenths = 0.0, 0
        super().restart(away_s)

    def answer(self, request: bytes) -> bytes:
        text = request.decode("latin1").rstrip("\r")
        if text[1:3] != "01" or text[:1] not in ("$", "#"):
            return b""
        said = self._said(text)
        if said is not None:
            self.heard(0.1 * self._tenths)
        return b"?01\r" if said is None else f"!01{said}\r".encode()

    def _said(self, text: str) -> str | None:
        if found := re.fullmatch(r"#01C0([+-]\d\d\.\d{3})", text):
            if not self.lies and abs(float(found[1])) <= 10.0:
                self.put(10.0 * float(found[1]))
            return "" if abs(float(found[1])) <= 10.0 else None
        if found := re.fullmatch(r"\$01X(\d{4})", text):
            self._tenths = int(found[1])
            return ""
        return {"$01M": "4024", "$018C0": "C0R32", "$016C0": f"{self._volts:+07.3f}"}.get(text)


class Source(OnALine):
    """A current source in SCPI, 0 … 3 A, with an error queue and without a watchdog."""

    whole = staticmethod(ended(b"\n"))
    pause_s = 0.004
    safe = b"SOUR:CURR 0"

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub)
        self.line.is_answered = lambda request: b"?" in request
        self._errors: deque[str] = deque()

    def put(self, percent: float) -> None:
        self.stands(percent)

    def expire(self) -> None:
        self._errors.clear()
        self.stands(0.0)

    def answer(self, request: bytes) -> bytes:
        units = [unit.strip().lstrip(":") for unit in request.decode("latin1").split(";")]
        answers = [answer for unit in units if (answer := self._done(unit))]
        return f"{';'.join(answers)}\n".encode() if answers else b""

    def _done(self, unit: str) -> str:
        if found := re.fullmatch(r"SOUR:CURR (\d+(?:\.\d+)?)", unit):
            if float(found[1]) > 3.0:
                self._errors.append('-222,"Data out of range"')
            elif not self.lies:
                self.stands(float(found[1]) / 0.03)
            return ""
        if unit == "SYST:ERR?":
            return self._errors.popleft() if self._errors else '0,"No error"'
        if unit == "*CLS":
            self._errors.clear()
            return ""
        amperes = 0.03 * self.percent
        noise = 1e-4 * self._hub.draw.randrange(4)
        if unit == "MEAS:CURR?":
            return f"{self.tells(round(amperes + noise, 4)):.4f}"
        answers = {"*IDN?": "world,source,17,1.0", "SOUR:CURR?": f"{amperes:.5f}"}
        if unit not in answers:
            self._errors.append('-113,"Undefined header"')
        return answers.get(unit, "")


class Controller(OnALine):
    """An Alicat mass flow controller with unit ID A, 0 … 100 l/min: a set point, and one frame that says everything."""

    whole = staticmethod(ended(b"\r"))
    safe = b"AS0"

    def put(self, percent: float) -> None:
        self.stands(percent)

    def expire(self) -> None:
        self.stands(0.0)

    def answer(self, request: bytes) -> bytes:
        text = request.decode("latin1").rstrip("\r")
        if found := re.fullmatch(r"AS(\d+(?:\.\d+)?)", text):
            if not self.lies and float(found[1]) <= 100.0:
                self.put(float(found[1]))
        elif text != "A":
            return b"?\r"
        flow = self.tells(round(self.percent + 0.01 * self._hub.draw.randrange(4), 2))
        return f"A +014.70 +024.38 {flow:+07.2f} {flow:+07.2f} {self.percent:+07.2f} Air\r".encode()


_TENTHS, _ENABLE, _CLEAR, _DEMAND_PER_PERCENT = 10, 11, 12, 100
_SAFE_MODE, _LEAVE = 0x10, 0x20


class Amplifier(OnALine, Tables):
    """An amplifier on Modbus RTU: its output obeys once it is enabled, without a fault and not in its safe mode."""

    whole = staticmethod(serial_frame)
    silence_s = _SILENCE_S
    safe = bytes([1, 16, 0, 0])

    def __init__(self, hub: Hub) -> None:
        OnALine.__init__(self, hub)
        registers = dict.fromkeys((0, _TENTHS, _ENABLE, _CLEAR), 0)
        Tables.__init__(self, holding=registers, inputs=dict.fromkeys(range(7), 0), identity="world amplifier 5")
        self._is_safe = False

    def put(self, percent: float) -> None:
        self.holding[0] = round(_DEMAND_PER_PERCENT * percent)
        self._obey()

    def expire(self) -> None:
        self._is_safe = bool(self.holding[_TENTHS])
        self._obey()

    def restart(self, away_s: float) -> None:
        self.holding = dict.fromkeys(self.holding, 0)
        super().restart(away_s)
        self._is_safe = False

    def fail(self, fails: bool) -> None:
        """A fault comes, or goes."""
        self.fails = fails
        self._obey()

    def answer(self, request: bytes) -> bytes:
        return self.on_serial(request)

    def answered(self, request: bytes) -> bytes:
        self.heard(0.1 * self.holding[_TENTHS])
        if request[0] == 1:
            return bytes([1, 1, self._is_safe])
        if request[0] == 5:
            self._is_safe = self._is_safe and request[1:3] != _LEAVE.to_bytes(2, "big")
            answer = request[:5]
        else:
            before = dict(self.holding)
            answer = super().answered(request)
            if self.lies and request[0] in (6, 16):
                self.holding = before
        if request[0] == 4:
            self.tells(0.001 * self.inputs[0])
        self._obey()
        return answer

    def _obey(self) -> None:
        obeys = self.is_on and bool(self.holding[_ENABLE]) and not self._is_safe and not self.fails
        self.stands(self.holding[0] / _DEMAND_PER_PERCENT if obeys else 0.0)
        noise = self._hub.draw.randrange(4)
        self.inputs = {**self.inputs, 0: round(_DEMAND_PER_PERCENT * self.percent) + noise,
                       5: int(bool(self.holding[_ENABLE])), 6: int(self.fails)}  # fmt: skip
