"""The address space of a Modbus device, in which nothing is there yet."""

from __future__ import annotations

from sim_devices._field import Side
from sim_devices._modbus_frames import COMMON, Registers


class Bank(Registers):
    """The registers of a device as its manual lists them. An address that is not served is refused.

    Attributes:
        functions: those that its manual lists, by their codes.
    """

    functions = COMMON

    def __init__(self, side: Side) -> None:
        self.side = side
        self.silent_since_s = side.clock.now_s

    def heard(self) -> None:
        """A valid request came."""
        self.silent_since_s = self.side.clock.now_s

    @property
    def silent_s(self) -> float:
        """How long nothing was asked."""
        return self.side.clock.now_s - self.silent_since_s
