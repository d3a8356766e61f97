"""Collect the results of a run from what its evaluation found."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

from hil.findings.curves import FUNCTION_KEYS, curves_of, mappings_of
from hil.findings.results import FittedFunction, MovedOf, PopulationComparisonOf, Results, SinceOf, Value
from hil.record.measurement import Findings, Measured
from hil.record.plain import plain
from hil.record.population_comparison import PopulationComparison
from hil.record.recording import Recording
from hil.record.simulated import is_simulated
from hil.record.since import Since

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
        values=tuple(_value(found) for found in findings.measured),
        curves=curves_of(findings.curves),
        transfer_functions=functions_of(findings.curves),
        notes=findings.notes,
        deviations=findings.deviations,
        likeness=_population(findings.likeness),
        since=_since(findings.since),
        cause=findings.cause,
        simulated=is_simulated(meta),
    )


def findings_of(results: Results) -> Findings:
    """The measured values, notes and deviations as an evaluation gave them; curves stay where they are."""
    measured = tuple(measured_of(one) for one in results.values)
    population, since = _population_of(results.likeness), _since_of(results.since)
    return Findings(measured, {}, results.notes, results.deviations, population, since, results.cause)


def measured_of(found: Value) -> Measured:
    """A value as its evaluation gave it."""
    given = {field.name for field in fields(Measured)}
    named = {key: value for key, value in found if key in given}
    return Measured(**{**named, "unit": "" if found.unit == PURE else found.unit})


def _population(found: PopulationComparison | None) -> PopulationComparisonOf | None:
    if found is None:
        return None
    return PopulationComparisonOf(
        figures=tuple(_value(m) for m in found.figures), good_units=found.good_units, beyond=found.beyond,
        reason=found.reason,
    )  # fmt: skip


def _population_of(found: PopulationComparisonOf | None) -> PopulationComparison | None:
    if found is None:
        return None
    return PopulationComparison(
        tuple(measured_of(one) for one in found.figures), found.good_units, found.beyond, found.reason
    )


def _since(found: Since | None) -> SinceOf | None:
    if found is None:
        return None
    moved = tuple(MovedOf(then=_value(then), now=_value(now)) for then, now in found.moved)
    return SinceOf(**{**_plain_of(found), "moved": moved})


def _since_of(found: SinceOf | None) -> Since | None:
    if found is None:
        return None
    moved = tuple((measured_of(one.then), measured_of(one.now)) for one in found.moved)
    return Since(**{**dict(found), "moved": moved})


def _plain_of(found: Since) -> dict[str, Any]:
    return {field.name: getattr(found, field.name) for field in fields(Since)}


def _value(found: Measured) -> Value:
    return Value(
        name=found.name, value=_number(found.value), std=_number(found.std), unit=found.unit or PURE,
        low=_number(found.low), high=_number(found.high), verdict=found.verdict, relation=found.relation,
        meaning=found.meaning, calibration_std=found.calibration_std,
    )  # fmt: skip


def functions_of(curves: Mapping[str, Any]) -> tuple[FittedFunction, ...]:
    """Every fitted transfer function in `Findings.curves`."""
    return tuple(_functions(curves))


def _functions(curves: Mapping[str, Any]) -> Iterator[FittedFunction]:
    for name, mapping in mappings_of(curves):
        if all(mapping.get(key) is not None for key in FUNCTION_KEYS):
            yield FittedFunction(name=name, **{key: plain(mapping[key]) for key in _fields() if key in mapping})


def _fields() -> list[str]:
    return [name for name in FittedFunction.model_fields if name != "name"]


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _text(value: Any) -> str | None:
    return str(value) if value else None
