"""A PostgreSQL server of the tests' own, on loopback, in a folder that goes with it."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.links import free_port

_PLACES = ("/usr/lib/postgresql", "/usr/local/pgsql")
_START_S = 600.0


def server_programs() -> Path | None:
    """The folder of `initdb` and `postgres`, or None where no server is installed."""
    found = shutil.which("initdb")
    if found:
        return Path(found).resolve().parent
    versions = [path for place in _PLACES for path in Path(place).glob("*/bin/initdb")]
    return max(versions).parent if versions else None


@contextmanager
def served(programs: Path) -> Iterator[str]:
    """A running server; yields the URL of its database. As root it runs as the user `postgres`."""
    user = {"user": "postgres", "group": "postgres"} if os.geteuid() == 0 else {}
    folder = Path(tempfile.mkdtemp(prefix="hil-pg-"))
    if user:
        shutil.chown(folder, **user)
    port = free_port()
    options = ["-A", "trust", "-U", "hil", "-E", "UTF8", "--no-sync", "-D", str(folder / "data")]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder, **user}
    subprocess.run([programs / "initdb", *options], check=True, **quiet)
    command = [programs / "postgres", "-D", folder / "data", "-h", "127.0.0.1", "-p", str(port), "-k", folder, "-F"]
    server = subprocess.Popen(command, **quiet)
    try:
        _wait(port, server)
        yield f"postgresql://hil@127.0.0.1:{port}/postgres"
    finally:
        server.terminate()
        server.wait(_START_S)
        shutil.rmtree(folder, ignore_errors=True)


def new_database(url: str) -> str:
    """An empty database on the server; its URL."""
    import psycopg

    name = f"lab_{uuid.uuid4().hex}"
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    return f"{url.rsplit('/', 1)[0]}/{name}"


def _wait(port: int, server: subprocess.Popen[bytes]) -> None:
    import psycopg

    deadline_s = time.monotonic() + _START_S
    while time.monotonic() < deadline_s and server.poll() is None:
        try:
            psycopg.connect(host="127.0.0.1", port=port, user="hil", dbname="postgres").close()
        except psycopg.OperationalError:
            time.sleep(0.1)
        else:
            return
    raise RuntimeError(f"PostgreSQL did not start within {_START_S:g} s")
