"""The acceptance bench of the EFC with changes, for tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.physics.published.efc_population import SETS
from hil.record.measurement import Findings
from hil.session.outcome import Outcome
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure

BENCH = benches()["cummins-efc-acceptance"].read_text(encoding="utf-8")
STUCK = {"pressure = { noise = 0.5 }": "pressure = { value = 60.0, noise = 0.01 }"}
_NEW = '{ name = "friction", parameters = { coulomb = 0.001 } }'
_WORLD = f"[simulation]\nseed = 1\neffects = [{_NEW}]\n"


def valve(parameters: str = "", effects: str = _NEW) -> dict[str, str]:
    """Changes of the bench's text that put another valve on it."""
    return {_WORLD: f"[simulation]\nseed = 1\nparameters = {{ {parameters} }}\neffects = [{effects}]\n"}


def friction(coulomb_a: float, stiction: float = 1.2) -> str:
    """An effect as a bench file has it."""
    return f'{{ name = "friction", parameters = {{ coulomb = {coulomb_a}, stiction = {stiction} }} }}'


def published(name: str) -> dict[str, str]:
    """Changes that put a set of the thesis on the bench: `good`, `prototype` or `return`."""
    one = SETS[name]
    parameters = {"rotor_frequency": one.rotor_frequency, "rotor_damping": one.rotor_damping,
                  "leakage": one.leakage_ml_min}  # fmt: skip
    text = ", ".join(f"{key} = {value}" for key, value in parameters.items())
    return valve(text, f'{{ name = "friction", parameters = {{ coulomb = {one.friction_a} }} }}')


def outcome(folder: Path, procedure: str, changes: Mapping[str, str] | None = None, **settings: object) -> Outcome:
    """A run on the bench with pieces of its text replaced; it is recorded in `folder`/run."""
    folder.mkdir(exist_ok=True)
    text = BENCH
    for old, new in (changes or {}).items():
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return run_procedure(load_procedure(procedure), read_bench(path), settings, folder / "run")


def value(findings: Findings, name: str) -> float | None:
    """A measured value by its name."""
    (found,) = (m for m in findings.measured if m.name == name)
    return found.value


def failed(findings: Findings) -> set[str]:
    """Names of what failed."""
    return {m.name for m in findings.measured if m.verdict == "fail"}
