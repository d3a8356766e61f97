"""Calibrations that the runs state, and a mark of the instruments that measured a run."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Add the table and the column; runs that are in the index have neither until it is made anew."""
    op.add_column("run", sa.Column("instruments", sa.String(64)))
    op.create_table(
        "calibration",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("run_id", sa.Integer, sa.ForeignKey("run.id", ondelete="CASCADE"), nullable=False, index=True),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("channel", "instrument", "serial")),
        sa.Column("date", sa.Date),
        sa.Column("due", sa.Date),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("reference", "uncertainty")),
    )
