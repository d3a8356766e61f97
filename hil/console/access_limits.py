"""How often and how much: tokens that come back with time, and bodies that end where they may."""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from dataclasses import dataclass

from starlette.types import Message, Receive

_MOST_CALLERS = 4096
_PIECE_S = 20.0


@dataclass(frozen=True, slots=True)
class Rate:
    """So many at once, and so many a second after that."""

    burst: float
    per_s: float


class Limiter:
    """Counts callers, each by itself; those not heard of for longest are forgotten first.

    Args:
        rate: of each caller.
    """

    def __init__(self, rate: Rate) -> None:
        self._rate = rate
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def admits(self, caller: str) -> bool:
        """Whether this one is within the rate; counts it."""
        left = self._taken(caller)
        self._keep(caller, max(0.0, left))
        return left >= 0.0

    def wait_s(self, caller: str, most_s: float) -> float | None:
        """How long this one has to wait for its turn; counts it. None when that would be longer than a limit."""
        left = self._taken(caller)
        wait_s = max(0.0, -left / self._rate.per_s)
        refused = wait_s > most_s
        self._keep(caller, left + refused)
        return None if refused else wait_s

    def _taken(self, caller: str) -> float:
        """What is left to a caller now, less one."""
        now_s = time.monotonic()
        left, since_s = self._left.get(caller, (self._rate.burst, now_s))
        return min(self._rate.burst, left + (now_s - since_s) * self._rate.per_s) - 1.0

    def _keep(self, caller: str, left: float) -> None:
        self._left[caller] = (left, time.monotonic())
        self._left.move_to_end(caller)
        while len(self._left) > _MOST_CALLERS:
            self._left.popitem(last=False)


class TooLargeError(Exception):
    """A body is longer than it may be, or does not come to an end."""


def limited(receive: Receive, most_bytes: int) -> Receive:
    """The same messages, as long as their bodies together are within a limit and each piece comes in time."""
    count, whole = 0, False

    async def received() -> Message:
        nonlocal count, whole
        if whole:  # what comes after the body is that the caller has gone: that may take as long as it will
            return await receive()
        try:
            message = await asyncio.wait_for(receive(), _PIECE_S)
        except TimeoutError:
            raise TooLargeError(f"nothing came for {_PIECE_S:g} s") from None
        count += len(message.get("body", b""))
        if count > most_bytes:
            raise TooLargeError(f"more than {most_bytes} bytes")
        whole = not message.get("more_body", False)
        return message

    return received
