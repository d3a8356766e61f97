"""Whether a run is of a simulated valve."""

from __future__ import annotations

import socket
from contextlib import suppress
from pathlib import Path

import sqlalchemy as sa
from alembic import op

from hil.errors import FileError
from hil.record.run_folder.header import read_header
from hil.record.simulated import is_simulated

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Add the column, and fill it for the runs of this computer."""
    op.add_column("run", sa.Column("simulated", sa.Boolean))
    rows = sa.table("run", *map(sa.column, ("id", "host", "folder", "simulated")))
    here = sa.select(rows.c.id, rows.c.folder).where(rows.c.host == socket.gethostname()[:255])
    for key, folder in op.get_bind().execute(here).all():
        with suppress(FileError):
            op.execute(
                rows.update().where(rows.c.id == key).values(simulated=is_simulated(read_header(Path(folder)).meta))
            )
