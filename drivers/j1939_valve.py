"""Auxiliary valves on J1939/ISOBUS: flow command each 100 ms, estimated flow back (ISO 11783-7).

Parameter groups and their bytes are those of ISO 11783-7, the claim of our address those of SAE J1939-81 and ISO
11783-5. The addresses that stand in when the bench file says none, ours (0x26) and the valve's (0x80), and our NAME
are our choice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Literal

from pydantic import Field, PositiveFloat

from drivers._address_claim import CLAIMED, EVERYBODY, REQUEST, AddressClaim, default_name
from drivers._can import bus_fault
from drivers._can_frames import BusSettings, CanFrames
from drivers._edge import edge
from hil.daq.channel import Terminal, Wiring
from hil.daq.device_link import DeviceLink
from hil.errors import LinkError
from hil.system import system

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
_LIMITED = {2: "above a high limit", 3: "below a low limit", 6: "by a fault that it does not recover from"}


class Settings(BusSettings):
    """What `[devices.NAME]` may say.

    Attributes:
        valve: its number, 0 … 15.
        source: our address on the bus, which we claim.
        name: our NAME on the bus (64 bit); one that every other controller goes before if not given.
        device: address of the valve's controller; messages of others are not believed.
        timeout_s: estimated flow that is older than that counts as none.
        watchdog_s: the valve goes to its fail-safe state when it hears no command for so long.
        fail_safe: which state that is.
    """

    valve: int = Field(default=1, ge=0, le=15)
    source: int = Field(default=0x26, ge=0, le=253)
    name: int | None = Field(default=None, ge=0, lt=1 << 64)
    device: int = Field(default=0x80, ge=0, le=253)
    watchdog_s: PositiveFloat = 0.3
    fail_safe: Literal["block", "float"] = "block"


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

    Attributes:
        identity: the NAME of the valve's controller, as it was heard last; empty until it has told it.

    Raises:
        LinkError: another controller has our address.
    """

    reading_age_s = 0.05

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        self._settings = settings
        self._command_id = 3 << 26 | COMMAND + settings.valve << 8 | settings.source
        self._group = ESTIMATED + settings.valve
        self._commanded_s = system.now_s()
        self._requested_s: list[float] = []  # for its claim, by whomever, and not answered yet
        self._latest: bytes | None = None
        self._came_s = 0.0
        self._restarted = False
        super().__init__(
            wiring,
            settings.watchdog_s,
            device="valve",
            longest_reply_s=settings.longest_reply_s,
            reports_each_s=_EVERY_S,
        )
        self.keep_alive_s = min(_EVERY_S, settings.watchdog_s / 3.0)
        self._open()

    def standing(self) -> dict[str, float]:
        """What the valve says in its first message since the last command: blocked, or not, then nobody knows how far.

        Raises:
            LinkError: it says nothing, or that it has an error.
        """
        self._frames.receive(0.0)
        if self._latest is None or self._came_s <= self._commanded_s:
            self._latest = None
            self._frames.receive(self._settings.timeout_s)
        self._frames.address_is_ours()
        status = self._fresh(LinkError)
        self._estimated(status)  # an error that it reports is raised
        return {_OUT: 0.0 if status[2] & 0x0F == BLOCK else math.nan}

    def close(self) -> None:
        """Leave the bus."""
        self._frames.close()

    def _identified(self) -> str:
        settings = self._settings
        name, claim = default_name() if settings.name is None else settings.name, None
        if self._wiring.outputs:  # who only listens needs no address
            claim = AddressClaim(settings.source, name)
        self._frames = CanFrames(settings, self._take, claim, driver="j1939_valve", key="source", echo=settings.echo)
        if claim is not None:
            self._frames.send(_PRIORITY << 26 | REQUEST << 8 | settings.device << 8 | settings.source, CLAIMED_GROUP)
            self._requested_s.append(until_s := system.now_s())
            until_s += 0.0 if self._wiring.only_safe else settings.timeout_s
            while not self._identity and (left_s := until_s - system.now_s()) > 0.0:
                self._frames.receive(left_s)
        return self._identity

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """Nothing acknowledges a command but the state and the flow that the valve then tells."""
        self._look()  # who asks for our address is answered in a pause too
        frame, self._commanded_s = command_frame(values[_OUT], self._settings.fail_safe), system.now_s()
        self._frames.send(self._command_id, frame)
        self._watchdog.heard()
        yield _OUT, _DIRECTIONS[frame[2] & 0x0F]

    def _look(self) -> None:
        self._frames.receive(0.0)
        self._frames.address_is_ours()
        restarted, self._restarted = self._restarted, False
        if restarted and self._commanded != self._safe:
            raise LinkError("the valve has claimed its address anew: it restarted, and its outputs stood elsewhere")

    def _measured(self) -> dict[str, float]:
        """The flow that it has estimated last, NaN when it says that it estimates none."""
        if self._latest is None:
            self._frames.receive(self._settings.timeout_s)
        return {"estimated flow": self._estimated(self._fresh(self._failed))}

    def _held(self) -> dict[str, float]:
        """Which way it is told to go; how far it does not say."""
        state = self._latest[2] & 0x0F if self._latest else _ERROR
        return {_OUT: _DIRECTIONS[state]} if state in _DIRECTIONS else {}

    def _named(self, _name: str, level: float) -> str:
        return _IN_WORDS.get(level, "float")

    def _forget(self) -> None:
        self._frames.receive(0.0)
        self._latest = None

    def _fresh(self, failed: Callable[[str], LinkError]) -> bytes:
        """What the valve said last, if that is not too old."""
        if self._latest is None or system.now_s() - self._came_s > self._settings.timeout_s:
            raise failed(f"no estimated flow of valve {self._settings.valve} for {self._settings.timeout_s:g} s")
        return self._latest

    def _take(self, identifier: int, data: bytes, extended: bool) -> bool:
        """Take in a frame; tells whether it was an estimate of our valve.

        One that claims its address, and was not asked for it of late, has restarted. It may obey again before it is
        missed.
        """
        group, to, now_s = identifier >> 8 & 0x3FF00, identifier >> 8 & 0xFF, system.now_s()
        if extended and group == REQUEST and data == CLAIMED_GROUP and to in (self._settings.device, EVERYBODY):
            self._requested_s.append(now_s)
        if not extended or identifier & 0xFF != self._settings.device or len(data) != 8:
            return False
        if group == CLAIMED:
            self._identity = f"NAME {int.from_bytes(data, 'little'):#018x}"
            asked_s = [at_s for at_s in self._requested_s if now_s - at_s <= self._settings.longest_reply_s]
            self._restarted = self._restarted or (not asked_s and self._commanded != self._safe)
            self._requested_s = asked_s[1:]
        if is_mine := identifier >> 8 & 0x3FFFF == self._group:
            self._latest, self._came_s = data, now_s
        return is_mine

    def _estimated(self, data: bytes) -> float:
        limit = data[3] >> 5
        if data[2] & 0x0F == _ERROR or limit == 6:
            text = _LIMITED.get(limit, "")
            raise LinkError(f"valve {self._settings.valve} reports an error{f', limited {text}' if text else ''}")
        if data[0] > _LARGEST:
            return math.nan
        return float(data[0]) - 125.0
