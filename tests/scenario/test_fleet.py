"""Many units in one call give the same results bit for bit: here, in a process of their own, on a Dask cluster."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hil.errors import InputError
from hil.physics.model import save_model
from hil.physics.simulate import ActiveEffect
from hil.record.read import write_recording
from hil.session import fleet
from hil.session.fleet import UnitAnswer, diagnose_unit, diagnosed_fleet, read_unit
from tests.concealed import nominal, records

CLUSTER = """
import json, subprocess, sys
from distributed import LocalCluster
if __name__ == "__main__":
    one = {"n_workers": 1, "threads_per_worker": 1, "processes": False}  # this process is the worker
    with LocalCluster(**one, protocol="tcp://", dashboard_address=None, host="127.0.0.1") as cluster:
        command = [sys.executable, "-m", "hil", *sys.argv[2:], "--scheduler", cluster.scheduler_address]
        done = subprocess.run(command, cwd=sys.argv[1])
    sys.exit(done.returncode)
"""


FILES = ("diagnosis", "corrected")
ORIGIN: dict[str, object] = {"simulated": False, "other_plant": []}  # what the file says of CSV, which says nothing


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    made = []
    for name, effects in (("good", ()), ("worn", (ActiveEffect("backlash", "opening", {"half_width": 2.0}),))):
        folder = tmp_path_factory.mktemp(name)
        save_model(nominal(), folder / "nominal.json")
        for each in records(effects, seed=30)[:1]:
            write_recording(each, folder / f"{each.name}.csv")
        made.append(folder)
    return made


def answer(of: UnitAnswer) -> tuple[dict[str, Any], dict[str, Any]]:
    """The diagnosis and the corrected model, as their files hold them."""
    found = of.diagnosed
    assert found is not None
    diagnosis, corrected = {**found.diagnosis.as_dict(), "seconds": 0, **ORIGIN}, found.corrected.as_dict()
    return json.loads(json.dumps(diagnosis)), json.loads(json.dumps(corrected))


def test_a_cluster_another_process_and_this_one_agree_bit_for_bit(units, tmp_path, monkeypatch):
    out, script = tmp_path / "out", tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    seen, unseen = units[0], Path(units[1].name)  # which for the worker, in another place, is not there
    chosen = [argument for unit in (seen, unseen) for argument in ("--fleet", str(unit))]
    command = [sys.executable, str(script), str(units[1].parent), "diagnose", *chosen, "--out", str(out)]
    subprocess.run(command, check=True, cwd=tmp_path)
    cluster = []
    for unit in units:
        diagnosis, corrected = (json.loads((out / unit.name / f"{n}.json").read_text()) for n in FILES)
        cluster.append(({**diagnosis, "seconds": 0}, corrected))
    monkeypatch.chdir(units[1].parent)
    assert [diagnosis["verdict"] for diagnosis, _ in cluster] == ["consistent", "explained"]
    (elsewhere,) = diagnosed_fleet([seen])
    assert [answer(elsewhere), answer(diagnose_unit(read_unit(unseen, None)))] == cluster


def test_a_scheduler_that_is_not_there_is_said(units, monkeypatch):
    monkeypatch.setattr(fleet, "_PATIENCE_S", 1)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        diagnosed_fleet([units[0]], scheduler="tcp://127.0.0.1:9")


@pytest.mark.parametrize(("name", "said"), [("nowhere", "no such folder"), ("empty", "no recordings")])
def test_a_folder_that_holds_no_unit_is_told_before_any_is_asked(tmp_path, units, name, said):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=f"{name}: {said}"):
        diagnosed_fleet([units[0], tmp_path / name])
