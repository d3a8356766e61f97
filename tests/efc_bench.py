"""The acceptance bench of the EFC with changes, for tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hil.bench.read import read_bench
from hil.physics.published.efc_population import SETS
from hil.record.measurement import Findings, Measured
from hil.session.outcome import Outcome
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure
from tests.bench_files import bench_file

STUCK = {"simulation": {"instruments": {"pressure": {"value": 60.0, "noise": 0.01}}}}


def friction(coulomb_a: float, stiction: float = 1.2) -> dict[str, Any]:
    """An effect as a bench file has it."""
    return {"name": "friction", "parameters": {"coulomb": coulomb_a, "stiction": stiction}}


def valve(effect: Mapping[str, Any] = friction(0.001), **parameters: float) -> dict[str, Any]:
    """Changes of the bench that put another valve on it."""
    return {"simulation": {"parameters": parameters, "effects": [effect]}}


def published(name: str) -> dict[str, Any]:
    """Changes that put a set of the thesis on the bench: `good`, `prototype` or `return`."""
    one = SETS[name]
    return valve(friction(one.friction_a), rotor_frequency=one.rotor_frequency, rotor_damping=one.rotor_damping,
                 leakage=one.leakage_ml_min)  # fmt: skip


def outcome(folder: Path, procedure: str, changes: Mapping[str, Any] | None = None, **settings: object) -> Outcome:
    """A run on the bench with other values; it is recorded in `folder`/run."""
    path = bench_file(folder / "bench.toml", "cummins-efc-acceptance", **(changes or {}))
    return run_procedure(load_procedure(procedure), read_bench(path), settings, folder / "run")


def named(findings: Findings, name: str) -> Measured:
    """A measured quantity by its name."""
    (found,) = (m for m in findings.measured if m.name == name)
    return found


def value(findings: Findings, name: str) -> float | None:
    """A measured value by its name."""
    return named(findings, name).value


def failed(findings: Findings) -> set[str]:
    """Names of what failed."""
    return {m.name for m in findings.measured if m.verdict == "fail"}
