"""Frequency responses of a run as tables: written beside its samples, and taken from there to be identified."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError, option
from hil.record.measurement import Findings
from hil.record.recording import Recording
from hil.record.simulated import SIMULATED, is_simulated
from hil.record.table.response_table import ResponseTable, write_response_table
from hil.session.procedure import load_procedure
from hil.session.sample_sensitivity import measured_findings

_KINDS = {"sine", "multisine"}
_FILE = "frequency_response"


def response_tables(findings: Findings, name: str) -> dict[str, ResponseTable]:
    """Every frequency response of findings, by its label (see docs/reference/procedures.md, `responses`)."""
    found = findings.curves.get("responses", ())
    return {entry["label"]: _table(f"{name}, {entry['label']}", entry) for entry in found if _is_response(entry)}


def write_responses(findings: Findings, folder: Path) -> list[Path]:
    """Write every frequency response of findings as CSV into the run folder.

    Raises:
        StorageError: one cannot be written.
    """
    written = []
    for label, table in response_tables(findings, folder.name).items():
        path = folder / f"{_FILE} {re.sub(r'[^0-9A-Za-z.+-]+', ' ', label).strip()}.csv"
        write_response_table(table, path)
        written.append(path)
    return written


def measured_responses(run: Recording, inputs: Sequence[str], output: str) -> bool:
    """Whether a run measured frequency responses, of these channels where they are named."""
    roles, kinds = run.meta.get("roles", {}), {part.get("kind") for part in run.meta.get("parts", ())}
    named = ((output, "response"), (inputs[0] if inputs else "", "command"))
    return bool(run.meta.get("procedure") and kinds & _KINDS) and all(n in ("", roles.get(role)) for n, role in named)


def response_of_run(run: Recording, part: str) -> ResponseTable:
    """The frequency response of a run, as its procedure measured it; the one called `part` where there are several.

    Raises:
        FileError: there is none of that name, or none was named where there are several; says which there are.
    """
    found = responses_of_run(run)
    if part in found:
        return found[part]
    if part or len(found) != 1:
        names = ", ".join(f"'{label}'" for label in found) or "none"
        raise FileError(
            f"{run.name}: the run measured {len(found)} frequency responses, {names}; a transfer function describes "
            f"one amplitude about one bias: name it with {option('part')}"
        )
    return next(iter(found.values()))


def responses_of_run(run: Recording) -> dict[str, ResponseTable]:
    """Every frequency response of a run as it was recorded, by its label, as its procedure measured it."""
    procedure = load_procedure(str(run.meta["procedure"]))
    found = response_tables(measured_findings(procedure.evaluate, run), run.name)
    origin = {SIMULATED: is_simulated(run.meta)}
    meta = {
        **origin,
        "roles": run.meta.get("roles", {}),
        "assumed": ["the frequency response as its procedure measured it"],
    }
    return {label: replace(table, meta=meta) for label, table in found.items()}


def _is_response(entry: Any) -> bool:
    return isinstance(entry, Mapping) and {"label", "frequency_hz", "gain", "phase_deg"} <= entry.keys()


def _table(name: str, entry: Mapping[str, Any]) -> ResponseTable:
    gain = np.asarray(entry["gain"], dtype=np.float64)
    phase_rad = np.radians(np.asarray(entry["phase_deg"], dtype=np.float64))
    above, below = (str(entry.get(key) or "1") for key in ("response_unit", "command_unit"))
    unit = above if below == "1" else f"{above}/{below}"
    stds = [entry.get("gain_std"), entry.get("phase_std_deg")]
    known = all(std is not None and np.isfinite(np.asarray(std, dtype=np.float64)).all() for std in stds)
    response = np.asarray(gain * np.exp(1j * phase_rad), dtype=np.complex128)
    return ResponseTable(
        name, np.asarray(entry["frequency_hz"], dtype=np.float64), response, unit,
        gain_std=np.asarray(stds[0], dtype=np.float64) / gain if known else None,
        phase_std_rad=np.radians(np.asarray(stds[1], dtype=np.float64)) if known else None,
    )  # fmt: skip
