"""Where the archive is: a folder of runs with its index in it, or a database that the benches of a lab share."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

INDEX_FILE = "archive.sqlite"
DEFAULT_FOLDER = Path("runs")


@dataclass(frozen=True, slots=True)
class Place:
    """An archive: the URL of its index, and the folder of its runs where there is one."""

    url: str
    folder: Path | None = None

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
        """As a message names it, a password left out."""
        from sqlalchemy.engine import make_url

        return str(self.folder) if self.folder else make_url(self.url).render_as_string(hide_password=True)


def archive_place(given: str = "") -> Place:
    """The archive that was named, else `HIL_ARCHIVE`, else `./runs`."""
    name = given or os.environ.get("HIL_ARCHIVE", "") or str(DEFAULT_FOLDER)
    if "://" in name:
        return Place(name.replace("postgresql://", "postgresql+psycopg://", 1))
    folder = Path(name).resolve()
    return Place(f"sqlite:///{folder / INDEX_FILE}", folder)
