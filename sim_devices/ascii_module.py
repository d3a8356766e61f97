"""ASCII I/O modules in the ADAM-4000 style, with watchdog and a plant behind their terminals; the driver's twin."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from typing import Any

from sim_devices._field import Side
from sim_devices._lines_of_text import TextDevice, serve_text
from sim_devices._quirks import Quirks
from sim_devices._stream import StreamServer
from sim_devices._twin import Twin, TwinSettings, quirks, world

__all__ = ["Settings", "faults", "open_daq", "quirks", "serve", "terminals", "world"]

_VALUE = r"[+-]\d{2}\.\d{3}"


class Module(TextDevice):
    """A module at an address. To a syntax error or another address it says nothing; `?AA` refuses.

    When its watchdog expires, outputs go to zero; the next command is taken again. Asked for the last value of an
    output it tells what it was sent, not that.
    """

    end = b"\r"

    def __init__(self, side: Side, name: str, outputs: int, inputs: int, at: int) -> None:
        super().__init__(side)
        self._name, self._outputs, self._inputs, self._at = name, outputs, inputs, f"{at:02X}"
        self._watchdog_s = 0.0
        self._last = [side.standing(f"ao{i}") for i in range(outputs)]

    def answer_to(self, request: str) -> str | None:
        """The answer, None for none."""
        if len(request) < 3 or request[1:3] != self._at:
            return None
        answer = self._answered(request[0], request[3:])
        if answer is not None:
            self.heard_s = self.side.clock.now_s
        return answer

    def restart(self) -> None:
        """Outputs zero, watchdog off."""
        self._watchdog_s = 0.0
        self._last = [0.0] * self._outputs
        self._zero()

    def tick(self) -> None:
        """Outputs go to zero when nothing came for the watchdog's time."""
        if self._watchdog_s and self.side.clock.now_s - self.heard_s > self._watchdog_s:
            self._zero()

    def _answered(self, lead: str, body: str) -> str | None:
        if lead == "$" and body == "M":
            return f"!{self._at}{self._name}"
        if lead == "$" and body == "2":  # input type ±10 V, 9600 baud, engineering units
            return f"!{self._at}{'08' if self._inputs else '00'}0600"
        if lead == "$" and (found := re.fullmatch(r"X(\d{4})", body)):
            self._watchdog_s = 0.1 * int(found[1])
            return f"!{self._at}"
        if lead == "$" and (found := re.fullmatch(r"([68])C(\d)", body)):
            return self._told(found[1], int(found[2]))
        if lead == "#" and (found := re.fullmatch(rf"C(\d)({_VALUE})", body)):
            return self._set(found[1], float(found[2]))
        if lead == "#" and not body and self._inputs:
            return ">" + "".join(f"{self._read(i):+07.3f}" for i in range(self._inputs))
        return None

    def _set(self, channel: str, volts: float) -> str:
        if int(channel) >= self._outputs or abs(volts) > 10.0:
            return f"?{self._at}"
        self._last[int(channel)] = volts
        self.side.drive({f"ao{channel}": volts})
        return f"!{self._at}"

    def _told(self, what: str, channel: int) -> str:
        """The last value of an output, or its type: 32 is ±10 V."""
        if channel >= self._outputs:
            return f"?{self._at}"
        return f"!{self._at}{self._last[channel]:+07.3f}" if what == "6" else f"!{self._at}C{channel}32"

    def _read(self, i: int) -> float:
        return max(-10.0, min(10.0, self.side.number(f"ai{i}")))

    def _zero(self) -> None:
        if any(self.side.standing(f"ao{i}") != 0.0 for i in range(self._outputs)):
            self.side.drive({f"ao{i}": 0.0 for i in range(self._outputs)})


def serve(settings: Mapping[str, Any], side: Side, behave: Quirks) -> StreamServer:
    """Serve the module where the driver will look for it."""
    name, outputs, inputs = {"adam-4017": ("4017", 0, 8), "adam-4024": ("4024", 4, 0)}[settings["model"]]
    make = partial(Module, name=name, outputs=outputs, inputs=inputs, at=int(settings.get("module", 1)))
    return serve_text(make, settings, side, behave)


_twin = Twin("ascii_module", serve, example="socket://127.0.0.1:4001", free="socket://127.0.0.1:0")
Settings, faults, terminals, open_daq = TwinSettings, _twin.faults, _twin.terminals, _twin.open_daq
