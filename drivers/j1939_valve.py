"""Auxiliary valves on J1939/ISOBUS: flow command each 100 ms, estimated flow back (ISO 11783-7).

Parameter groups and their bytes are those of ISO 11783-7, the claim of our address those of SAE J1939-81 and ISO
11783-5. The addresses that stand in when the bench file says none, ours (0x26) and the valve's (0x80), and our NAME
are our choice.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt

from drivers._address_claim import CLAIM_WAIT_S, CLAIMED, REQUEST, AddressClaim, default_name
from drivers._can import bus_fault, close_bus, gone, heard, open_bus
from drivers._edge import edge, wire_log
from hil.daq.channel import Terminal, Wiring
from hil.daq.device_link import DeviceLink
from hil.errors import LinkError

COMMAND, ESTIMATED = 0xFE30, 0xFE10
"""Parameter groups of valve 0: its command, and the flow that it estimates. Valve n has the n-th after them."""
BLOCK, EXTEND, RETRACT = 0, 1, 2
_DIRECTIONS = {BLOCK: 0.0, EXTEND: 1.0, RETRACT: -1.0, 3: math.nan}  # the last one floats
_IN_WORDS = {0.0: "block", 1.0: "extend", -1.0: "retract"}
_OUT, _EVERY_S = "flow command", 0.1
PER_BIT = 0.4  # % of the command
_FAIL_SAFE = {"block": 0b00, "float": 0b01}
_ERROR, _LARGEST = 14, 0xFA
_PRIORITY, CLAIMED_GROUP = 6, CLAIMED.to_bytes(3, "little")
_ECHOES = 32  # frames that may be on their way back
_LIMITED = {2: "above a high limit", 3: "below a low limit", 6: "by a fault that it does not recover from"}


class Settings(BaseModel):
    """What `[devices.NAME]` may say.

    Attributes:
        address: of the bus: `socketcan:can0`, `pcan:PCAN_USBBUS1`, `socketcand:host:port`, `virtual:name`.
        valve: its number, 0 … 15.
        source: our address on the bus, which we claim.
        name: our NAME on the bus (64 bit); one that every other controller goes before if not given.
        device: address of the valve's controller; messages of others are not believed.
        bitrate: of the bus.
        timeout_s: estimated flow that is older than that counts as none.
        longest_reply_s: after a failure what comes for so long is not believed, as it may have been under way.
        watchdog_s: the valve goes to its fail-safe state when it hears no command for so long.
        fail_safe: which state that is.
        echo: the adapter gives back what is sent, as if it came from the bus.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str
    valve: int = Field(default=1, ge=0, le=15)
    source: int = Field(default=0x26, ge=0, le=253)
    name: int | None = Field(default=None, ge=0, lt=1 << 64)
    device: int = Field(default=0x80, ge=0, le=253)
    bitrate: PositiveInt = 250_000
    timeout_s: PositiveFloat = 0.3
    longest_reply_s: PositiveFloat = 0.6
    watchdog_s: PositiveFloat = 0.3
    fail_safe: Literal["block", "float"] = "block"
    echo: bool = False


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    if text := bus_fault(settings.address):
        yield ("address",), text
    if settings.source == settings.device:
        yield ("source",), f"address {settings.source:#04x} is the valve's own; two on a bus cannot share one"


