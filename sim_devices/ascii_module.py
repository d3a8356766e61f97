"""ASCII I/O modules in the ADAM-4000 style, with watchdog and a plant behind their terminals; the driver's twin."""

from __future__ import annotations

import re

from hil.description.ascii_module import ModuleDescription
from sim_devices._field import Side
from sim_devices._lines_of_text import TextDevice, serve_lines
from sim_devices._twin import described_in, offered

_VALUE = r"[+-]\d{2}\.\d{3}"


class Module(TextDevice):
    """A module at an address. To a syntax error or another address it says nothing; `?AA` refuses.

    When its watchdog expires, outputs go to zero; the next command is taken again. Asked for the last value of an
    output it tells what it was sent, not that.
    """

    end = b"\r"

    def __init__(self, side: Side, description: ModuleDescription, at: int) -> None:
        super().__init__(side)
        names = list(description.by_name)
        is_in = description.channels.direction == "in"
        self._outputs, self._inputs = ([], names) if is_in else (names, [])
        self._module, self._at, (self._low, self._high) = description, f"{at:02X}", description.channels.range
        self._watchdog_s = 0.0
        self._last = [side.standing(name) for name in self._outputs]

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
        self._last = [0.0] * len(self._outputs)
        self._zero()

    def tick(self) -> None:
        """Outputs go to zero when nothing came for the watchdog's time."""
        if self._watchdog_s and self.side.clock.now_s - self.heard_s > self._watchdog_s:
            self._zero()

    def _answered(self, lead: str, body: str) -> str | None:
        if lead == "$" and body == "M":
            return f"!{self._at}{self._module.module_name}"
        if lead == "$" and body == "2":  # input type, 9600 baud, engineering units
            return f"!{self._at}{self._module.type_code if self._inputs else '00'}0600"
        if lead == "$" and (found := re.fullmatch(r"X(\d{4})", body)):
            self._watchdog_s = 0.1 * int(found[1])
            return f"!{self._at}"
        if lead == "$" and (found := re.fullmatch(r"([68])C(\d)", body)):
            return self._answered_value(found[1], int(found[2]))
        if lead == "#" and (found := re.fullmatch(rf"C(\d)({_VALUE})", body)):
            return self._set(found[1], float(found[2]))
        if lead == "#" and not body and self._inputs:
            return ">" + "".join(f"{self._read(i):+07.3f}" for i in range(len(self._inputs)))
        return None

    def _set(self, channel: str, volts: float) -> str:
        if int(channel) >= len(self._outputs) or not self._low <= volts <= self._high:
            return f"?{self._at}"
        self._last[int(channel)] = volts
        self.side.drive({self._outputs[int(channel)]: volts})
        return f"!{self._at}"

    def _answered_value(self, what: str, channel: int) -> str:
        """The last value of an output, or its type."""
        if channel >= len(self._outputs):
            return f"?{self._at}"
        return (
            f"!{self._at}{self._last[channel]:+07.3f}"
            if what == "6"
            else f"!{self._at}C{channel}{self._module.type_code}"
        )

    def _read(self, i: int) -> float:
        return max(self._low, min(self._high, self.side.number(self._inputs[i])))

    def _zero(self) -> None:
        if any(self.side.standing(name) != 0.0 for name in self._outputs):
            self.side.drive(dict.fromkeys(self._outputs, 0.0))


Settings, faults, terminals, open_daq, serve, quirks, world = offered(
    "ascii_module",
    serve_lines,
    lambda settings, side: Module(side, described_in(settings, "ascii_module"), int(settings.get("module", 1))),
    "socket://127.0.0.1:0",
)
