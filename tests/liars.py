"""Devices that lie, behind a wire: Modbus TCP as a WAGO coupler speaks it, and SCPI text. No code of `hil` is in them.

Each has two outputs, each output wired to an input of the same number.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tests.foreign_line import ForeignLine, WholeRequest, ended, tcp_frame
from tests.outside.serial_line import SerialLine

FULL_V = 10.0


@dataclass(frozen=True)
class Lie:
    """How a device differs from what it says. `echo`: asked for an output it repeats what it was told."""

    drives: Callable[[Device, int, float], float | None] = lambda _device, _i, told: told  # None: nothing moves
    echo: bool = False
    late_s: float = 0.0
    sticks_after: int = 10**9
    creeps: bool = False
    on_connect: Callable[[Device], None] = lambda _device: None
    frozen_inputs: bool = False
    watchdog: float | None = 1.0  # multiples of its time after which it acts; None: never
    acts: float = math.inf  # so often, and never again
    expires_to: tuple[float, float] | None = (0.0, 0.0)  # by output; None: says that it acted, and does not
    moves: Callable[[int], int] = lambda i: i
    frozen_answers: bool = False
    answers_for: int = 0  # so many unit numbers beside the one that was asked


def _swapped(i: int) -> int:
    return 1 - i


def _forgotten(device: Device) -> None:
    device.at = [1.5, 1.5]


def _jumped(device: Device) -> None:
    device.at = [-4.0, -4.0]


def _previous(device: Device, i: int, _told: float) -> float:
    return device.before[i]


def _needs_enabling(device: Device, _i: int, told: float) -> float | None:
    obeys, device.enabled = device.enabled, device.enabled and told != 0.0
    return told if obeys else None


def _enabled(device: Device) -> None:
    device.enabled = True


def _jitters(device: Device, i: int, told: float) -> float:
    return told + 0.4 * (-1) ** device.commands


LIES: dict[str, Lie] = {
    "": Lie(),
    "ignores": Lie(drives=lambda _d, _i, _told: None),
    "ignores, repeats what it was told": Lie(drives=lambda _d, _i, _told: None, echo=True),
    "obeys three seconds later": Lie(late_s=3.0),
    "obeys another channel": Lie(moves=_swapped),
    "obeys the first channel alone": Lie(drives=lambda _d, i, told: told if i == 0 else None),
    "exchanges two channels, repeats what it was told": Lie(moves=_swapped, echo=True),
    "obeys the first command alone": Lie(sticks_after=2),
    "obeys the command before": Lie(drives=_previous),
    "obeys the command before, repeats what it was told": Lie(drives=_previous, echo=True),
    "obeys no more after the safe command until it is opened again": Lie(drives=_needs_enabling, on_connect=_enabled),
    "half scale": Lie(drives=lambda _d, _i, told: 0.5 * told),
    "half scale, repeats what it was told": Lie(drives=lambda _d, _i, told: 0.5 * told, echo=True),
    "wrong sign": Lie(drives=lambda _d, _i, told: -told),
    "wrong sign, repeats what it was told": Lie(drives=lambda _d, _i, told: -told, echo=True),
    "no negative values": Lie(drives=lambda _d, _i, told: abs(told)),
    "offset of 2 %": Lie(drives=lambda _d, _i, told: told + 0.4),
    "jitters by 2 %": Lie(drives=_jitters),
    "saturates at 80 %": Lie(drives=lambda _d, _i, told: max(-8.0, min(8.0, told))),
    "saturates at 60 %": Lie(drives=lambda _d, _i, told: max(-6.0, min(6.0, told))),
    "saturates at 60 %, repeats what it was told": Lie(
        drives=lambda _d, _i, told: max(-6.0, min(6.0, told)), echo=True
    ),
    "says for ever where it stood first": Lie(frozen_answers=True),
    "answers for another unit": Lie(answers_for=1),
    "sticks after 12 commands": Lie(sticks_after=12),
    "creeps home when nothing is said": Lie(creeps=True),
    "ignores the safe command": Lie(drives=lambda _d, _i, told: told or None),
    "forgets when somebody connects": Lie(on_connect=_forgotten),
    "moves when somebody connects": Lie(on_connect=_jumped),
    "inputs stand still": Lie(frozen_inputs=True),
    "never times out": Lie(watchdog=None),
    "times out to the wrong level": Lie(expires_to=(5.0, 5.0)),
    "times out to the wrong level on one output": Lie(expires_to=(0.0, 2.0)),
    "times out once, and never again": Lie(acts=1.0),
    "times out three times too late": Lie(watchdog=3.0),
    "times out too early": Lie(watchdog=0.25),
    "says that it timed out and does not": Lie(expires_to=None),
}


class Device:
    """Two outputs, what was told to them, and where they stand."""

    def __init__(self, lie: Lie) -> None:
        self.lie = lie
        self.at, self.told, self.before = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        self.commands = 0
        self.acted = 0
        self.enabled = True
        self.heard_s = self.driven_s = time.monotonic()
        self.armed_s = self.expired_s = 0.0
        self._later: deque[tuple[float, int, float]] = deque()
        self._held = [0.0, 0.0]

    def drive(self, i: int, volts: float) -> None:
        self.now()
        self.before[i], self.told[i] = self.told[i], volts
        self.commands += 1
        self.driven_s = time.monotonic()
        moved = self.lie.drives(self, i, volts)
        if moved is not None and self.commands <= self.lie.sticks_after:
            self._later.append((self.driven_s + self.lie.late_s, self.lie.moves(i), moved))
        self.now()

    def now(self) -> list[float]:
        """Where outputs stand at this moment."""
        now_s = time.monotonic()
        while self._later and self._later[0][0] <= now_s:
            _, i, volts = self._later.popleft()
            self.at[i] = volts
        if self.lie.creeps and now_s - self.driven_s > 0.08:
            self.at = [0.0, 0.0]
        if self.armed_s and self.lie.watchdog and now_s - self.heard_s > self.lie.watchdog * self.armed_s:
            self._expire()
        return list(self.at)

    def _expire(self) -> None:
        self.told = [0.0, 0.0]
        self.acted, self.expired_s = self.acted + (self.expired_s != self.heard_s), self.heard_s
        if self.lie.expires_to is not None and self.acted <= self.lie.acts:
            self.at = list(self.lie.expires_to)

    def says(self, i: int) -> float:
        """What it answers when it is asked for an output."""
        now = [0.0, 0.0] if self.lie.frozen_answers else self.now()
        return self.told[i] if self.lie.echo or self.lie.expires_to is None else now[i]

    def measures(self, i: int) -> float:
        return self._held[i] if self.lie.frozen_inputs else self.now()[i]

    def heard(self) -> None:
        self.now()
        self.heard_s = time.monotonic()


def line_of(lie: str, wire: str, *, on_serial: bool = False) -> ForeignLine | SerialLine:
    """The device that lies so at the end of a line; on a serial one nobody notices who opens it."""
    device, lock = Device(LIES[lie]), threading.Lock()
    answered, whole = WIRES[wire]

    def answer(request: bytes) -> bytes:
        with lock:
            said = answered(device, request)
            device.heard()
            return said

    def met() -> None:
        with lock:
            device.lie.on_connect(device)

    return SerialLine(answer, whole) if on_serial else ForeignLine(answer, whole, met)


def modbus(device: Device, request: bytes) -> bytes:
    """A WAGO 750-352: outputs 0x0000 …, read back from 0x0200, watchdog 0x1000, 0x1008, 0x100A."""
    pdu = request[7:]
    function, answer = pdu[0], bytes([pdu[0] | 0x80, 1])
    address, word = struct.unpack(">HH", pdu[1:5].ljust(4, b"\0"))
    if function in (3, 4):
        words = [_word(device, function, address + k) for k in range(word)]
        answer = struct.pack(f">BB{word}h", function, 2 * word, *words)
    elif function in (6, 16):
        words = [word] if function == 6 else list(struct.unpack(f">{word}H", pdu[6:]))
        for k, each in enumerate(words):
            _write(device, address + k, each)
        answer = pdu[:5]
    return request[:4] + struct.pack(">HB", 1 + len(answer), request[6] + device.lie.answers_for) + answer


def _word(device: Device, function: int, address: int) -> int:
    if address >= 0x1000:
        return 0
    volts = device.measures(address % 2) if function == 4 and address < 0x0200 else device.says(address % 2)
    return max(-0x7FFF, min(0x7FFF, round(volts / FULL_V * 0x7FFF)))


def _write(device: Device, address: int, word: int) -> None:
    if address == 0x1000:
        device.tenths = word  # type: ignore[attr-defined]
    elif address == 0x100A:
        device.heard()
        device.armed_s = 0.1 * getattr(device, "tenths", 100) if word else 0.0
    elif address < 2:
        device.drive(address, (word - 0x10000 if word >= 0x8000 else word) / 0x7FFF * FULL_V)


def scpi(device: Device, request: bytes) -> bytes:
    """A scanner: outputs @204 and @205, inputs @101 and @102, one answer for the whole line."""
    answers = [_said(device, unit.strip().lstrip(":").upper()) for unit in request.decode("ascii").split(";")]
    told = ";".join(answer for answer in answers if answer is not None)
    return told.encode("ascii") + b"\n" if told else b""


def _said(device: Device, unit: str) -> str | None:
    header, _, parameters = unit.partition(" ")
    channels = [int(text) for text in parameters.partition("@")[2].rstrip(")").split(",") if text]
    if header == "*IDN?":
        return "nobody,scanner,0,0"
    if header.startswith("SYST"):
        return '+0,"No error"'
    if header.endswith("?") and header.startswith("SOUR"):
        return ",".join(f"{device.says(n - 204):+.8E}" for n in channels)
    if header.endswith("?") and header.startswith("MEAS"):
        return ",".join(f"{device.measures(n - 101):+.8E}" for n in channels)
    if header.startswith("SOUR"):
        for n in channels:
            device.drive(n - 204, float(parameters.partition(",")[0]))
    return "1" if header == "*OPC?" else None


WIRES: Mapping[str, tuple[Callable[[Device, bytes], bytes], WholeRequest]] = {
    "modbus": (modbus, tcp_frame), "scpi": (scpi, ended(b"\n")),
}  # fmt: skip
