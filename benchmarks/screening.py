"""Changed or not, of a population: what a unit of 76 000 samples costs, as a multiple of one simulation of it.

    python benchmarks/screening.py [UNITS]

Every unit sticks, which its model does not know, and every other one has changed since: its pilot has slowed down by a
tenth to a third. All went through one programme, from rest. The model is that of the type; where each unit has one of
its own, what the library changes in the recordings is worked out for each anew. Reading the CSV is in every figure.
Times are of the processor, so that 10 000 units in an hour on two cores are 720 ms each.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

os.environ["HIL_CORES"] = "1"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `hil` itself does

import numpy as np
from table import Row, milliseconds, show

from hil.diagnosis.skeleton.table import table_of
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import experiment, for_model
from hil.physics.compose import plant
from hil.physics.model import Model, typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.read import write_recording
from hil.record.recording import Array, Recording, recording
from hil.session.fleet import diagnose_unit, read_unit

PLANT, RATE_HZ, NOISE = "brevini-hpv41", 250.0, 0.3
RECORDINGS, SAMPLES = 5, 15_200
FRICTION = {"coulomb": 3.0, "stiction": 1.3, "stribeck": 20.0, "presliding": 0.2}
SLOWER = (0.9, 0.67)


def commands(seed: int, count: int, samples: int) -> list[Array]:
    """Levels, ramps between others, and sums of sines, in %; each begins with a second of rest."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(samples) / RATE_HZ
    levels = [np.repeat(rng.uniform(-80.0, 80.0, samples // 200 + 1), 200)[:samples] for _ in range(count)]
    ramps = [np.interp(time_s, time_s[::400], rng.uniform(-80.0, 80.0, len(time_s[::400]))) for _ in range(count)]
    tones = [sum(15.0 * np.sin(2.0 * np.pi * f * time_s + rng.uniform(0.0, 6.0)) for f in np.geomspace(0.1, 10.0, 5))
             for _ in range(count)]  # fmt: skip
    made = [each[k] for k in range(count) for each in (levels, ramps, tones)][:count]
    return [np.where(time_s < 1.0, 0.0, one) for one in made]


def recorded(played: list[Array], pilot: float, seed: int) -> list[Recording]:
    """What a unit answers whose pilot is so many times as quick as a typical one."""
    valve, rng = plant(PLANT), np.random.default_rng(seed)
    values = {**valve.typical, "pilot_rate": pilot * valve.typical["pilot_rate"]}
    made = []
    for k, command in enumerate(played):
        drive = Drive(command[None, :], 0.0, 1.0 / RATE_HZ, 0.0)
        flow = simulate(valve, values, drive, [ActiveEffect("friction", "force", FRICTION)])[0]
        flow = flow + NOISE * rng.standard_normal(len(flow))
        channels = {"command [%]": command, "flow [l/min]": flow}
        made.append(recording(f"later-{k}", np.arange(len(flow)) / RATE_HZ, channels))
    return made


def type_model() -> Model:
    """Identified from recordings of a unit as it was, with what it left of them."""
    start = typical_model(PLANT)
    before = [experiment(one, start.definition) for one in recorded(commands(1, 3, 5000), 1.0, 1)]
    model = fit_plant(start, before).model
    table = table_of(model, before)
    assert table is not None
    return replace(model, skeleton=table.as_dict())


def rows(count: int) -> Iterator[Row]:
    model, played = type_model(), commands(2, RECORDINGS, SAMPLES)
    slower = np.linspace(*SLOWER, count)
    with tempfile.TemporaryDirectory() as place:
        folders = [Path(place) / f"unit-{k}" for k in range(count)]
        for k, folder in enumerate(folders):
            folder.mkdir()
            for one in recorded(played, slower[k] if k % 2 else 1.0, 10 + k):
                write_recording(one, folder / f"{one.name}.csv")
        own = [for_model(model, one) for one in read_unit(folders[0], model).recordings]
        one_ms = milliseconds(lambda: [e.simulated(model) for e in own])
        yield Row("one simulation", one_ms)
        taken, right = [], 0
        for k, folder in enumerate(folders):
            began_s = time.process_time()
            found = diagnose_unit(read_unit(folder, model), screens=True).screened
            taken.append(1e3 * (time.process_time() - began_s))
            right += found is not None and (found.verdict == "changed") == bool(k % 2)
        first_ms, each_ms = taken[0], sum(taken[1:]) / (count - 1)
        yield Row("first of a type, or with a model of its own", first_ms, f"{first_ms / one_ms:.0f} simulations")
        note = f"{each_ms / one_ms:.0f} simulations, bar 720 ms; {right} of {count} verdicts are right"
        yield Row("each further unit of the type", each_ms, note)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    show(f"changed or not, {count} units of {RECORDINGS * SAMPLES} samples", rows(count))


if __name__ == "__main__":
    main()
