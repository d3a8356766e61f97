"""How a run ended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hil.record.measurement import Findings, is_accepted

REPORT_FILE = "report.html"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run left behind: its folder, what was found in it, the report, and whether it was simulated.

    `ended`: what kept it from ending as planned; empty for one that did.
    """

    folder: Path
    findings: Findings
    report: Path
    simulated: bool = False
    ended: str = ""

    @property
    def exit_status(self) -> int:
        """1 when a limit was missed or nobody can tell whether it is met, else 0."""
        return 0 if is_accepted(self.findings.verdict) else 1
