"""The tables of the index. What they hold stands in the run folders too."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    Boolean,
    Column,
    Date,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Integer,
    MetaData,
    String,
    Table,
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
OF_RUN = (
    "host", "serial", "operator", "procedure", "bench", "started_utc", "outcome", "verdict", "instruments", "simulated",
)  # fmt: skip
OF_VALUE = ("name", "value", "std", "calibration_std", "unit", "low", "high", "relation", "verdict")
OF_CALIBRATION = ("channel", "instrument", "serial", "date", "due", "reference", "uncertainty")
_TYPES = {
    "started_utc": Utc, "simulated": Boolean, **dict.fromkeys(("date", "due"), Date),
    **dict.fromkeys(("value", "std", "calibration_std", "low", "high"), Float),
}  # fmt: skip


def _table(name: str, names: Sequence[str], *keys: Column[Any]) -> Table:
    """A table as queries need it; sizes, rules and indices stand in the migrations."""
    columns: list[Column[Any]] = [Column(column, _TYPES.get(column, String)) for column in names]
    return Table(name, TABLES, Column("id", Integer, primary_key=True), *keys, *columns)


def _of_run() -> Column[Any]:
    return Column("run_id", ForeignKey("run.id"))


RUN = _table("run", ("folder", "name", *OF_RUN))
"""A run folder. `host` is the computer on which it lies; None where a version entered it that did not say."""

VALUE = _table("measured_value", OF_VALUE, _of_run())
"""A measured value of a run."""

CALIBRATION = _table("calibration", OF_CALIBRATION, _of_run())
"""A calibration that a run states."""
