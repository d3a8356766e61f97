"""A fleet of short recordings: how two processes do beside one, and memory by the number of units.

    python benchmarks/fleet.py [UNITS]

Every unit is a copy of one recording of 4 s, which its model explains. Times are those of the wall, so the machine has
to be idle; memory is the most that the program which hands out the units held, in a process of its own.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from table import Row, show

import hil
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.record.read import write_recording
from hil.record.recording import recording

RATE_HZ, SECONDS, NOISE = 250.0, 4.0, 0.3
DONE = """
import json, resource, sys, time
from pathlib import Path
from hil.session.fleet import diagnosed_fleet
from hil.physics.model import load_model
folder, count = Path(sys.argv[1]), int(sys.argv[2])
if __name__ == "__main__":
    began_s = time.perf_counter()
    units = [folder / f"unit-{k}" for k in range(count)]
    answers = diagnosed_fleet(units, load_model(folder / "model.json"), out=Path(sys.argv[3]))
    assert not any(one.error for one in answers)
    print(json.dumps([time.perf_counter() - began_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0]))
"""


def made(folder: Path, count: int) -> None:
    model = hil.typical_model("brevini-hpv41")
    hil.save_model(model, folder / "model.json")
    time_s = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    command = np.repeat([0.0, 60.0, -60.0, 30.0], len(time_s) // 4)
    valve = plant("brevini-hpv41")
    flow, _, _ = simulate(valve, valve.typical, Drive(command[None, :], 0.0, 1.0 / RATE_HZ, 0.0))
    flow = flow + NOISE * np.random.default_rng(1).standard_normal(len(flow))
    first = recording("steps", time_s, {"command [%]": command, "flow [l/min]": flow})
    (folder / "unit-0").mkdir()
    write_recording(first, folder / "unit-0" / "steps.csv")
    for k in range(1, count):
        shutil.copytree(folder / "unit-0", folder / f"unit-{k}")


def rows(count: int) -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        made(folder, count)
        (folder / "done.py").write_text(DONE)
        taken = {}
        for cores, units in ((1, count // 4), (2, count // 4), (2, count)):
            out = folder / f"out-{cores}-{units}"
            command = [sys.executable, str(folder / "done.py"), place, str(units), str(out)]
            told = subprocess.run(command, env={"HIL_CORES": str(cores)}, capture_output=True, check=True, text=True)
            taken[cores, units] = json.loads(told.stdout)
        one_s, two_s = (taken[cores, count // 4][0] for cores in (1, 2))
        yield Row(f"{count // 4} units, one process", 1e3 * one_s)
        yield Row(f"{count // 4} units, two processes", 1e3 * two_s, f"{one_s / two_s:.2f} × as fast, bar 1.8")
        few_mb, many_mb = taken[2, count // 4][1], taken[2, count][1]
        note = f"{many_mb:.0f} MB at most, {few_mb:.0f} MB with a quarter of them: {many_mb / few_mb:.3f} ×"
        yield Row(f"{count} units, two processes", 1e3 * taken[2, count][0], note)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 32
    show("a fleet of short recordings, by the wall", rows(count))


if __name__ == "__main__":
    main()
