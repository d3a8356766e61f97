"""Many units in one call give the same results bit for bit, on this machine's cores and on a Dask cluster."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hil.physics.model import save_model
from hil.physics.simulate import ActiveEffect
from hil.record.read import write_recording
from tests.concealed import nominal, records

CLUSTER = """
import json, subprocess, sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
        done = subprocess.run([sys.executable, "-m", "hil", *sys.argv[1:], "--scheduler", cluster.scheduler_address])
    sys.exit(done.returncode)
"""


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    made = []
    for name, effects in (("good", ()), ("worn", (ActiveEffect("backlash", "opening", {"half_width": 2.0}),))):
        folder = tmp_path_factory.mktemp(name)
        save_model(nominal(), folder / "nominal.json")
        for each in records(effects, seed=30)[:2]:
            write_recording(each, folder / f"{each.name}.csv")
        made.append(folder)
    return made


def answers(out: Path, units: list[Path]) -> list[Any]:
    found = []
    for unit in units:
        diagnosis = json.loads((out / unit.name / "diagnosis.json").read_text())
        corrected = json.loads((out / unit.name / "corrected.json").read_text())
        found.append(({**diagnosis, "seconds": 0}, corrected))
    return found


def test_a_cluster_and_this_machine_agree_bit_for_bit(units: list[Path], tmp_path: Path) -> None:
    chosen = [argument for unit in units for argument in ("--fleet", str(unit))]
    here, there = tmp_path / "here", tmp_path / "there"
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    subprocess.run([sys.executable, "-m", "hil", "diagnose", *chosen, "--out", str(here)], check=True)
    subprocess.run([sys.executable, str(script), "diagnose", *chosen, "--out", str(there)], check=True)
    verdicts = [diagnosis["verdict"] for diagnosis, _ in answers(here, units)]
    assert verdicts == ["consistent", "explained"]
    assert answers(here, units) == answers(there, units)


def test_a_scheduler_that_is_not_there_is_said(units: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    from hil.errors import InputError
    from hil.session import fleet

    monkeypatch.setattr(fleet, "_PATIENCE_S", 1)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        list(fleet.diagnose_units([fleet.read_unit(units[0], None)], "tcp://127.0.0.1:9"))
