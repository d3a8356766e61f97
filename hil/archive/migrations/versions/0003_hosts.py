"""The computer on which a run folder lies: two benches may have the same path."""

from __future__ import annotations

import socket

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Add the column; which bench entered the runs of a shared database is not known until it enters them again."""
    op.add_column("run", sa.Column("host", sa.String(255)))
    if (bind := op.get_bind()).dialect.name == "sqlite":  # the index of one bench, in which a path stands once
        op.execute(sa.text("UPDATE run SET host = :here").bindparams(here=socket.gethostname()[:255]))
        return
    for found in sa.inspect(bind).get_unique_constraints("run"):
        if found["column_names"] == ["folder"]:
            op.drop_constraint(str(found["name"]), "run", type_="unique")
    op.create_unique_constraint("run_by_place", "run", ["folder", "host"])
