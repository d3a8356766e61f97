"""Measure every combination of the fault matrix and write the page of the documentation.

python -m tests.fault_page
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests import faults_on_links, faults_simulated
from tests.faults import Case, Seen

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "fault-matrix.md"
HEAD = """\
# Fault matrix

<!-- Made by `python -m tests.fault_page` from what it measures; a test compares the rows with the cases. -->

What happens when something fails while a valve is driven: {count} combinations of a fault, a moment and a link, each
made to happen by a test (`tests/scenario/test_faults_*.py`) and measured **at the device**: what counts is when its
output stood at the safe value for good, not when the program thought so. Devices are simulated ones that speak the real
protocols; nothing here was measured on hardware.

- *safe after*: from the fault to the safe output. In virtual time for the simulated DAQ (blocks of {block_s:g} s, ramp
  of {ramp:g} %/s from 60 or 70 %), in wall-clock time on the links. *promised* is what the test asks for. “–” is where
  nobody can reach the output: the message says NOT SAFE, the exit status is 3, and only an emergency stop, the device
  itself or the watchdog process helps, once it can be reached again. −9 is a program that was killed.
- “No answers”, “garbled”, “late”, “restarts” concern what comes back: the device still hears, and outputs are told to
  be safe without waiting for an answer. “Cable pulled” is where nothing gets through: there its own watchdog acts.
- *lost*: samples that the device had given and the recording does not have, where they can be counted. Samples for
  which the disk has no room cannot be recorded.
- What is said of outputs, and the exit status, follow from what the device answered when it was asked
  ([safety](../explanation/safety.md#what-is-known-of-an-output)). A device that freezes its output and says that it
  obeys reads back safe: the interlock tells.
- In every case the run folder could be read afterwards, up to its last block, where there was one.
- On the links, blocks are 0.1 s, time-outs 0.1 … 0.2 s and the devices' own watchdogs 0.5 … 1 s. Where the *program* is
  killed or hangs, the devices' own watchdogs were off, except on CANopen, and the watchdog process ({watchdog_s:g} s)
  acted.
- The second master wrote for 3 s; nothing but an interlock notices it surely, and nobody wins against it.
"""


def main() -> None:
    """Measure and write."""
    os.environ.setdefault("HIL_STATE_DIR", tempfile.mkdtemp())
    rows = [
        *_rows(faults_simulated.CASES, faults_simulated.measure),
        *_rows(faults_on_links.CASES, faults_on_links.measure),
    ]
    head = HEAD.format(
        count=len(rows), block_s=faults_simulated.BLOCK_S, ramp=faults_simulated.RAMP_PER_S,
        watchdog_s=faults_on_links.WATCHDOG_S,
    )  # fmt: skip
    table = ["| link | fault | moment | safe after [s] | promised [s] | lost | exit status | what is said |",
             "|---|---|---|---|---|---|---|---|"]  # fmt: skip
    PAGE.write_text("\n".join([head, *table, *rows]) + "\n", encoding="utf-8")


def _rows(cases: list[Case], measure: object) -> Iterator[str]:
    assert callable(measure)
    for case in cases:
        with tempfile.TemporaryDirectory() as folder:
            yield row(case, measure(case, Path(folder)), folder)


def row(case: Case, seen: Seen, folder: str) -> str:
    """A row of the table."""
    after = "–" if seen.safe_after_s is None else f"{seen.safe_after_s:.3f}"
    promised = "–" if case.within_s is None else f"{case.within_s:.3g}"
    lost = "" if seen.lost is None else f"{seen.lost}"
    message = seen.message.replace(f"{folder}/", "").replace("|", "\\|")
    return f"| {case.link} | {case.fault} | {case.moment} | {after} | {promised} | {lost} | {seen.status} | {message} |"


if __name__ == "__main__":
    main()
