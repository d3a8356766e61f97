"""sample ramp: the mean response at a few levels; `hil list procedures` prints this line."""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from hil.record.measurement import Findings, Measurement
from hil.record.recording import Recording
from hil.rig import Rig

MEASUREMENTS = (Measurement("level", "", "mean response at a level"),)


def run(rig: Rig, *, levels: tuple[float, ...] = (40.0, 60.0), hold_s: Annotated[float, Gt(0)] = 1.0) -> None:
    """Visit levels.

    Args:
        levels: of the command, in its unit.
        hold_s: how long each is measured.
    """
    samples = round(hold_s * rig.rate_hz)
    rig.check(np.concatenate([np.full(samples, level) for level in levels]))  # all of it, before anything moves
    for done, level in enumerate(levels, start=1):
        rig.ramp_to(level)
        rig.play(np.full(round(rig.settling_s * rig.rate_hz), level), part={"kind": "settling"})
        rig.play(np.full(samples, level), part={"kind": "level", "level": level})
        rig.progress(done / len(levels), f"{level:g} {rig.command.unit}")


def evaluate(recording: Recording) -> Findings:
    """Mean of each level."""
    name = recording.meta["roles"]["response"]
    unit = recording.channel(name).unit
    found = []
    for part in recording.meta["parts"]:
        if part["kind"] == "level":
            values = recording.rows(part["first"], part["count"]).values(name)
            std = float(values.std()) / len(values) ** 0.5
            found.append(MEASUREMENTS[0].at(f"{part['level']:g}", unit).of(float(values.mean()), std))
    return Findings(tuple(found))
