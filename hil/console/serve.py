"""The console's server: one process, on loopback; what it starts outlives it."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable

from hil.bench.stop.consoles import Console, announced
from hil.console.app import application
from hil.console.site import Site
from hil.errors import SettingError

_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_SHUTDOWN_S = 1


def serve(site: Site, host: str, port: int, ready: Callable[[str], None]) -> None:
    """Serve until Ctrl-C.

    Args:
        site: what is shown.
        host: where it listens.
        port: of it; 0 takes one that is free.
        ready: told the address when it listens.

    Raises:
        SettingError: a host beyond this computer, or a port that cannot be had.
    """
    import uvicorn

    if host not in _LOOPBACK:
        raise SettingError(f"--host {host}: the console listens on this computer alone ({', '.join(_LOOPBACK)})")
    listening = _listening(host, port)
    named = f"[{host}]" if ":" in host else host
    port = int(listening.getsockname()[1])
    config = uvicorn.Config(
        application(site), log_level="warning", access_log=False, ws="none", server_header=False,
        timeout_graceful_shutdown=_SHUTDOWN_S, h11_max_incomplete_event_size=16_384,
    )  # fmt: skip
    with announced(Console(pid=os.getpid(), origins=_origins(port), host=host)):
        ready(f"http://{named}:{port}/")
        uvicorn.Server(config).run([listening])


def _origins(port: int) -> tuple[str, ...]:
    """As browsers name pages of this console."""
    return tuple(f"http://{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))


def _listening(host: str, port: int) -> socket.socket:
    try:
        made = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, OverflowError) as error:
        said = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise SettingError(f"--port {port} on {host}: {said}; say another --port") from None
    made.set_inheritable(False)
    return made
