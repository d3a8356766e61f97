"""How long a search of a lab's archive takes: 100 000 runs of 2 000 units, on SQLite and on PostgreSQL.

    python benchmarks/archive.py [RUNS]

Every search is `hil.find_runs`: it looks for runs that have begun and were not entered (200 marks of such runs lie
there), opens the archive anew, as a command does, and hands over whole entries. The bar is 200 ms of wall time; beside
it stands the processor time of this process, which neighbours on the machine do not lengthen. PostgreSQL is a real
server of its own on loopback; without one installed its rows are left out, and the table says so.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import nullcontext
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import insert
from table import Row, milliseconds, show

from hil import api
from hil.archive.begun import mark_begun
from hil.archive.database import opened
from hil.archive.place import Place, archive_place
from hil.archive.tables import RUN, VALUE

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests.postgres import served, server_programs

RUNS = 100_000
UNITS, OPERATORS = 2_000, 12
PROCEDURES = ("flow_curve", "step_response", "frequency_response", "efc_acceptance", "multisine_response")
VALUES = ("rise", "overshoot", "bandwidth_3db", "gain", "hysteresis", "linearity", "dead_band_positive", "settling")
BATCH = 10_000
BEGUN = 200
REPEATS = 9
NOW = datetime(2026, 11, 25, 12, tzinfo=UTC)


def fill(place: Place, runs: int) -> None:
    """Runs spread over five years, as a lab would have them: some units often, most a few times."""
    rng = np.random.default_rng(1)
    verdicts = rng.choice([None, "pass", "fail", "cannot tell"], runs, p=[0.3, 0.6, 0.07, 0.03])
    units = np.floor(UNITS * rng.beta(1.0, 2.0, runs)).astype(int)
    ages_s = np.sort(rng.uniform(0.0, 5.0 * 365.0 * 86400.0, runs))[::-1]
    with opened(place) as engine:
        for first in range(0, runs, BATCH):
            ids = range(first, min(first + BATCH, runs))
            with engine.begin() as connection:
                connection.execute(insert(RUN), [
                    {"id": i + 1, "folder": f"/lab/runs/{i:06d}", "name": f"{i:06d}", "serial": f"SN-{units[i]:05d}",
                     "operator": f"op{i % OPERATORS}", "procedure": PROCEDURES[i % len(PROCEDURES)], "bench": "bench 3",
                     "started_utc": NOW - timedelta(seconds=float(ages_s[i])), "outcome": "completed",
                     "verdict": verdicts[i]} for i in ids
                ])  # fmt: skip
                connection.execute(insert(VALUE), [
                    {"run_id": i + 1, "name": name, "value": float(k + rng.normal()), "std": 0.1,
                     "calibration_std": 0.05, "unit": "ms", "low": None, "high": 9.0, "relation": "=",
                     "verdict": "pass"} for i in ids for k, name in enumerate(VALUES)
                ])  # fmt: skip


MONTH, WEEK = NOW - timedelta(days=30), NOW - timedelta(days=7)
SEARCHES: dict[str, dict[str, Any]] = {
    "one unit": {"serial": "SN-00100"},
    "one unit with its values, as a trend asks": {"serial": "SN-00100", "values": True},
    "failed in the last month": {"verdict": "fail", "since": MONTH},
    "one procedure in the last month": {"procedure": "flow_curve", "since": MONTH},
    "everything of the last week": {"since": WEEK},
    "every failed run of five years": {"verdict": "fail"},
}


def rows(archive: str) -> Iterator[Row]:
    for i in range(BEGUN):
        mark_begun(archive_place(archive), Path(f"/lab/runs/begun-{i}"))
    for name, asked in SEARCHES.items():
        search = partial(api.find_runs, archive=archive, **{"values": False, **asked})
        found = len(search())
        own = milliseconds(search, REPEATS)
        ms = milliseconds(search, REPEATS, time.perf_counter)
        yield Row(name, ms, f"{found} runs; {own:.0f} ms processor")


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    with tempfile.TemporaryDirectory(prefix="hil-archive-") as folder:
        os.environ["HIL_STATE_DIR"] = f"{folder}/state"
        fill(archive_place(folder), runs)
        show(f"search of an archive of {runs} runs, SQLite", rows(folder))
    programs = server_programs()
    with served(programs) if programs else nullcontext("") as url:
        if not url:
            print("\nPostgreSQL is not installed: its rows are left out")
            return
        fill(archive_place(url), runs)
        show(f"search of an archive of {runs} runs, PostgreSQL", rows(url))


if __name__ == "__main__":
    main()
