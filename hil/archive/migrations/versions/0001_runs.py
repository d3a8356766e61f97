"""Runs and their measured values."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Make the tables."""
    op.create_table(
        "run",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("folder", sa.Text, nullable=False, unique=True),
        *(
            sa.Column(name, sa.String(255), nullable=False)
            for name in ("name", "serial", "operator", "procedure", "bench")
        ),
        sa.Column("started_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("outcome", sa.Text, nullable=False),
        sa.Column("verdict", sa.String(16)),
    )
    for name in ("serial", "procedure", "verdict"):
        op.create_index(f"run_by_{name}", "run", [name, "started_utc"])
    op.create_index("run_by_start", "run", ["started_utc"])
    op.create_table(
        "measured_value",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("run_id", sa.Integer, sa.ForeignKey("run.id", ondelete="CASCADE"), nullable=False, index=True),
        sa.Column("name", sa.String(255), nullable=False, index=True),
        sa.Column("value", sa.Float),
        sa.Column("std", sa.Float),
        sa.Column("calibration_std", sa.Float, nullable=False),
        sa.Column("unit", sa.String(64), nullable=False),
        sa.Column("low", sa.Float),
        sa.Column("high", sa.Float),
        sa.Column("relation", sa.String(1), nullable=False),
        sa.Column("verdict", sa.String(16)),
    )
