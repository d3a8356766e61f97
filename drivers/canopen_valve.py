"""Proportional valves on CANopen, device profile CiA 408: state machine, set point, actual value, heartbeat, EMCY.

Objects, states and identifiers are those of CiA 301 and CiA 408, and of a manual of Moog's valves. Our choice are the
node that sends our heartbeat (127), and that status word and actual value are what TPDO 1 is made to carry.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from pydantic import Field, PositiveFloat

from drivers._can import OnABus, bus_fault
from drivers._canopen_node import MASTER, NodeLink
from drivers._edge import edge
from hil.daq.channel import Terminal, Wiring
from hil.description.canopen import dictionary
from hil.errors import FileError, LinkError
from hil.system import system

PROFILE = 408
FULL = 16384  # ±100 %
_CLOSE = 1.01 * 100.0 / FULL
CLIMB = (0x0000, 0x0001, 0x0003, 0x0007)  # control words from INIT over DISABLED and HOLD to ACTIVE
STATES = {
    0b0000: "NOT_READY or FAULT_INIT", 0b1000: "INIT", 0b1001: "DISABLED", 0b1011: "HOLD", 0b1111: "ACTIVE",
    0b0011: "FAULT_HOLD", 0b0111: "FAULT_REACTION", 0b0001: "FAULT_DISABLED",
}  # fmt: skip
"""By the low four bits of the status word: ready, active, hold, disabled."""
_REACHED = (0b1000, 0b1001, 0b1011, 0b1111)
_PATIENCE_S = 0.5  # for the device to follow a control word
PROBES = "can"


class Settings(OnABus):
    """What `[devices.NAME]` may say.

    Attributes:
        eds: the maker's EDS or DCF, beside the bench file; what it lacks is then told by `hil check`, and another valve
            than its own is refused.
        node: of the valve.
        watchdog_s: the valve goes to its fault state when it misses our heartbeat for so long.
        ramp_s: its set point takes so long from 0 to 100 %; 0 switches ramps off. Left as it is if not given, as
            are the others.
        dither_amplitude, dither_hz: of its dither, as the object dictionary has them (‰ of full current is common).
        dead_band_a, dead_band_b: compensation on either side, in %.
    """

    eds: str = ""
    node: int = Field(default=1, ge=1, le=126)
    watchdog_s: PositiveFloat = 0.5
    ramp_s: float | None = Field(default=None, ge=0.0)
    dither_amplitude: int | None = Field(default=None, ge=0, le=0xFFFF)
    dither_hz: float | None = Field(default=None, ge=0.0)
    dead_band_a: float | None = Field(default=None, ge=0.0, le=100.0)
    dead_band_b: float | None = Field(default=None, ge=0.0, le=100.0)


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    if text := bus_fault(settings.address):
        yield ("address",), text
    if settings.longest_reply_s >= settings.watchdog_s:
        yield ("longest_reply_s",), f"must be shorter than watchdog_s = {settings.watchdog_s:g}, or the valve faults"
    if settings.watchdog_s > 65.535:
        yield ("watchdog_s",), f"{settings.watchdog_s:g} s: the valve counts up to 65.535 s"
    if settings.eds:
        yield from _file_faults(settings)


_NEEDED = {
    (0x1016, 1): "watch over our heartbeat", (0x1A00, 1): "mapping of TPDO 1", (0x6040, 0): "control word",
    (0x6041, 0): "status word", (0x6300, 1): "set point", (0x6301, 1): "actual value",
}  # fmt: skip
_OF_FUNCTIONS = {"ramp_s": (0x6331, 1), "dither_amplitude": (0x6361, 1), "dither_hz": (0x6362, 1),
                 "dead_band_a": (0x6343, 1), "dead_band_b": (0x6344, 1)}  # fmt: skip


def _file_faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What the maker's file says against this valve and these settings."""
    try:
        objects = dictionary(settings.eds)
    except FileError as error:
        yield ("eds",), str(error)
        return
    kind = objects.get((0x1000, 0))
    if kind is not None and kind.default and (profile := int(kind.default) & 0xFFFF) != PROFILE:
        yield ("eds",), f"{settings.eds}: a device of profile {profile}, not of {PROFILE} (valves)"
    for place, what in _NEEDED.items():
        if place not in objects:
            yield ("eds",), f"{settings.eds}: has no object {place[0]:04X}.{place[1]} ({what})"
    for key, place in _OF_FUNCTIONS.items():
        if getattr(settings, key) is not None and place not in objects:
            yield (key,), f"the valve has no object {place[0]:04X}.{place[1]}, says {settings.eds}; take this away"
    if objects.node_id and objects.node_id != settings.node:
        yield ("node",), f"{settings.node}, but {settings.eds} is that of node {objects.node_id}"


