"""Where a console is reached, and what that takes."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from hil.bench.stop.consoles import LOOPBACK, Console, announced
from hil.console.access_accounts import Accounts
from hil.errors import SettingError


@dataclass(frozen=True, slots=True)
class Where:
    """Where a console is reached.

    Attributes:
        host, port: at which it listens.
        cert, key: files of its certificate; None on this computer alone.
        public: its address behind a proxy, `https://bench7.lab`; empty without one.
        proxies: addresses of proxies whose word about a caller's address is believed.
    """

    host: str
    port: int
    cert: Path | None = None
    key: Path | None = None
    public: str = ""
    proxies: tuple[str, ...] = ()

    @property
    def is_local(self) -> bool:
        """Whether no other computer reaches it."""
        return self.host in LOOPBACK and not self.public

    @property
    def is_everywhere(self) -> bool:
        """Whether it listens at every address of this computer."""
        return self.host in ("0.0.0.0", "::", "")

    @property
    def scheme(self) -> str:
        """Of its address."""
        return "https" if self.cert or self.public else "http"

    @property
    def cookie(self) -> str:
        """The name of its session's cookie: browsers send a cookie to every port of a computer.

        Over TLS no page of another name, and none without TLS, can set it.
        """
        name = f"hil_session_{self.port}"
        return f"__Host-{name}" if self.scheme == "https" else name

    @property
    def hosts(self) -> frozenset[str]:
        """What a browser may call it."""
        if self.public:
            return frozenset({self.public.removeprefix("https://")})
        names = {"127.0.0.1", "localhost", "[::1]", f"[{self.host}]" if ":" in self.host else self.host} - {""}
        usual = self.port == (443 if self.cert else 80)
        return frozenset(name if usual else f"{name}:{self.port}" for name in names)

    @property
    def listeners(self) -> str:
        """Where its pages reach the listeners of runs, in the words of a Content-Security-Policy."""
        if self.public:
            return ""  # through the console
        if self.is_local:
            return "http://127.0.0.1:* http://localhost:*"
        return "https:" if self.is_everywhere else f"https://{self.host}:*"

    @property
    def address(self) -> str:
        """As it is told to who started it."""
        if self.public:
            return f"{self.public}/"
        return f"{self.scheme}://{f'[{self.host}]' if ':' in self.host else self.host}:{self.port}/"

    @property
    def origins(self) -> tuple[str, ...]:
        """Of its pages."""
        return tuple(sorted(f"{self.scheme}://{host}" for host in self.hosts))


def check_where(where: Where, accounts: Accounts) -> None:
    """Refuse a console that others reach and everybody may use.

    Raises:
        SettingError: beyond this computer without accounts, or without a certificate.
        FileError: the file of accounts cannot be read.
    """
    if (where.cert is None) != (where.key is None):
        raise SettingError("--cert and --key belong together: say both, or neither")
    for option, path in (("--cert", where.cert), ("--key", where.key)):
        if path is not None and not path.is_file():
            raise SettingError(f"{option} {path}: no such file")
    if bool(where.public) != bool(where.proxies):
        raise SettingError("--public and --proxy belong together: say both, or neither")
    if where.public and not re.fullmatch(r"https://[^/?#@\s]+", where.public):
        raise SettingError(f"--public {where.public}: https:// and a name was expected, as https://bench7.lab")
    if where.is_local:
        return
    if not accounts.all():
        reached = f"--public {where.public}" if where.public else f"--host {where.host}"
        raise SettingError(
            f"{reached}: others reach the console there, and it has no accounts; "
            "`hil console user add NAME --role engineer` makes one"
        )
    if where.cert is None and not (where.public and where.host in LOOPBACK):
        raise SettingError(f"--host {where.host}: others reach the console there; say --cert FILE --key FILE too")


@contextmanager
def opened(where: Where, accounts: Accounts) -> Iterator[None]:
    """A console may be reached there, and is known to the runs of this user while inside.

    Raises:
        SettingError, FileError: see `check_where`.
        StorageError: it cannot be announced to the runs.
    """
    check_where(where, accounts)
    files = {"cert": str(where.cert.resolve()), "key": str(where.key.resolve())} if where.cert and where.key else {}
    with announced(Console(pid=os.getpid(), origins=where.origins, host=where.host, **files)):
        yield
