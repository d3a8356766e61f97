"""Collect the results of a run from what its evaluation found."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from hil.findings.curves import FUNCTION_KEYS, curves_of, mappings_of
from hil.findings.results import FittedFunction, Results
from hil.language.note import codes_of, revived
from hil.record.measurement import Findings, Measured, ending_of
from hil.record.plain import plain
from hil.record.population_comparison import PopulationComparison
from hil.record.recording import Recording
from hil.record.simulated import is_simulated

PURE = "1"  # unit of a pure number where data are handed on; where it is shown it has none


def results_of(recording: Recording, findings: Findings) -> Results:
    """Everything that the evaluation of a run found, as data."""
    meta = recording.meta
    return Results(
        run=recording.name.replace("\\", "/").rstrip("/").rsplit("/", 1)[-1],
        procedure=str(meta.get("procedure", "")),
        serial=_text(meta.get("valve", {}).get("serial")),
        operator=_text(meta.get("operator")),
        started_utc=meta.get("started_utc"),
        verdict=findings.verdict,
        values=tuple(map(_handed_on, findings.measured)),
        curves=curves_of(findings.curves),
        transfer_functions=functions_of(findings.curves),
        notes=findings.notes,
        deviations=findings.deviations,
        codes=codes_of((*findings.notes, *findings.deviations)),
        population=_each(findings.population, _handed_on),
        since=findings.since,
        cause=findings.cause,
        simulated=is_simulated(meta),
        ended=_text(ending_of(meta)),
    )


def findings_of(results: Results) -> Findings:
    """The measured values, notes and deviations as an evaluation gave them; curves stay where they are."""
    measured, population = tuple(map(_evaluated, results.values)), _each(results.population, _evaluated)
    notes, deviations = (revived(texts, results.codes) for texts in (results.notes, results.deviations))
    return Findings(measured, {}, notes, deviations, population, results.since, results.cause)


def _handed_on(found: Measured) -> Measured:
    return replace(
        found, value=_number(found.value), std=_number(found.std), unit=found.unit or PURE, low=_number(found.low),
        high=_number(found.high),
    )  # fmt: skip


def _evaluated(found: Measured) -> Measured:
    return replace(found, unit="" if found.unit == PURE else found.unit)


def _each(found: PopulationComparison | None, as_wanted: Callable[[Measured], Measured]) -> PopulationComparison | None:
    return None if found is None else replace(found, figures=tuple(map(as_wanted, found.figures)))


def functions_of(curves: Mapping[str, Any]) -> tuple[FittedFunction, ...]:
    """Every fitted transfer function in `Findings.curves`."""
    fields = FittedFunction.model_fields.keys() - {"name"}
    return tuple(
        FittedFunction(name=name, **{key: plain(mapping[key]) for key in fields & mapping.keys()})
        for name, mapping in mappings_of(curves)
        if all(mapping.get(key) is not None for key in FUNCTION_KEYS)
    )


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _text(value: Any) -> str | None:
    return str(value) if value else None
