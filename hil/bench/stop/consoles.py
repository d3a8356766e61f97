"""Which consoles there are: whose pages may read an answer, and with which certificate a listener speaks to them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from pydantic import ValidationError

from hil.errors import FileError
from hil.record.run_folder.process_liveness import is_alive
from hil.record.state import keep, state_path
from hil.strict import Strict
from hil.untrusted import read_untrusted_json

LOOPBACK = ("127.0.0.1", "localhost", "::1")


class Console(Strict):
    """A console that runs on this computer.

    Attributes:
        pid: its process.
        origins: of its pages, as a browser names them: `http://127.0.0.1:8123`.
        host: at which it listens.
        cert, key: files of its certificate, where it has one.
    """

    pid: int
    origins: tuple[str, ...]
    host: str
    cert: str = ""
    key: str = ""

    @property
    def is_reached_from_network(self) -> bool:
        """Whether other computers reach it, over TLS."""
        return self.host not in LOOPBACK and bool(self.cert and self.key)


@contextmanager
def announced(console: Console) -> Iterator[None]:
    """The console is known to the runs of this user while inside.

    Raises:
        StorageError: it cannot be written down.
    """
    path = state_path("consoles", str(console.pid), ".json")
    keep(path, console.model_dump_json(), "the console cannot be announced to its runs")
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()


def consoles() -> list[Console]:
    """Those that run now. Never raises: a file that cannot be read names none."""
    found = []
    with suppress(OSError):
        for path in sorted(state_path("consoles", "any", ".json").parent.glob("*.json")):
            with suppress(OSError, FileError, ValidationError):
                console = Console.model_validate(read_untrusted_json(path.parent, path.name))
                if is_alive(console.pid):
                    found.append(console)
    return found


def may_read(origin: str) -> bool:
    """Whether a page of this origin is a console's."""
    return any(origin in console.origins for console in consoles())
