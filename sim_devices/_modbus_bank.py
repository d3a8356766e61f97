"""The address space of a Modbus device, in which nothing is there yet."""

# ruff: noqa: ARG002 - a bank of registers says what it refuses by methods that do nothing else

from __future__ import annotations

from sim_devices._field import Side
from sim_devices._modbus_frames import COMMON, Refused


class Bank:
    """The registers of a device as its manual lists them. An address that is not served is refused.

    Attributes:
        functions: those that its manual lists, by their codes.
    """

    functions = COMMON

    def __init__(self, side: Side) -> None:
        self.side = side
        self.silent_since_s = side.clock.now_s

    def input(self, address: int) -> int:
        """An input register."""
        raise Refused(2)

    def holding(self, address: int) -> int:
        """A holding register."""
        raise Refused(2)

    def output(self, address: int) -> int:
        """What a write to a holding register changes."""
        return self.holding(address)

    def coil(self, address: int) -> bool:
        """A coil."""
        raise Refused(2)

    def discrete(self, address: int) -> bool:
        """A discrete input."""
        raise Refused(2)

    def write(self, address: int, count: int) -> None:
        """Write a holding register."""
        raise Refused(2)

    def write_coil(self, address: int, on: bool) -> None:
        """Write a coil."""
        raise Refused(2)

    def may_write(self, address: int, count: int) -> None:
        """Refuse what `write` would refuse, before anything of a request is written."""
        raise Refused(2)

    def restart(self) -> None:
        """Outputs and watchdog as after power-on."""

    def heard(self) -> None:
        """A valid request came."""
        self.silent_since_s = self.side.clock.now_s

    def tick(self) -> None:
        """Look at the watchdog."""

    @property
    def silent_s(self) -> float:
        """How long nothing was asked."""
        return self.side.clock.now_s - self.silent_since_s