def probe() -> Any:
    """Who is on such a line (see `hil.daq.probe`)."""
    from drivers import _probe_can

    return _probe_can


def terminals(_settings: Settings) -> dict[str, Terminal]:
    """Set point and actual value, in % of the reference value."""
    return {
        "set point": Terminal("out", "value", "%", -100.0, 100.0),
        "actual value": Terminal("in", "value", "%", -200.0, 199.99),
    }


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "canopen")


def watchdog_levels(_settings: Settings) -> dict[str, float]:
    """In its fault state the valve is at its neutral position."""
    return {"set point": 0.0}


def open_link(settings: Settings, wiring: Wiring) -> CanopenValveLink:
    """The valve, active, its set point at the safe value."""
    return CanopenValveLink(settings, wiring)


@edge
class CanopenValveLink(NodeLink):
    """A valve on CANopen (see `hil.daq.link.Link`).

    The set point goes out in RPDO 4 with the control word; SYNC asks for status word and actual value, which come
    back in TPDO 1. Our heartbeat goes with every set point, so that it ends when the program does; the valve
    watches it from the first one on. Opened without its set point the valve is left as it is, and only asked by SDO.

    Attributes:
        identity: vendor, product, revision and serial number as its identity object (0x1018) has them.

    Raises:
        DeviceLostError: the bus cannot be opened, or nobody answers at this node.
        LinkError: it is no valve of this profile, or does not become active.
    """

    causes: Mapping[int, str] = {
        **NodeLink.causes, 0x3000: " (supply voltage)", 0x4200: " (temperature of the electronics)",
        0x5000: " (hardware)",
    }  # fmt: skip

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        self._settings, self._commands = settings, False
        self._beat_s: float | None = None
        super().__init__(
            wiring, settings.watchdog_s, close={"set point": _CLOSE}, device="valve",
            longest_reply_s=settings.longest_reply_s,
        )  # fmt: skip
        self._open()

    def standing(self) -> dict[str, float]:
        """Where the set point stands."""
        return {"set point": 100.0 * self._objects.signed(0x6300, 1) / FULL}

    def close(self) -> None:
        """Leave the valve at its fail-safe position, and the bus."""
        with suppress(Exception):
            if self._commands:
                self._commands = False
                self._step_down()
        super().close()

    def _identified(self) -> str:
        settings = self._settings
        file = dictionary(settings.eds) if settings.eds else None
        self._connect(settings, settings.node, "canopen_valve", 0x180 + settings.node, file=file)
        profile = self._objects.kind() & 0xFFFF
        if profile != PROFILE:
            raise LinkError(f"node {settings.node} is of device profile {profile}, not {PROFILE}")
        return self._objects.recognised()

    def _make_ready(self) -> None:
        self._commands = True  # before, it may be another one, which is not ours to step down
        self._configure()
        self._activate(list(self._safe.values()))

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """Send the set point, and our heartbeat."""
        counts = max(-FULL, min(FULL, round(values["set point"] * FULL / 100.0)))
        self._beat()
        self._send(0x500 + self._settings.node, struct.pack("<Hhh", CLIMB[-1], counts, 0))
        yield "set point", 100.0 * counts / FULL

    def _measured(self) -> dict[str, float]:
        """By SYNC with the status; by SDO of a valve that is not ours to command."""
        if not self._commands:
            return {"actual value": 100.0 * self._objects.signed(0x6301, 1) / FULL}
        (data,) = self._answers_to_sync({0x180 + self._settings.node}, "actual value").values()
        if len(data) != 4:
            raise LinkError(f"TPDO 1 has {len(data)} bytes, not 4: another program changed its mapping")
        status, actual = struct.unpack("<Hh", data)
        self._look_at(status)
        return {"actual value": 100.0 * actual / FULL}

    def _configure(self) -> None:
        """Heartbeats both ways, TPDO 1 by SYNC, the functions of the valve that the bench file names."""
        settings, beat_ms = self._settings, round(1000.0 * self._settings.watchdog_s)
        self._manage(0x80)
        for index, sub, value, form in (
            (0x1017, 0, max(10, beat_ms // 4), "<H"),
            (0x1016, 1, MASTER << 16 | beat_ms, "<I"),
            (0x1800, 1, 0x80000180 + settings.node, "<I"),
            (0x1800, 2, 1, "<B"),
            (0x1A00, 0, 0, "<B"),
            (0x1A00, 1, 0x60410010, "<I"),
            (0x1A00, 2, 0x63010110, "<I"),
            (0x1A00, 0, 2, "<B"),
            (0x1800, 1, 0x180 + settings.node, "<I"),
            (0x6042, 0, 1, "<b"),
        ):
            self._objects.download(index, sub, value, form)
        if settings.ramp_s is not None:
            self._objects.download(0x6331, 1, self._scaled(0x6331, settings.ramp_s), "<H")
            self._objects.download(0x6330, 0, 1 if settings.ramp_s else 0, "<b")
        if settings.dither_amplitude is not None:
            self._objects.download(0x6361, 1, settings.dither_amplitude, "<H")
            self._objects.download(0x6360, 0, 1 if settings.dither_amplitude else 0, "<b")
        if settings.dither_hz is not None:
            self._objects.download(0x6362, 1, self._scaled(0x6362, settings.dither_hz), "<H")
        for index, percent in ((0x6343, settings.dead_band_a), (0x6344, settings.dead_band_b)):
            if percent is not None:
                self._objects.download(index, 1, round(percent * FULL / 100.0), "<h")
                self._objects.download(0x6342, 0, 1, "<b")
        self._manage(0x01)

    def _activate(self, safe: list[float]) -> None:
        """Reset a fault, then climb state by state, the set point safe."""
        if safe:
            self._objects.download(0x6300, 1, round(safe[0] * FULL / 100.0), "<h")
        if not self._objects.upload(0x6041, 0) & 0b1000:
            self._objects.download(0x6040, 0, 0, "<H")
            self._objects.download(0x6040, 0, 0b1000, "<H")
        self._step_down()
        for word, reached in zip(CLIMB, _REACHED, strict=True):
            self._objects.download(0x6040, 0, word, "<H")
            self._wait_for(reached)
        self._emergency = None

    def _step_down(self) -> None:
        """From where the valve was left, state by state, as it allows no leap."""
        state = self._objects.upload(0x6041, 0) & 0b1111
        if state in _REACHED:
            for word in reversed(CLIMB[: _REACHED.index(state)]):
                self._objects.download(0x6040, 0, word, "<H")

    def _wait_for(self, state: int) -> None:
        until_s = system.now_s() + _PATIENCE_S
        while (now := self._objects.upload(0x6041, 0) & 0b1111) != state:
            if system.now_s() > until_s:
                raise LinkError(f"the valve stays in {STATES.get(now, f'{now:04b}')}, it should be in {STATES[state]}")
            system.sleep(0.005)

    def _look_at(self, status: int) -> None:
        """Raise `LinkError` unless the valve is active and obeys the bus."""
        self._look()
        if status & 0x10:
            raise LinkError("the valve is switched to local operation and does not obey the bus")
        if status & 0b1111 != 0b1111:
            name = STATES.get(status & 0b1111, f"{status & 0b1111:04b}")
            raise LinkError(f"the valve is in {name}, not ACTIVE: its set point has no effect")

    def _failed(self, text: str) -> LinkError:
        beat = "it has sent no heartbeat"
        if self._beat_s is not None:
            beat = f"its last heartbeat came {system.now_s() - self._beat_s:.2g} s ago"
        return super()._failed(f"{text}; {beat}")

    def _take(self, identifier: int, data: bytes, extended: bool) -> bool:
        if identifier == 0x700 + self._settings.node and not extended:
            self._beat_s = system.now_s()
        return super()._take(identifier, data, extended)

    def _scaled(self, index: int, value: float) -> int:
        """A value in the unit and prefix that the object itself has."""
        return max(0, min(0xFFFF, round(value / 10.0 ** self._objects.signed(index, 3))))
