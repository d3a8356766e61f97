"""Nothing is imported or compiled while a procedure drives: it would hold the program while a valve is open."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.driven_imports import HEAVY

WATCHER = Path(__file__).parents[1] / "driven_imports.py"
QUICK = "frequency_response brevini-hpv41 frequencies=0.5,1,2,4 amplitudes=4 measure_s=1 biases=60"
ALL = [
    "flow_curve brevini-hpv41 cycle_s=12",
    "multisine_response brevini-hpv41 low_hz=0.5 high_hz=4.5 base_hz=0.5 amplitudes=4 periods=3 biases=60",
    "step_response brevini-hpv41 levels=40,80",
    "large_sine brevini-hpv41 frequencies=0.5 cycles=1",
    "fail_safe brevini-hpv41 repeats=2",
    "endurance brevini-hpv41 cycles=12 keep_every=3",
    "iso_10770_1 brevini-hpv41 cycle_s=12 amplitudes=4 biases=60",
    "bench_reference brevini-hpv41 cycle_s=12",
    "coil_by_hand brevini-hpv41 cold=7.2 instrument=meter",
    "jog brevini-hpv41 value=20",
    "threshold brevini-hpv41 speed=1 reach=2",
    "pressure_gain four-way-lab",
    "internal_leakage four-way-lab",
    "flow_over_pressure_drop four-way-lab",
    "limiting_power four-way-lab",
    "null_shift four-way-lab",
    "load_step four-way-lab",
    "proof_pressure four-way-lab hold_s=2",
    "efc_acceptance cummins-efc-acceptance",
    "efc_frequency_response cummins-efc",
    "efc_step_response cummins-efc",
    "leakage_check cummins-efc-acceptance",
    "pressure_current cummins-efc",
    "electrical_check cummins-efc-acceptance",
    "cylinder_drift hydraforce-open-loop",
    "velocity_steps hydraforce-open-loop",
    "sine_position hydraforce-open-loop frequency_rad_s=8",
]


PRELOADED = f"""
import json, sys
from hil.session.preload import preload
from hil.session.procedure import load_procedure
for name in sys.argv[1:]:
    preload(load_procedure(name).run)
print(json.dumps([name for name in {(*HEAVY, "can", "serial")} if name in sys.modules]))
"""


@pytest.mark.parametrize("case", [QUICK, *(pytest.param(case, marks=pytest.mark.slow) for case in ALL)])
def test_everything_is_there_before_the_first_output_moves(case):
    told = subprocess.run([sys.executable, str(WATCHER), *case.split()], capture_output=True, text=True, check=True)
    seen = json.loads(told.stdout)
    assert seen["imported"] == [] and seen["compiled"] == []
    assert seen["kernels"][0] == seen["kernels"][1]
    assert seen["heavy"] == []


def test_what_no_procedure_needs_is_not_there_before_it_drives():
    """All procedures at once, in a process of their own: what each adds is seconds before each run."""
    names = sorted({case.split()[0] for case in (QUICK, *ALL)})
    told = subprocess.run([sys.executable, "-c", PRELOADED, *names], capture_output=True, text=True, check=True)
    assert json.loads(told.stdout) == []


def test_all_procedures_are_watched():
    from hil.catalog import entries

    ours = {entry.name for entry in entries("procedures") if entry.module.startswith("procedures.")}
    assert ours == {case.split()[0] for case in (QUICK, *ALL)}
