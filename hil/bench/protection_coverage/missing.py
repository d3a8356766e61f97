"""Every protection that a bench lacks, in one list."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator, Sequence

from hil.bench.protection_coverage.calibration import dated_ahead, overdue_today, undated
from hil.bench.protection_coverage.channels import live_zeros, without_interlocks, without_limits
from hil.bench.protection_coverage.devices import (
    no_watchdog,
    no_watchdog_process,
    not_read_back,
    open_to_others,
    untried_transport,
    watchdog_not_safe,
    watchdog_off,
)
from hil.bench.protection_coverage.packages import packages_lacking
from hil.bench.protection_coverage.times import too_hasty
from hil.bench.read import BenchFile
from hil.record.conditions import oil_contradiction

Rule = Callable[[BenchFile, dt.date], Iterator[str]]


def contradicting_oil(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Conditions of which one is wrong."""
    if contradiction := oil_contradiction(file.bench.conditions.model_dump(), {}):
        yield f"[conditions]: {contradiction} Say fluid and viscosity_class of the oil that is in the bench"


def _packages(file: BenchFile, _day: dt.date) -> Iterator[str]:
    yield from packages_lacking(file)


RULES: Sequence[Rule] = (
    _packages, watchdog_off, no_watchdog, watchdog_not_safe, not_read_back, no_watchdog_process, too_hasty,
    untried_transport, open_to_others, without_interlocks, live_zeros, without_limits, undated, dated_ahead,
    overdue_today, contradicting_oil,
)  # fmt: skip


def missing_protection(file: BenchFile, today: dt.date) -> list[str]:
    """What a bench without faults still lacks, a sentence each with its remedy; `today` judges calibrations."""
    return [text for rule in RULES for text in rule(file, today)]
