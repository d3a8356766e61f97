"""Where the archive is: a folder of runs with its index in it, or a database that the benches of a lab share."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from hil.errors import ArchiveError
from hil.untrusted import resolved

VARIABLE = "HIL_ARCHIVE"
INDEX_FILE = "archive.sqlite"
DEFAULT_FOLDER = Path("runs")


@dataclass(frozen=True, slots=True)
class Place:
    """An archive: the URL of its index, which may hold a password, and the folder of its runs where there is one."""

    url: str = field(repr=False)
    folder: Path | None = None

    @property
    def address(self) -> str:
        """As `archive_place` takes it; with the password."""
        return str(self.folder or self.url)

    @property
    def is_unmade(self) -> bool:
        """Whether its folder is there and holds no index yet, or none any more."""
        if self.folder is None or not self.folder.is_dir():
            return False
        index = self.folder / INDEX_FILE
        return not index.exists() or not index.stat().st_size

    @property
    def is_away(self) -> bool:
        """Whether it should be a folder, and there is none."""
        return self.folder is not None and not self.folder.is_dir()

    def __str__(self) -> str:
        """As a message, a command line or a file names it: without a password or options, one of which may be one."""
        if self.folder:
            return str(self.folder)
        from sqlalchemy.engine import make_url

        return make_url(self.url).set(query={}).render_as_string(hide_password=True)

    def without_password(self, error: object) -> str:
        """What an error says, on one line, without the password."""
        text = " ".join(str(error).split())
        if not self.folder:
            from sqlalchemy.engine import make_url

            url = make_url(self.url)
            for secret in filter(None, (url.password, *map(str, url.query.values()))):
                text = text.replace(str(secret), "***")
        return text


def archive_place(given: str = "") -> Place:
    """The archive that was named, else `HIL_ARCHIVE`, else `./runs`.

    Raises:
        ArchiveError: an address of a database that is none; what it says is not repeated, since it may hold a password.
        FileError: a folder whose links go round in a circle.
    """
    name = given or os.environ.get(VARIABLE, "") or str(DEFAULT_FOLDER)
    if "://" in name:
        return Place(_database(name.replace("postgresql://", "postgresql+psycopg://", 1)))
    folder = resolved(Path(name))
    return Place(f"sqlite:///{folder / INDEX_FILE}", folder)


def _database(url: str) -> str:
    from sqlalchemy.engine import make_url
    from sqlalchemy.exc import ArgumentError

    try:
        parsed = make_url(url)
        sound = "@" not in (parsed.host or "")
    except (ArgumentError, ValueError):
        sound = False
    if not sound:
        raise ArchiveError(
            "the archive is no address of a database: postgresql://USER:PASSWORD@HOST/DATABASE was expected, with "
            "%40 for @, %3A for :, %2F for / in a password"
        )
    return url
