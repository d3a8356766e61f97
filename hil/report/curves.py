"""Sections of a page for the curves of a procedure: a known name has its own, any other a plain one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from hil.record.measurement import Findings
from hil.record.recording import Recording
from hil.report.overview import overview
from hil.report.plain_curve import plain_section
from hil.report.section import Section

SECTIONS: Mapping[str, Callable[[str, Any, Recording], Section]] = {}


def sections(recording: Recording, findings: Findings) -> list[Section]:
    """A section for each curve, then the recording as a whole."""
    found = [SECTIONS.get(name, plain_section)(name, curve, recording) for name, curve in findings.curves.items()]
    return [*(section for section in found if not section.empty), *overview(recording)]
