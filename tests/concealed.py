"""Recordings of a simulated HPV41 in which something is concealed, for tests of the diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from hil.diagnosis.diagnose import Diagnosed, diagnose
from hil.diagnosis.intake.check import Checked, check
from hil.diagnosis.intake.problem import Problem, pose
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.experiment import Experiment, for_model
from hil.physics.compose import plant
from hil.physics.model import Model, typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import Array, Recording, recording
from hil.signals.recursion import filtered
from tests.once import once

PLANT = "brevini-hpv41"
RATE_HZ, DURATION_S, NOISE = 250.0, 16.0, 0.3


def commands(rng: np.random.Generator) -> dict[str, Array]:
    """Steps, a sweep and a sine with a drift of its bias, in %."""
    time_s = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
    steps = np.repeat(
        rng.permutation([0.0, 60.0, -60.0, 35.0, -80.0, 80.0, -35.0, 0.0]), round(DURATION_S / 8 * RATE_HZ)
    )
    sweep = 90.0 * np.interp(time_s, DURATION_S * np.array([0.0, 0.25, 0.75, 1.0]), [0.0, 1.0, -1.0, 0.0])
    sine = 45.0 + 12.0 * np.sin(2.0 * np.pi * 0.8 * time_s) - 90.0 * (time_s > DURATION_S / 2.0)
    return {"steps": steps, "sweep": sweep, "sine": sine}


def noise(rng: np.random.Generator, count: int, memory: float = 0.0) -> Array:
    """Noise of unit variance; `memory` is the correlation from one sample to the next."""
    white = rng.standard_normal(count + 500)
    made: Array = filtered([np.sqrt(1.0 - memory**2)], [1.0, -memory], white)[500:]
    return made


def records(
    effects: Sequence[ActiveEffect] = (),
    parameters: Mapping[str, float] | None = None,
    *,
    seed: int = 1,
    memory: float = 0.0,
    factor: float = 4.0,
    arriving: Mapping[str, Array] | None = None,
    with_spool: bool = False,
) -> list[Recording]:
    """Three recordings of 16 s; the truth takes finer steps than the model.

    `arriving`: the commands that really reach the valve, where they are not those that are recorded.
    `with_spool`: the spool's position is recorded too.
    """
    rng = np.random.default_rng(seed)
    valve = plant(PLANT)
    values = {**valve.typical, **(parameters or {})}
    made = []
    for name, command in commands(rng).items():
        drive = Drive((arriving or {}).get(name, command)[None, :], 0.0, 1.0 / RATE_HZ, 0.0)
        flow, spool, _ = simulate(valve, values, drive, effects, factor=factor)
        flow = flow + NOISE * noise(rng, len(flow), memory)
        channels = {"command [%]": command, "flow [l/min]": flow}
        if with_spool:
            channels["spool position [%]"] = spool + NOISE * noise(rng, len(spool))
        made.append(recording(name, np.arange(len(flow)) / RATE_HZ, channels))
    return made


def with_rows(each: Recording, kept: Array | slice) -> Recording:
    """A recording of these samples only."""
    channels = {name: replace(c, values=c.values[kept]) for name, c in each.channels.items()}
    return replace(each, time_s=each.time_s[kept], channels=channels)


def changed(change: Callable[[Recording], None]) -> list[Recording]:
    """Healthy recordings, each changed in place."""
    made = records(seed=20)
    for each in made:
        change(each)
    return made


def bound(model: Model, made: Sequence[Recording]) -> list[Experiment]:
    return [for_model(model, each) for each in made]


WORN = ActiveEffect("backlash", "opening", {"half_width": 25.0})


@cache
def poor() -> Model:
    """The model, as identified on a worn unit, whose recordings it never fitted well."""
    start = typical_model(PLANT)
    return once("poor", lambda: fit_plant(start, bound(start, records([WORN], seed=25))).model)


@cache
def nominal(memory: float = 0.0) -> Model:
    """The model, as identified on a healthy unit."""

    def identified() -> Model:
        start = typical_model(PLANT)
        return fit_plant(start, bound(start, records(seed=100, memory=memory))).model

    return once(f"nominal-{memory}", identified)


def intake(made: Sequence[Recording]) -> Checked:
    """What the intake makes of recordings of the healthy unit's model."""
    return check(nominal(), bound(nominal(), made))


def posed(made: Sequence[Recording]) -> Problem:
    """What the search is asked about them."""
    return pose(nominal(), bound(nominal(), made))


def diagnosed(made: Sequence[Recording]) -> Diagnosed:
    """What is found in them."""
    return diagnose(nominal(), bound(nominal(), made))
