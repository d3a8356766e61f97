"""A bus of python-can that falls ill when it is told to: python-can's virtual one behind it."""

from __future__ import annotations

from typing import Any, ClassVar

import can


class SickBus(can.BusABC):
    """Give `illness` an exception for sending, receiving or both, and every bus raises it until it is taken away.

    `echoes`: what is sent comes back as if it came from the bus.
    """

    illness: ClassVar[dict[str, Exception]] = {}
    echoes: ClassVar[bool] = False

    def __init__(self, channel: str, **_more: Any) -> None:
        self._behind = can.Bus(interface="virtual", channel=channel)
        self._mine: list[can.Message] = []
        self.channel_info = f"sick {channel}"
        super().__init__(channel=channel)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if "send" in self.illness:
            raise self.illness["send"]
        self._behind.send(msg, timeout)
        if self.echoes:
            self._mine.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if "recv" in self.illness:
            raise self.illness["recv"]
        return (self._mine.pop(0) if self._mine else self._behind.recv(timeout)), False

    def shutdown(self) -> None:
        super().shutdown()
        self._behind.shutdown()
