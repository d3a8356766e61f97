"""Devices on plain CAN and J1939 by a DBC file: signals by name, counters, checksums, time-outs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from drivers._address_claim import AddressClaim, default_name
from drivers._can import bus_fault
from drivers._can_frames import BusSettings, CanFrames
from drivers._can_messages import group_of, received_messages, sent_messages
from drivers._described import ByDescription
from drivers._edge import edge
from hil.daq.channel import Wiring
from hil.daq.device_link import DeviceLink
from hil.description.can import CanDescription
from hil.description.named import Described
from hil.errors import LinkError
from hil.system import system

_EVERY_S = 0.1  # between commands where neither description nor watchdog says
_devices = ByDescription("can")
terminals, has_watchdog, not_read_back = _devices.terminals, _devices.has_watchdog, _devices.not_read_back
watchdog_levels = _devices.watchdog_levels


class Settings(BusSettings, Described):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        model, description: see `hil.description.named`.
    """


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    if text := bus_fault(settings.address):
        yield ("address",), text
    yield from _devices.faults(settings)


def needs(_settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return ("can", "cantools")


def read_back_requests(_wiring: Wiring) -> int:
    """None: messages of the device say where its outputs stand."""
    return 0


def open_link(settings: Settings, wiring: Wiring) -> CanLink:
    """The bus, open; on J1939 our address claimed where there is something to command."""
    return CanLink(settings, wiring, _devices.described(settings))


@edge
class CanLink(DeviceLink):
    """A device on CAN (see `hil.daq.link.Link`). Opened without outputs it sends nothing.

    Nothing acknowledges a command; where a message says where an output stands, that is asked for. Commands come with
    every drive, and in a pause so often as the description says: they end with the program.

    Raises:
        SettingError: its outputs would fall to another value than the safe one when commands end.
        LinkError: another controller has our address.
    """

    _remedy = ""  # that commands end makes it safe, whatever the bench file says

    def __init__(self, settings: BusSettings, wiring: Wiring, description: CanDescription) -> None:
        self._settings, self._j1939 = settings, description.j1939
        self._outputs = {c.terminal: description.terminals[c.terminal] for c in wiring.outputs.values()}
        self._inputs = {c.terminal: description.terminals[c.terminal] for c in wiring.inputs.values()}
        self._sent = sent_messages(description, self._outputs)
        self._backs = {name: t.read_back for name, t in self._outputs.items() if t.read_back is not None}
        backs = {back.message for back in self._backs.values()}
        self._received = received_messages(description, {t.message for t in self._inputs.values()} | backs)
        every_s = min((s.about.every_s for s in self._sent.values() if s.about.every_s), default=None)
        ages = [description.about(t.message).every_s or 0.0 for t in self._inputs.values()]
        self._patience_s = [description.about(t.message).timeout_s for t in self._inputs.values()]
        self.reading_age_s = max(ages, default=0.0) / 2.0
        self._commanded_s: float | None = None
        super().__init__(
            wiring, description.watchdog.time_s if description.watchdog else None,
            expires_to=description.watchdog.expires_to if description.watchdog else None,
            longest_reply_s=settings.longest_reply_s,
            close={n: (t.close or 0.0) + 1e-9 * max(map(abs, t.range)) for n, t in self._outputs.items()},
            reports_each_s=max((description.about(message).every_s or _EVERY_S for message in backs), default=0.0),
        )  # fmt: skip
        self.keep_alive_s = min(every_s or _EVERY_S, (self.watchdog_s or math.inf) / 3.0)
        self._open()

    def standing(self) -> dict[str, float]:
        """Where outputs stand, as a message since the last command says, of those of which one does."""
        begun_s, asked = system.now_s() if self._commanded_s is None else self._commanded_s, self._backs
        until_s = system.now_s() + self._settings.timeout_s
        self._frames.receive(0.0)  # who asks again wants to know what was said since
        while any(self._came_s(back) <= begun_s for back in asked.values()) and system.now_s() < until_s:
            self._frames.receive(max(0.0, until_s - system.now_s()))
        found = {}
        for name, back in asked.items():
            if self._came_s(back) <= begun_s:
                raise LinkError(f"no {back.message}.{back.signal} since the last command")
            if math.isfinite(value := self._received_value(self._outputs[name], back)):
                found[name] = value
        return found

    def close(self) -> None:
        """Leave the bus."""
        self._frames.close()

    def _identified(self) -> str:
        j1939 = self._j1939
        claim = AddressClaim(j1939.source, default_name()) if j1939 and j1939.claim and self._outputs else None
        key = "j1939.source in its description"
        self._frames = CanFrames(self._settings, self._take, claim, driver="can", key=key, echo=self._settings.echo)
        return ""

    def _take(self, identifier: int, data: bytes, extended: bool) -> bool:
        mine = [r for r in self._received.values() if self._is(r.message, identifier, extended)]
        for received in mine:
            received.take(data, system.now_s())
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

    def _put(self, values: Mapping[str, float]) -> Iterable[tuple[str, float]]:
        """Send the messages of these outputs."""
        self._look()
        held = {name: self._sent[self._outputs[name].message].set(self._outputs[name], v) for name, v in values.items()}
        for name in dict.fromkeys(self._outputs[name].message for name in values):
            message = self._sent[name].message
            self._frames.send(self._identifier(message), self._sent[name].frame(), message.is_extended_frame)
        self._commanded_s = system.now_s()
        self._watchdog.heard()
        return held.items()

    def _look(self) -> None:
        self._frames.receive(0.0)
        self._frames.address_is_ours()

    def _measured(self) -> dict[str, float]:
        """As they came last: none is too old, and no counter stands still."""
        until_s = system.now_s() + max([self._settings.timeout_s, *self._patience_s])
        while any(math.isinf(self._came_s(t)) for t in self._inputs.values()) and system.now_s() < until_s:
            self._frames.receive(max(0.0, until_s - system.now_s()))
        try:
            self.invalid_reasons = {name: why for name, t in self._inputs.items()
                               if (why := self._received[t.message].why_none(t))}  # fmt: skip
            return {name: self._received_value(t, t) for name, t in self._inputs.items()}
        except LinkError as error:
            raise self._failed(str(error)) from None

    def _held(self) -> dict[str, float]:
        """As messages say that have come."""
        came = {name: back for name, back in self._backs.items() if math.isfinite(self._came_s(back))}
        return {name: self._received_value(self._outputs[name], back) for name, back in came.items()}

    def _received_value(self, terminal: Any, signal: Any) -> float:
        return float(terminal.value_at(self._received[signal.message].value(signal, system.now_s())))

    def _forget(self) -> None:
        self._frames.receive(0.0)
        for received in self._received.values():
            received.came_s.clear()

    def _came_s(self, terminal: Any) -> float:
        return self._received[terminal.message].came_s.get(terminal.signal, -math.inf)
