"""How a run ended."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from hil.errors import StorageError
from hil.record.durable import write_whole
from hil.record.measurement import FINDINGS_FILE, Findings, is_accepted

REPORT_FILE = "report.html"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run left behind: its folder, what was found in it, the report, and whether it was simulated."""

    folder: Path
    findings: Findings
    report: Path
    simulated: bool = False

    @property
    def exit_status(self) -> int:
        """1 when a limit was missed or nobody can tell whether it is met, else 0."""
        return 0 if is_accepted(self.findings.verdict) else 1


def write_findings(findings: Findings, folder: Path) -> None:
    """Write the measured values beside the samples.

    Raises:
        StorageError: they cannot be written.
    """
    path = folder / FINDINGS_FILE
    try:
        write_whole(path, json.dumps(findings.as_dict(), indent=1, ensure_ascii=False) + "\n")
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror}; the samples are kept") from error
