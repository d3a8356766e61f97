"""The console's web server: uvicorn behind a door of our own, so that connections that say nothing cost nothing."""

from __future__ import annotations

import asyncio
import logging
import signal
import socket
import time
from collections.abc import Callable
from functools import partial
from types import FrameType

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from hil.bench.stop.door import Door
from hil.console.console import Console

_MOST = 256  # connections at a time: of 1024 descriptors, runs and logs need some too
_SAYS_S = 10.0
_LOOK_S = 0.2
_LOG_S = 60.0
_LOGGER = logging.getLogger("uvicorn.error")


class Server(uvicorn.Server):
    """Serves until a signal ends it; its streams end with it: they would go on for as long as their runs.

    After SIGTERM its runs are ended, and it leaves after them. A Ctrl-C meanwhile ends that.

    Args:
        config: of uvicorn.
        console: which it serves.
    """

    def __init__(self, config: uvicorn.Config, console: Console) -> None:
        super().__init__(config)
        self._console = console
        for name in ("uvicorn.error", "asyncio"):
            logging.getLogger(name).addFilter(OnceAMinute())

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """A signal."""
        self._console.close()
        super().handle_exit(sig, frame)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to serve."""
        await super().startup(sockets=[])
        made = partial(_Visitor, self.config, self.server_state, self.lifespan.state)
        self._door = Door([(one, self.config.ssl) for one in sockets or []], made, _MOST, _SAYS_S, _dropped)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Serve no more."""
        leaving = self._console.leave() if self._is_terminated else None
        self._door.close()
        await super().shutdown(sockets)
        while leaving is not None and not self.force_exit and not leaving.is_over:
            await asyncio.sleep(_LOOK_S)

    @property
    def _is_terminated(self) -> bool:
        return signal.SIGTERM in self._captured_signals


class _Visitor(H11Protocol):
    """A connection, as the door deals with it."""

    gone: Callable[[], None] = staticmethod(lambda: None)

    @property
    def waits(self) -> bool:
        """Whether a request of it is there whole, and its answer is not."""
        return self.has_asked and not self.cycle.response_complete

    @property
    def has_asked(self) -> bool:
        """Whether a whole request of it came, the last time."""
        return self.cycle is not None and not self.cycle.more_body

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        super().connection_lost(exc)
        self.gone()


class OnceAMinute(logging.Filter):
    """Lets the same message pass once a minute, whatever its values: a flood fills no disk."""

    def __init__(self) -> None:
        super().__init__()
        self._logged_s: dict[str, float] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it is said."""
        now_s = time.monotonic()
        if now_s - self._logged_s.get(record.msg, -_LOG_S) < _LOG_S:
            return False
        self._logged_s[record.msg] = now_s
        return True


def _dropped() -> None:
    _LOGGER.warning("connections that ask for nothing were closed; somebody floods this console, or a page hangs")
