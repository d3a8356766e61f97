"""Collect the results of a run from what its evaluation found."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

from hil.findings.curves import FUNCTION_KEYS, curves_of, mappings_of
from hil.findings.results import FittedFunction, Results, Value
from hil.record.measurement import Findings, Measured
from hil.record.plain import plain
from hil.record.recording import Recording

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
    )


def findings_of(results: Results) -> Findings:
    """The measured values, notes and deviations as an evaluation gave them; curves stay where they are."""
    given = {field.name for field in fields(Measured)}
    told = ({key: value for key, value in one if key in given} for one in results.values)
    measured = (Measured(**{**one, "unit": "" if one["unit"] == PURE else one["unit"]}) for one in told)
    return Findings(tuple(measured), {}, results.notes, results.deviations)


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
