"""The report of a diagnosis: verdict, before and after, where, why, and what these data cannot show."""

from __future__ import annotations

from pathlib import Path

from hil.diagnose.diagnosis import Diagnosis
from hil.report.page import write_page


def write_diagnosis_report(diagnosis: Diagnosis, path: Path) -> None:
    """Write the page of a diagnosis.

    Raises:
        StorageError: it cannot be written.
    """
    write_page("diagnosis.html", path, kicker="Diagnosis", title=diagnosis.plant_title, diagnosis=diagnosis)
