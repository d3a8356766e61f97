"""The tables of the index. What they hold stands in the run folders too."""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import (
    Boolean,
    Column,
    Date,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    TypeDecorator,
)


class Utc(TypeDecorator[datetime]):
    """A time, kept as UTC; SQLite has no time zones."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """To UTC."""
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """With its zone."""
        return value if value is None or value.tzinfo else value.replace(tzinfo=UTC)


TABLES = MetaData()

RUN = Table(
    "run", TABLES, Column("id", Integer, primary_key=True), Column("host", String(255)),
    Column("folder", Text, nullable=False),
    *(Column(name, String(255), nullable=False) for name in ("name", "serial", "operator", "procedure", "bench")),
    Column("started_utc", Utc, nullable=False), Column("outcome", Text, nullable=False), Column("verdict", String(16)),
    Column("instruments", String(64)), Column("simulated", Boolean), Index("run_by_start", "started_utc"),
    *(Index(f"run_by_{name}", name, "started_utc") for name in ("serial", "procedure", "verdict")),
)  # fmt: skip
"""A run folder. `host` is the computer on which it lies; None where a version entered it that did not say."""

VALUE = Table(
    "measured_value", TABLES, Column("id", Integer, primary_key=True),
    Column("run_id", ForeignKey("run.id", ondelete="CASCADE"), nullable=False, index=True),
    Column("name", String(255), nullable=False, index=True), Column("value", Float), Column("std", Float),
    Column("calibration_std", Float, nullable=False), Column("unit", String(64), nullable=False), Column("low", Float),
    Column("high", Float), Column("relation", String(1), nullable=False), Column("verdict", String(16)),
)  # fmt: skip
"""A measured value of a run."""

CALIBRATION = Table(
    "calibration", TABLES, Column("id", Integer, primary_key=True),
    Column("run_id", ForeignKey("run.id", ondelete="CASCADE"), nullable=False, index=True),
    *(Column(name, Text, nullable=False) for name in ("channel", "instrument", "serial")),
    Column("date", Date), Column("due", Date),
    *(Column(name, Text, nullable=False) for name in ("reference", "uncertainty")),
)  # fmt: skip
"""A calibration that a run states."""

OF_CALIBRATION = ("channel", "instrument", "serial", "date", "due", "reference", "uncertainty")
