"""Devices on plain CAN and J1939 by a DBC file: signals by name, counters, checksums, time-outs."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, PositiveFloat, PositiveInt

from drivers._address_claim import CLAIM_WAIT_S, AddressClaim, default_name
from drivers._can import bus_fault, gone, heard, open_bus
from drivers._can_messages import group_of, received_messages, sent_messages
from drivers._edge import edge, wire_log
from hil.daq.channel import Terminal, Wiring
from hil.daq.polled import PolledDaq
from hil.description.can import CanDescription
from hil.description.named import Described, description_faults, description_of, expired_levels, ports_of
from hil.errors import LinkError, SettingError

_EVERY_S = 0.1  # between commands where neither description nor watchdog says


class Settings(Described):
    """What `[devices.NAME]` may say.

    Attributes:
        model, description: see `hil.description.named`.
        address: of the bus: `socketcan:can0`, `pcan:PCAN_USBBUS1`, `socketcand:host:port`, `virtual:name`.
        bitrate: of the bus.
        timeout_s: a message is waited for so long, the first one for its own time-out if that is longer.
        longest_reply_s: after a failure what comes for so long is not believed, as it may have been under way.
        echo: the adapter gives back what is sent, as if it came from the bus.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str
    bitrate: PositiveInt = 250_000
    timeout_s: PositiveFloat = 0.3
    longest_reply_s: PositiveFloat = 0.6
    echo: bool = False


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from description_faults(settings, "can")
    if text := bus_fault(settings.address):
        yield ("address",), text
    if settings.longest_reply_s < settings.timeout_s:
        yield ("longest_reply_s",), f"must not be shorter than timeout_s = {settings.timeout_s:g}"


def terminals(settings: Settings) -> dict[str, Terminal]:
    """Those of the description; none while it has faults."""
    return ports_of(settings, "can")


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "cantools")


def has_watchdog(settings: Settings) -> bool:
    """Whether the device makes its outputs safe when no command comes."""
    return _told(settings).watchdog is not None


def not_read_back(settings: Settings) -> set[str]:
    """Outputs of which no message says where they stand."""
    return {name for name, told in _told(settings).terminals.items() if told.direction == "out" and not told.read_back}


def watchdog_levels(settings: Settings) -> dict[str, float]:
    """Where outputs go when no command comes."""
    return expired_levels(_told(settings))


def open_link(settings: Settings, wiring: Wiring) -> CanLink:
    """The bus, open; on J1939 our address claimed where there is something to command."""
    return CanLink(settings, wiring)


def open_daq(settings: Settings, wiring: Wiring) -> PolledDaq:
    """The device alone as a DAQ."""
    name = Path(settings.model).stem or "device"
    return PolledDaq({name: open_link(settings, wiring)}, {name: wiring})


