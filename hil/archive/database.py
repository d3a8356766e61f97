"""The database behind an archive: opened, brought to this program's version, or refused in one sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, inspect, text
from sqlalchemy.exc import DatabaseError, DataError, OperationalError, SQLAlchemyError

from hil.archive.place import Place
from hil.errors import ArchiveError
from hil.extras import lacking

_PATIENCE_S = 2  # for a database that is locked or far away: the bench is waiting
_POSTGRESQL = {
    "connect_timeout": _PATIENCE_S,
    "tcp_user_timeout": 1000 * _PATIENCE_S,  # ms: a network that is gone in the middle
    "options": f"-c lock_timeout={_PATIENCE_S}s",  # a table that somebody else has locked
}


_OF_A_ROW = ("22", "23", "44", "54", "P0")
"""Classes of SQLSTATE that concern what a row says: data, constraints, views, sizes, and triggers of a lab's own."""
_ENTERED_MEANWHILE = "23505"
WRITES = "hil_writes"
"""Execution option of a connection: its transaction writes."""


_REMEDY = "`hil archive rebuild` makes it anew from the folders"


class DamagedIndexError(ArchiveError):
    """A file in the place of an index cannot be read as one."""


@contextmanager
def opened(place: Place, *, make: bool = True) -> Iterator[Engine]:
    """The database of an archive at this program's version, made where there is none.

    Args:
        place: the archive.
        make: where there is not even a folder, make it; else an empty database is shown that nobody keeps.

    Raises:
        ArchiveError: it is locked, full, away, or was made by a newer version; also what goes wrong inside.
    """
    try:
        engine = _engine(place) if make or not place.is_away else create_engine("sqlite://")
    except (SQLAlchemyError, OSError, ModuleNotFoundError) as error:
        raise _refused(place, error) from error
    try:
        _migrate(engine, place)
        yield engine
    except (SQLAlchemyError, OSError) as error:
        raise _refused(place, error) from error
    finally:
        engine.dispose()


def _engine(place: Place) -> Engine:
    if place.folder is None:
        engine = create_engine(place.url, connect_args=_POSTGRESQL if place.url.startswith("postgresql") else {})
    else:
        place.folder.mkdir(parents=True, exist_ok=True)
        engine = create_engine(place.url, connect_args={"timeout": _PATIENCE_S})
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _prepare_sqlite)
        event.listen(engine, "begin", _begin_sqlite)
    return engine


def _prepare_sqlite(connection: Any, _record: Any) -> None:
    """Readers do not wait for a writer, and rows that belong to a run go with it."""
    connection.isolation_level = None  # `_begin_sqlite` begins: Python would not before tables are made
    for line in ("PRAGMA journal_mode=WAL", "PRAGMA synchronous=NORMAL", "PRAGMA foreign_keys=ON"):
        connection.execute(line)


def _begin_sqlite(connection: Connection) -> None:
    """Tables too are made all or none, on a full disk as well.

    Who will write says so: a transaction that begins by reading could not wait for another's.
    """
    connection.exec_driver_sql("BEGIN IMMEDIATE" if connection.get_execution_options().get(WRITES) else "BEGIN")


def _migrate(engine: Engine, place: Place) -> None:
    folder = files("hil.archive") / "migrations"
    newest = max(file.name for file in (folder / "versions").iterdir() if file.name[0].isdigit()).partition("_")[0]
    with engine.connect() as connection:
        if _version(connection) == newest:
            return
    with engine.execution_options(**{WRITES: True}).begin() as connection:
        if (found := _version(connection)) == newest:  # by somebody else meanwhile
            return
        if found is None and inspect(connection).has_table("run"):
            raise DamagedIndexError(f"archive {place}: half made; {_REMEDY}")
        from alembic import command  # a fifth of a second, and not needed by most
        from alembic.config import Config
        from alembic.util import CommandError

        config = Config()
        config.set_main_option("script_location", str(folder))
        config.attributes["connection"] = connection
        try:
            command.upgrade(config, "head")
        except CommandError as error:
            raise ArchiveError(
                f"archive {place}: its index was made by a newer version of this program and stays as it is; use that "
                "one, or `hil archive rebuild` after moving the index away"
            ) from error


def _version(connection: Connection) -> str | None:
    """Of the tables, as alembic noted it; None of an empty database."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    return connection.execute(text("select version_num from alembic_version")).scalar()


def is_refusal(error: Exception) -> bool:
    """Whether an error is of a run that the database cannot hold, and would be raised of it again.

    Such are a name too long, a character that it does not know, and a rule that the lab gave its database.
    """
    state = str(getattr(getattr(error, "orig", None), "sqlstate", None) or "")
    of_a_row = state[:2] in _OF_A_ROW and state != _ENTERED_MEANWHILE
    return of_a_row or isinstance(error, (DataError, ValueError, OverflowError, TypeError))


def refused_by(place: Place, error: Exception) -> str:
    """Why a database does not take a run, in one sentence."""
    cause, *_ = str(getattr(error, "orig", None) or error).splitlines() or [""]
    return f"archive {place} refuses it: {place.without_password(cause)}"


def _refused(place: Place, error: Exception) -> ArchiveError:
    if isinstance(error, ModuleNotFoundError):
        return ArchiveError(f"archive {place}: its database needs {lacking(error.name or '?')}")
    cause = place.without_password(getattr(error, "orig", None) or error)
    if isinstance(error, DatabaseError) and not isinstance(error, OperationalError) and place.folder is not None:
        return DamagedIndexError(f"archive {place}: {cause}; {_REMEDY}")
    return ArchiveError(f"archive {place}: {cause}")
