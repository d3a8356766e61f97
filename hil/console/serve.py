"""The console's server: one process; what it starts outlives it, but for a SIGTERM (see `hil.console.leaving`)."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from dataclasses import replace

from hil.bench.audit import Audit
from hil.console.access_accounts import Accounts
from hil.console.access_where import Where, check_where, opened
from hil.console.app import application
from hil.console.site import Site
from hil.errors import SettingError

_SHUTDOWN_S = 1


def serve(site: Site, where: Where, ready: Callable[[str], None]) -> None:
    """Serve until Ctrl-C, or until SIGTERM, which ends runs that were started here, too.

    Args:
        site: what is shown.
        where: it listens; the port 0 takes one that is free.
        ready: told the address when it listens.

    Raises:
        SettingError: a host beyond this computer without accounts or certificate, or a port that cannot be had.
    """
    import uvicorn

    from hil.console.server import Server

    accounts = Accounts()
    check_where(where, accounts)
    listening = _listening(where.host, where.port)
    where = replace(where, port=int(listening.getsockname()[1]))
    app = application(site, where, accounts, Audit())
    config = uvicorn.Config(
        app, ssl_certfile=where.cert, ssl_keyfile=where.key,
        log_level="warning", access_log=False, ws="none", server_header=False,
        proxy_headers=bool(where.proxies), forwarded_allow_ips=list(where.proxies),
        timeout_graceful_shutdown=_SHUTDOWN_S, h11_max_incomplete_event_size=16_384,
    )  # fmt: skip
    with opened(where, accounts):
        ready(where.address)
        Server(config, app.state.console).run([listening])


def _listening(host: str, port: int) -> socket.socket:
    try:
        made = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, OverflowError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise SettingError(f"--port {port} on {host}: {reason}; say another --port") from None
    made.set_inheritable(False)
    return made
