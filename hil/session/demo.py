"""The main job on the embedded simulated bench, from the first test to a corrected model.

A good valve is tested and identified. Then it comes back and its recordings conceal an effect: the model no longer
fits, and the diagnosis says why.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from hil.bench.find import find_bench
from hil.bench.read import read_bench
from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.errors import FileError, option
from hil.identification.grey_box.identify import GreyBoxFit, fit_plant, starting_model
from hil.identification.preparation.experiment import experiment, for_model
from hil.physics.model import save_model
from hil.physics.simulate import ActiveEffect
from hil.record.read import read_recording
from hil.record.run_folder.progress import Progress
from hil.session.diagnosis import of_origins, write_diagnosis
from hil.session.outcome import Outcome
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure

VALVE = "hpv41-identified"
"""The bench, and the model that its identification starts from: the valve of the paper as its tables identify it."""

FREED = ("friction.coulomb", "pilot_ratio", "spool_ratio")
"""What is estimated beside the parameters that every valve has: its friction, and the sides of their own."""

CONCEALED = ActiveEffect("backlash", "opening", {"half_width": 2.0})
"""What the worn valve has, and nobody says."""

# Tests of the good valve with their share of the whole job, then those of the one that came back.
_GOOD = {"frequency_response": 0.5, "flow_curve": 0.05, "step_response": 0.05}
_BACK = {"flow_curve": 0.05, "step_response": 0.05}
_IDENTIFY, _DIAGNOSE = 0.1, 0.2


@dataclass(frozen=True, slots=True)
class Demonstration:
    """What the job leaves: tests of the good valve by procedure, its model, and the diagnosis of the worn one."""

    tests: Mapping[str, Outcome]
    identified: GreyBoxFit
    diagnosed: Diagnosed
    report: Path


def demonstrate(out: Path, progress: Progress) -> Demonstration:
    """Do the whole job in a new folder.

    Raises:
        FileError: the folder is not empty.
    """
    if out.exists() and any(out.iterdir()):
        raise FileError(f"{out}: is not empty; name another folder with {option('out')}, or remove it")
    out.mkdir(parents=True, exist_ok=True)
    steps = _Steps(progress)
    tests = {name: _tested(name, find_bench(VALVE), out / f"good-{name}", steps.part(share, "good valve"))
             for name, share in _GOOD.items()}  # fmt: skip
    steps.part(_IDENTIFY, "identification")(0.0, "fitting the plant to all three tests")
    start = starting_model(VALVE, FREED)
    folders = [outcome.folder for outcome in tests.values()]
    identified = fit_plant(start, [experiment(read_recording(folder), start.definition) for folder in folders], FREED)
    save_model(identified.model, out / "nominal.json")
    worn = out / "worn-valve.toml"
    write_bench_with(CONCEALED, worn, seed=2, bench=VALVE)
    back = [_tested(name, worn, out / f"worn-{name}", steps.part(share, "worn valve")).folder
            for name, share in _BACK.items()]  # fmt: skip
    recordings = [for_model(identified.model, read_recording(folder)) for folder in back]
    diagnosed = of_origins(diagnose(identified.model, recordings, steps.part(_DIAGNOSE, "diagnosis")))
    return Demonstration(tests, identified, diagnosed, write_diagnosis(diagnosed, out))


def _tested(procedure: str, bench: Path, folder: Path, progress: Progress) -> Outcome:
    return run_procedure(load_procedure(procedure), read_bench(bench), {}, folder, progress)


def write_bench_with(effect: ActiveEffect, path: Path, seed: int, bench: str = "brevini-hpv41") -> None:
    """Write an installed bench with an effect switched on in its simulation, and other noise."""
    values = ", ".join(f"{key} = {value}" for key, value in effect.parameters.items())
    name, hook = json.dumps(effect.name), json.dumps(effect.hook)
    line = f"effects = [{{ name = {name}, hook = {hook}, parameters = {{ {values} }} }}]"
    path.write_text(f"based_on = {json.dumps(bench)}\n\n[simulation]\n{line}\nseed = {seed}\n", encoding="utf-8")


class _Steps:
    """Progress of a job that has parts."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._before = progress, 0.0

    def part(self, share: float, name: str) -> Progress:
        """Progress within the next part."""
        start = self._before
        self._before += share
        return lambda done, text: self._progress(min(start + share * done, 1.0), f"{name}: {text}")