def terminals(_settings: Settings) -> dict[str, Terminal]:
    """Flow command and estimated flow in % of full flow; below zero is retract."""
    return {
        "flow command": Terminal("out", "value", "%", -100.0, 100.0),
        "estimated flow": Terminal("in", "value", "%", -125.0, 125.0),
    }


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can",)


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Its fail-safe state blocks it, or lets it float: then no flow command says where it is."""
    return {"flow command": 0.0 if settings.fail_safe == "block" else math.nan}


def read_back_requests(_wiring: Wiring) -> int:
    """None: the valve reports where it holds its set point."""
    return 0


def open_link(settings: Settings, wiring: Wiring) -> J1939ValveLink:
    """The bus, open, our address on it claimed if there is something to command; nothing else is sent before that."""
    return J1939ValveLink(settings, wiring)


def command_frame(percent: float, fail_safe: Literal["block", "float"]) -> bytes:
    """The eight bytes of a flow command: port flow, state and fail-safe mode; the rest is not available."""
    flow = min(_LARGEST, round(abs(percent) / PER_BIT))
    state = BLOCK if flow == 0 else EXTEND if percent > 0.0 else RETRACT
    return bytes([flow, 0xFF, _FAIL_SAFE[fail_safe] << 6 | 0b11 << 4 | state, *[0xFF] * 5])


@edge
class J1939ValveLink(DeviceLink):
    """A valve on J1939 (see `hil.daq.link.Link`). Its flow is estimated by itself, not measured.

    Opened without its command it sends nothing. The valve tells its flow each 100 ms without being asked, so a reading
    is half as old on average.

    Raises:
        LinkError: another controller has our address.
    """

    reading_age_s = 0.05

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        self._settings = settings
        self._command_id = 3 << 26 | COMMAND + settings.valve << 8 | settings.source
        self._group = ESTIMATED + settings.valve
        self._commanded_s = time.monotonic()
        self._latest: bytes | None = None
        self._came_s = 0.0
        self._name, self._names_device = default_name() if settings.name is None else settings.name, ""
        self._claim = AddressClaim(settings.source, self._name)
        self._sent: deque[tuple[int, bytes]] = deque(maxlen=_ECHOES)
        self._log = wire_log("j1939_valve", settings.address)
        self._commands = bool(wiring.outputs)
        super().__init__(
            wiring, settings.watchdog_s, device="valve", longest_reply_s=settings.longest_reply_s, told_each_s=_EVERY_S
        )
        self.keep_alive_s = min(_EVERY_S, settings.watchdog_s / 3.0)
        self._open()

    @property
    def identity(self) -> str:
        """The NAME of the valve's controller, as it was heard last; empty until it has told it."""
        return self._names_device

    def standing(self) -> dict[str, float]:
        """What the valve says in its first message since the last command: blocked, or not, then nobody knows how far.

        Raises:
            LinkError: it says nothing, or that it has an error.
        """
        self._receive(0.0)
        if self._latest is None or self._came_s <= self._commanded_s:
            self._latest = None
            self._receive(self._settings.timeout_s)
        self._address_is_ours()
        status = self._fresh(LinkError)
        self._estimated(status)  # an error that it reports is raised
        return {_OUT: 0.0 if status[2] & 0x0F == BLOCK else math.nan}

    def close(self) -> None:
        """Leave the bus."""
        close_bus(self._bus, self._settings.timeout_s)

    def _identified(self) -> str:
        settings = self._settings
        self._bus = open_bus(settings.address, settings.bitrate, settings.timeout_s)
        if self._commands:  # who only listens needs no address
            self._send(*self._claim.claim())
            until_s = time.monotonic() + CLAIM_WAIT_S
            while (left_s := until_s - time.monotonic()) > 0.0:
                self._heard(left_s)
            self._address_is_ours()
            self._send(_PRIORITY << 26 | REQUEST << 8 | settings.device << 8 | settings.source, CLAIMED_GROUP)
        return ""

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """Nothing acknowledges a command but the state and the flow that the valve then tells."""
        self._look()  # who asks for our address is answered in a pause too
        frame, self._commanded_s = command_frame(values[_OUT], self._settings.fail_safe), time.monotonic()
        self._send(self._command_id, frame)
        self._watchdog.heard()
        yield _OUT, _DIRECTIONS[frame[2] & 0x0F]

    def _look(self) -> None:
        self._receive(0.0)
        self._address_is_ours()

    def _measured(self) -> dict[str, float]:
        """The flow that it has estimated last, NaN when it says that it estimates none."""
        if self._latest is None:
            self._receive(self._settings.timeout_s)
        return {"estimated flow": self._estimated(self._fresh(self._failed))}

    def _held(self) -> dict[str, float]:
        """Which way it is told to go; how far it does not say."""
        state = self._latest[2] & 0x0F if self._latest else _ERROR
        return {_OUT: _DIRECTIONS[state]} if state in _DIRECTIONS else {}

    def _named(self, _name: str, level: float) -> str:
        return _IN_WORDS.get(level, "float")

    def _forget(self) -> None:
        self._receive(0.0)
        self._latest = None

    def _fresh(self, failed: Callable[[str], LinkError]) -> bytes:
        """What the valve said last, if that is not too old."""
        if self._latest is None or time.monotonic() - self._came_s > self._settings.timeout_s:
            raise failed(f"no estimated flow of valve {self._settings.valve} for {self._settings.timeout_s:g} s")
        return self._latest

    def _receive(self, wait_s: float) -> None:
        """Take in every message that has come; wait for the first estimate so long if there is none."""
        until_s = time.monotonic() + wait_s
        while (estimate := self._heard(max(0.0, until_s - time.monotonic()))) is not None:
            if estimate:
                until_s = 0.0

    def _heard(self, wait_s: float) -> bool | None:
        """Take in one message: whether it was an estimate of our valve; None when none came."""
        message = heard(self._bus, self._settings.address, wait_s)
        if message is None:
            return None
        identifier, data = message.arbitration_id, bytes(message.data)
        if not message.is_extended_id or message.is_error_frame or message.is_remote_frame or not message.is_rx:
            return False
        self._log.debug("← %08X %s", identifier, data.hex(" "))
        if self._settings.echo and (identifier, data) in self._sent:
            self._sent.remove((identifier, data))
            return False
        if identifier >> 8 & 0x3FF00 == CLAIMED and identifier & 0xFF == self._settings.device and len(data) == 8:
            self._names_device = f"NAME {int.from_bytes(data, 'little'):#018x}"
        if self._commands and (answer := self._claim.answer_to(identifier, data)):
            self._send(*answer)
        mine = identifier >> 8 & 0x3FFFF == self._group and identifier & 0xFF == self._settings.device
        if mine and len(data) == 8:
            self._latest, self._came_s = data, time.monotonic()
        return mine and len(data) == 8

    def _send(self, identifier: int, data: bytes) -> None:
        import can

        self._log.debug("→ %08X %s", identifier, data.hex(" "))
        self._sent.append((identifier, data))
        try:
            self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=True))
        except Exception as error:
            raise gone(self._bus, self._settings.address, error) from error

    def _address_is_ours(self) -> None:
        if self._claim.lost_to == self._name:
            raise LinkError(
                f"our own claim of address {self._settings.source:#04x} came back: the adapter echoes, then say "
                f"echo = true; or another program claims it with our NAME"
            )
        if self._claim.lost_to is not None:
            raise LinkError(
                f"address {self._settings.source:#04x} belongs to a controller with NAME {self._claim.lost_to:#018x}, "
                f"which goes before ours: say another source"
            )

    def _estimated(self, data: bytes) -> float:
        limit = data[3] >> 5
        if data[2] & 0x0F == _ERROR or limit == 6:
            text = _LIMITED.get(limit, "")
            raise LinkError(f"valve {self._settings.valve} reports an error{f', limited {text}' if text else ''}")
        if data[0] > _LARGEST:
            return math.nan
        return float(data[0]) - 125.0