@edge
class CanLink:
    """A device on CAN (see `hil.daq.polled.Link`). Opened without outputs it sends nothing.

    Nothing acknowledges a command; where a message says where an output stands, that is asked for. Commands come with
    every drive, and in a pause so often as the description says: they end with the program.

    Raises:
        SettingError: its outputs would fall to another value than the safe one when commands end.
        LinkError: another controller has our address.
    """

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        told = _told(settings)
        _check_level(told, wiring)
        self._settings, self._j1939 = settings, told.j1939
        self._outputs = {c.terminal: told.terminals[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: told.terminals[c.terminal] for c in wiring.inputs.values()}
        self._sent = sent_messages(told, self._outputs)
        backs = {t.read_back.message for t in self._outputs.values() if t.read_back is not None}
        self._received = received_messages(told, {t.message for t in self._inputs.values()} | backs)
        self.watchdog_s: float | None = told.watchdog.time_s if told.watchdog else None
        every_s = min((s.about.every_s for s in self._sent.values() if s.about.every_s), default=None)
        self.keep_alive_s: float | None = min(every_s or _EVERY_S, (self.watchdog_s or math.inf) / 3.0)
        ages = [told.about(t.message).every_s or 0.0 for t in self._inputs.values()]
        self._patience_s = [told.about(t.message).timeout_s for t in self._inputs.values()]
        self.reading_age_s = max(ages, default=0.0) / 2.0
        self._driven_s: float | None = None
        self._stands: dict[str, float] = {}
        self.unmeasured: dict[str, str] = {}
        self._away_s: dict[str, float] = {}
        self._quiet_until_s = 0.0
        self._echoes: list[tuple[int, bytes]] = []
        self._log = wire_log("can", settings.address)
        self._claim = (
            AddressClaim(told.j1939.source, default_name())
            if told.j1939 and told.j1939.claim and self._outputs
            else None
        )
        self._bus = open_bus(settings.address, settings.bitrate)
        try:
            self._claim_address()
        except BaseException:
            self.close()
            raise

    def standing(self) -> dict[str, float]:
        """Where outputs stand, as a message since the last command says, of those of which one does."""
        begun_s = max(self._driven_s or 0.0, time.monotonic() if self._driven_s is None else 0.0)
        asked = {name: t.read_back for name, t in self._outputs.items() if t.read_back is not None}
        until_s = time.monotonic() + self._settings.timeout_s
        self._receive(0.0)  # who asks again wants to know what was said since
        while any(self._came_s(back) <= begun_s for back in asked.values()) and time.monotonic() < until_s:
            self._receive(max(0.0, until_s - time.monotonic()))
        found = {}
        for name, back in asked.items():
            if self._came_s(back) <= begun_s:
                raise LinkError(f"no {back.message}.{back.signal} since the last command")
            said = self._received[back.message].value(back, time.monotonic())
            if math.isfinite(said):
                found[name] = self._outputs[name].slope * said + self._outputs[name].offset
        return found

    def drive(self, values: Mapping[str, float]) -> None:
        """Send the messages of these outputs."""
        self._receive(0.0)
        self._address_is_ours()
        messages = dict.fromkeys(self._outputs[name].message for name in values)
        for name, value in values.items():
            self._stands[name] = self._sent[self._outputs[name].message].set(self._outputs[name], value)
        for message in messages:
            self._send(self._identifier(self._sent[message].message), self._sent[message].frame(),
                       self._sent[message].message.is_extended_frame)  # fmt: skip
        self._driven_s = time.monotonic()

    def read(self) -> dict[str, float]:
        """The last value of every input, NaN where the device says that it has none.

        Raises:
            LinkError: one is too old, its counter stands still, or no command was sent for the watchdog's time.
        """
        self._watchdog_has_not_expired()
        wait_s = self._quiet_until_s - time.monotonic()
        if wait_s > 0.0:  # what is late on its way says nothing about now
            time.sleep(wait_s)
            self._receive(0.0)
            self._forget()
        self._quiet_until_s = 0.0
        self._receive(0.0)
        self._address_is_ours()
        until_s = time.monotonic() + max([self._settings.timeout_s, *self._patience_s])
        while any(math.isinf(self._came_s(t)) for t in self._inputs.values()) and time.monotonic() < until_s:
            self._receive(max(0.0, until_s - time.monotonic()))
        now_s = time.monotonic()
        try:
            self._outputs_stand(now_s)
            self.unmeasured = {name: why for name, t in self._inputs.items()
                               if (why := self._received[t.message].why_none(t))}  # fmt: skip
            return {name: t.slope * self._received[t.message].value(t, now_s) + t.offset
                    for name, t in self._inputs.items()}  # fmt: skip
        except LinkError:
            self._quiet_until_s = now_s + self._settings.longest_reply_s
            raise

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()

    def _outputs_stand(self, now_s: float) -> None:
        """What is read back is what was driven; a message that was under way for long may say otherwise once."""
        for name, told in self._outputs.items():
            back = told.read_back
            if back is None or name not in self._stands or self._driven_s is None:
                continue
            late = self._received[back.message].about
            if self._came_s(back) <= self._driven_s + 2.0 * (late.every_s or 0.0):
                continue
            stands = told.slope * self._received[back.message].value(back, now_s) + told.offset
            if abs(stands - self._stands[name]) <= (told.close or 0.0) + 1e-9 * max(map(abs, told.range)):
                self._away_s.pop(name, None)
            elif now_s - self._away_s.setdefault(name, now_s) >= self._settings.longest_reply_s:
                raise LinkError(
                    f"{name} stands at {stands:.4g} {told.unit}, not at {self._stands[name]:.4g} as it was driven: the "
                    f"device restarted, or somebody else commands it"
                )

    def _forget(self) -> None:
        for received in self._received.values():
            received.came_s.clear()

    def _came_s(self, told: Any) -> float:
        return self._received[told.message].came_s.get(told.signal, -math.inf)

    def _watchdog_has_not_expired(self) -> None:
        if self._driven_s is None or self.watchdog_s is None:
            return
        silent_s = time.monotonic() - self._driven_s
        if silent_s > self.watchdog_s:
            self._driven_s = time.monotonic()
            raise LinkError(
                f"no command was sent for {silent_s:.3g} s, longer than its watchdog of {self.watchdog_s:g} s: the "
                f"device makes its outputs safe then"
            )

    def _receive(self, wait_s: float) -> None:
        """Take in every message that has come; wait for the first of ours so long if there is none."""
        until_s = time.monotonic() + wait_s
        while (mine := self._heard(max(0.0, until_s - time.monotonic()))) is not None:
            until_s = 0.0 if mine else until_s

    def _heard(self, wait_s: float) -> bool | None:
        """Take in one message: whether it was one of ours; None when none came."""
        message = heard(self._bus, self._settings.address, wait_s)
        if message is None:
            return None
        identifier, data = message.arbitration_id, bytes(message.data)
        if message.is_error_frame or message.is_remote_frame or not message.is_rx:
            return False
        self._log.debug("← %X %s", identifier, data.hex(" "))
        if self._settings.echo and (identifier, data) in self._echoes:
            self._echoes.remove((identifier, data))
            return False
        if self._claim is not None and message.is_extended_id and (answer := self._claim.answer_to(identifier, data)):
            self._send(*answer, True)
        mine = [r for r in self._received.values() if self._is(r.message, identifier, message.is_extended_id)]
        for received in mine:
            received.take(data, time.monotonic())
        return bool(mine)

    def _is(self, message: Any, identifier: int, extended: bool) -> bool:
        if self._j1939 is None:
            return bool(message.frame_id == identifier and message.is_extended_frame == extended)
        return (
            extended and group_of(message.frame_id) == group_of(identifier) and identifier & 0xFF == self._j1939.device
        )

    def _identifier(self, message: Any) -> int:
        """Of a message that we send: on J1939 from our address, and to the device where it is for one."""
        if self._j1939 is None:
            return int(message.frame_id)
        identifier = message.frame_id & ~0xFF | self._j1939.source
        to_one = group_of(identifier) != identifier >> 8 & 0x3FFFF or identifier >> 16 & 0xFF < 240
        return int(identifier & ~0xFF00 | self._j1939.device << 8 if to_one else identifier)

    def _send(self, identifier: int, data: bytes, extended: bool) -> None:
        import can

        self._log.debug("→ %X %s", identifier, data.hex(" "))
        self._echoes = [*self._echoes[-31:], (identifier, data)]
        try:
            self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=extended))
        except Exception as error:
            raise gone(self._settings.address, error) from error

    def _claim_address(self) -> None:
        if self._claim is None:
            return
        self._send(*self._claim.claim(), True)
        until_s = time.monotonic() + CLAIM_WAIT_S
        while (left_s := until_s - time.monotonic()) > 0.0:
            self._heard(left_s)
        self._address_is_ours()

    def _address_is_ours(self) -> None:
        if self._claim is not None and self._claim.lost_to is not None:
            raise LinkError(
                f"our address belongs to a controller with NAME {self._claim.lost_to:#018x}, which goes before ours: "
                f"say another j1939.source in its description, or echo = true where the adapter gives back what is sent"
            )


def _told(settings: Settings) -> CanDescription:
    return description_of(settings, "can")


def _check_level(told: CanDescription, wiring: Wiring) -> None:
    for name, channel in wiring.outputs.items():
        if told.watchdog is not None and abs(told.watchdog.expires_to - channel.safe) > 1e-9:
            raise SettingError(
                f"'{name}' is safe at {channel.safe:g} {channel.unit}, but when commands end the device puts it at "
                f"{told.watchdog.expires_to:g}: connect the valve so that this is safe, or take another device"
            )
