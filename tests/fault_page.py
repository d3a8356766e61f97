"""Measure every combination of the fault matrix and write its section of the page of links.

python -m tests.fault_page
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests import faults_on_links, faults_simulated
from tests.faults import Case, Seen

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "links.md"
TITLE = "Faults at each moment"
HEAD = """\
<!-- Made by `python -m tests.fault_page` from what it measures; a test compares the cells with the cases. -->

{count} combinations of a fault, a moment and a link, each made to happen by a test
(`tests/scenario/test_faults_*.py`) and measured **at the device**. Cells are s from the fault until its output stood
at the safe value for good; "–" is where nobody can reach it. NOT SAFE is said where the outputs did not answer.

- *promised*: what the test asks for, in s. *status*: the exit status; −9 is a program that was killed.
- *lost*: samples that the device had given and the recording does not have, in the order of the columns. Every run
  folder could be read afterwards, up to its last block.
- A device that freezes its output and says that it obeys reads back safe: the interlock tells.
- Simulated DAQ: virtual time, blocks of {block_s:g} s, ramp of {ramp:g} %/s from 60 or 70 %.
- Links: wall-clock time, while it is driven; blocks 0.1 s, time-outs 0.1 … 0.2 s, the devices' own watchdogs 0.5 … 1
  s. Where the *program* is killed or hangs, those were off, except on CANopen, and the watchdog process
  ({watchdog_s:g} s) acted.
- "No answers", "garbled", "late", "restarts" concern what comes back: the device still hears. The second master wrote
  for 3 s; only an interlock surely notices it.
"""


@dataclass(frozen=True)
class Row:
    """A measured case, in words."""

    link: str
    fault: str
    moment: str
    after: str
    promised: str
    lost: str
    status: str
    message: str


def main() -> None:
    """Measure and write."""
    os.environ.setdefault("HIL_STATE_DIR", tempfile.mkdtemp())
    rows = [
        *_rows(faults_simulated.CASES, faults_simulated.measure),
        *_rows(faults_on_links.CASES, faults_on_links.measure),
    ]
    write_section(TITLE, section(rows))


def write_section(title: str, text: str) -> None:
    """Put another text below a heading of the page."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(f"\n## {title}\n")
    _, mark, after = rest.partition("\n## ")
    PAGE.write_text(f"{before}\n## {title}\n\n{text.strip()}\n{mark}{after}", encoding="utf-8")


def _rows(cases: list[Case], measure: object) -> Iterator[Row]:
    assert callable(measure)
    for case in cases:
        with tempfile.TemporaryDirectory() as folder:
            yield row(case, measure(case, Path(folder)), folder)


def row(case: Case, seen: Seen, folder: str) -> Row:
    """What was seen, in words."""
    return Row(
        case.link, case.fault, case.moment,
        "–" if seen.safe_after_s is None else f"{seen.safe_after_s:.3f}",
        "–" if case.within_s is None else f"{case.within_s:.3g}",
        "" if seen.lost is None else f"{seen.lost}", f"{seen.status}", seen.message.replace(f"{folder}/", ""),
    )  # fmt: skip


def section(rows: list[Row]) -> str:
    """Head and both tables: moments beside each other, then links."""
    simulated = [one for one in rows if one.link == rows[0].link]
    linked = [one for one in rows if one.link != rows[0].link]
    head = HEAD.format(
        count=len(rows), block_s=faults_simulated.BLOCK_S, ramp=faults_simulated.RAMP_PER_S,
        watchdog_s=faults_on_links.WATCHDOG_S,
    )  # fmt: skip
    return "\n".join([head, *_table(simulated, "moment"), "", *_table(linked, "link")])


def _table(rows: list[Row], across: str) -> Iterator[str]:
    columns = list(dict.fromkeys(getattr(one, across) for one in rows))
    titles = ["fault", *columns, "promised", "lost", "status"]
    yield f"| {' | '.join(titles)} |"
    yield "|" + "---|" * len(titles)
    for fault in dict.fromkeys(one.fault for one in rows):
        found = {getattr(one, across): one for one in rows if one.fault == fault}
        seen = [_cell(found[column]) if column in found else "" for column in columns]
        facts = (_each(getattr(one, name) for one in found.values()) for name in ("promised", "lost", "status"))
        yield f"| {' | '.join([fault, *seen, *facts])} |"


def _cell(one: Row) -> str:
    return f"{one.after} NOT SAFE" if "NOT SAFE" in one.message else one.after


def _each(values: Iterable[str]) -> str:
    """Every value once, in order."""
    return ", ".join(dict.fromkeys(value for value in values if value))


def cells(page: str) -> dict[str, str]:
    """The measured time of each case of the page, by the case in words."""
    found = {}
    part = page.partition(f"\n## {TITLE}\n")[2].partition("\n## ")[0]
    for table in re.findall(r"(?:^\|.*\n?)+", part, re.M):
        head, _, *rows = (line.strip("|").split("|") for line in table.strip().splitlines())
        columns = [one.strip() for one in head[1 : head.index(" promised ")]]
        for fault, *values in rows:
            for column, value in zip(columns, values, strict=False):
                if value.strip():
                    simulated = column in faults_simulated.MOMENTS
                    link, moment = ("simulated DAQ", column) if simulated else (column, "while it is driven")
                    found[f"{link}, {fault.strip()}, {moment}"] = value.strip()
    return found


if __name__ == "__main__":
    main()
