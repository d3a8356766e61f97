"""The tables of the index. What they hold stands in the run folders too."""

from __future__ import annotations

import datetime as dt
from datetime import UTC, datetime

from sqlalchemy import DateTime, Dialect, ForeignKey, Index, String, Text, TypeDecorator
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column, relationship


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


class Base(DeclarativeBase):
    """All tables of the index."""


class RunRow(Base):
    """A run folder. `host` is the computer on which it lies; None where a version entered it that did not say."""

    __tablename__ = "run"

    id: Mapped[int] = mapped_column(primary_key=True)
    host: Mapped[str | None] = mapped_column(String(255))
    folder: Mapped[str] = mapped_column(Text)
    name: Mapped[str] = mapped_column(String(255))
    serial: Mapped[str] = mapped_column(String(255))
    operator: Mapped[str] = mapped_column(String(255))
    procedure: Mapped[str] = mapped_column(String(255))
    bench: Mapped[str] = mapped_column(String(255))
    started_utc: Mapped[datetime] = mapped_column(Utc)
    outcome: Mapped[str] = mapped_column(Text)
    verdict: Mapped[str | None] = mapped_column(String(16))
    instruments: Mapped[str | None] = mapped_column(String(64))
    simulated: Mapped[bool | None]
    values: Mapped[list[ValueRow]] = relationship(back_populates="run", cascade="all, delete-orphan")
    calibrations: Mapped[list[CalibrationRow]] = relationship(back_populates="run", cascade="all, delete-orphan")

    __table_args__ = (
        Index("run_by_serial", "serial", "started_utc"),
        Index("run_by_procedure", "procedure", "started_utc"),
        Index("run_by_verdict", "verdict", "started_utc"),
        Index("run_by_start", "started_utc"),
    )


class ValueRow(Base):
    """A measured value of a run."""

    __tablename__ = "measured_value"

    id: Mapped[int] = mapped_column(primary_key=True)
    run_id: Mapped[int] = mapped_column(ForeignKey("run.id", ondelete="CASCADE"), index=True)
    name: Mapped[str] = mapped_column(String(255), index=True)
    value: Mapped[float | None]
    std: Mapped[float | None]
    calibration_std: Mapped[float]
    unit: Mapped[str] = mapped_column(String(64))
    low: Mapped[float | None]
    high: Mapped[float | None]
    relation: Mapped[str] = mapped_column(String(1))
    verdict: Mapped[str | None] = mapped_column(String(16))
    run: Mapped[RunRow] = relationship(back_populates="values")


class CalibrationRow(Base):
    """A calibration that a run states."""

    __tablename__ = "calibration"

    id: Mapped[int] = mapped_column(primary_key=True)
    run_id: Mapped[int] = mapped_column(ForeignKey("run.id", ondelete="CASCADE"), index=True)
    channel: Mapped[str] = mapped_column(Text)
    instrument: Mapped[str] = mapped_column(Text)
    serial: Mapped[str] = mapped_column(Text)
    date: Mapped[dt.date | None]
    due: Mapped[dt.date | None]
    reference: Mapped[str] = mapped_column(Text)
    uncertainty: Mapped[str] = mapped_column(Text)
    run: Mapped[RunRow] = relationship(back_populates="calibrations")


OF_CALIBRATION = ("channel", "instrument", "serial", "date", "due", "reference", "uncertainty")
