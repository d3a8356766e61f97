"""A device on CAN as a link: outputs commanded and read back, inputs as they came last, silence told."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

from drivers._can_frames import BusSettings, CanFrames
from drivers._can_messages import received_messages, sent_messages
from drivers._edge import edge
from hil.daq.channel import Wiring
from hil.description.can import CanDescription
from hil.errors import LinkError, SettingError

_EVERY_S = 0.1  # between commands where neither description nor watchdog says


@edge
class CanLink:
    """A device on CAN (see `hil.daq.link.Link`). Opened without outputs it sends nothing.

    Nothing acknowledges a command; where a message says where an output stands, that is asked for. Commands come with
    every drive, and in a pause so often as the description says: they end with the program.

    Raises:
        SettingError: its outputs would fall to another value than the safe one when commands end.
        LinkError: another controller has our address.
    """

    def __init__(self, settings: BusSettings, wiring: Wiring, told: CanDescription) -> None:
        _check_level(told, wiring)
        self._settings = settings
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
        self._frames = CanFrames(settings, told.j1939, self._received.values(), claims=bool(self._outputs))

    def standing(self) -> dict[str, float]:
        """Where outputs stand, as a message since the last command says, of those of which one does."""
        begun_s = max(self._driven_s or 0.0, time.monotonic() if self._driven_s is None else 0.0)
        asked = {name: t.read_back for name, t in self._outputs.items() if t.read_back is not None}
        until_s = time.monotonic() + self._settings.timeout_s
        self._frames.receive(0.0)  # who asks again wants to know what was said since
        while any(self._came_s(back) <= begun_s for back in asked.values()) and time.monotonic() < until_s:
            self._frames.receive(max(0.0, until_s - time.monotonic()))
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
        self._frames.receive(0.0)
        self._frames.address_is_ours()
        messages = dict.fromkeys(self._outputs[name].message for name in values)
        for name, value in values.items():
            self._stands[name] = self._sent[self._outputs[name].message].set(self._outputs[name], value)
        for message in messages:
            self._frames.send(self._sent[message].message, self._sent[message].frame())
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
            self._frames.receive(0.0)
            self._forget()
        self._quiet_until_s = 0.0
        self._frames.receive(0.0)
        self._frames.address_is_ours()
        until_s = time.monotonic() + max([self._settings.timeout_s, *self._patience_s])
        while any(math.isinf(self._came_s(t)) for t in self._inputs.values()) and time.monotonic() < until_s:
            self._frames.receive(max(0.0, until_s - time.monotonic()))
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
        self._frames.close()

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


def _check_level(told: CanDescription, wiring: Wiring) -> None:
    for name, channel in wiring.outputs.items():
        if told.watchdog is not None and abs(told.watchdog.expires_to - channel.safe) > 1e-9:
            raise SettingError(
                f"'{name}' is safe at {channel.safe:g} {channel.unit}, but when commands end the device puts it at "
                f"{told.watchdog.expires_to:g}: connect the valve so that this is safe, or take another device"
            )
