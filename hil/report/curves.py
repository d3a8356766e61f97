"""Sections of a page for the curves of a procedure: a known name has its own, any other a plain one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from hil.record.measurement import Findings
from hil.record.recording import Recording
from hil.report import characteristics, flow_curves, large_sines, motions, responses, steps
from hil.report.overview import overview
from hil.report.plain_curve import plain_section
from hil.report.section import Section


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of curve (docs/reference/procedures.md): the keys it cannot do without, and its section.

    `several`: whether it is a list of mappings.
    """

    needed: tuple[str, ...]
    section: Callable[[Any], Section]
    several: bool = True

    def suits(self, curve: Any) -> bool:
        """Whether the curve has the shape of this kind; a stranger may use the name for something else."""
        entries = curve if self.several else [curve]
        return (
            isinstance(entries, list | tuple)
            and len(entries) > 0
            and all(isinstance(e, Mapping) and all(e.get(key) is not None for key in self.needed) for e in entries)
        )


KINDS: Mapping[str, Kind] = {
    "responses": Kind(responses.NEEDED, responses.responses_section),
    "flow_curve": Kind(flow_curves.NEEDED, flow_curves.flow_curve_section, several=False),
    "steps": Kind(steps.NEEDED, steps.steps_section),
    "large_sines": Kind(large_sines.NEEDED, large_sines.large_sines_section),
    "velocity_steps": Kind(motions.STEPS_NEEDED, motions.velocity_steps_section),
    "threshold": Kind(motions.THRESHOLD_NEEDED, motions.threshold_section),
    "trend": Kind(motions.TREND_NEEDED, motions.trend_section),
    "pressure_gain": Kind(characteristics.BRANCHES_NEEDED, characteristics.pressure_gain_section),
    "internal_leakage": Kind(characteristics.LEVELS_NEEDED, characteristics.internal_leakage_section),
    "flow_over_pressure_drop": Kind(characteristics.DROPS_NEEDED, characteristics.flow_over_pressure_drop_section),
    "limiting_power": Kind(characteristics.DROPS_NEEDED, characteristics.limiting_power_section),
    "load_step": Kind(characteristics.ANSWERS_NEEDED, characteristics.load_step_section),
    "null_shift": Kind(characteristics.CONDITIONS_NEEDED, characteristics.null_shift_section),
    "drift": Kind(motions.DRIFT_NEEDED, motions.drift_section),
}


def sections(recording: Recording, findings: Findings) -> list[Section]:
    """A section for each curve, then the recording as a whole."""
    found = [_section(name, curve) for name, curve in findings.curves.items()]
    return [*(section for section in found if not section.empty), *overview(recording)]


def _section(name: str, curve: Any) -> Section:
    kind = KINDS.get(name)
    return kind.section(curve) if kind is not None and kind.suits(curve) else plain_section(name, curve)
