"""How far an output has travelled, and whether it was driven against an end there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.noise import channel_floor
from hil.physics.plant import Travel
from hil.record.recording import Array, Mask


def travelled(experiments: Sequence[Experiment]) -> Travel | None:
    """Of an output that rises with its command; None where nothing was read."""
    read = [e.valid_output for e in experiments if e.valid.any()]
    if not read:
        return None
    least, greatest = min(float(one.min()) for one in read), max(float(one.max()) for one in read)
    noise = max(map(channel_floor, read))
    return Travel(least, greatest, _stood(experiments, -1, -least, noise), _stood(experiments, 1, greatest, noise))


def _stood(experiments: Sequence[Experiment], sign: int, end: float, noise: float) -> bool:
    """Whether it stood at its end under a command that drove it on, where a plainly weaker one moved it elsewhere.

    A valve's lag, too, moves it after the command: then the second half of a window has plainly less of the way.
    """
    still, resisted, moved = CRITERIA.range_of_noise * noise, [0.0], [np.inf]
    for e in experiments:
        half = round(CRITERIA.driven_s / e.drive.interval_s)
        if e.grid_s is not None or half < 1 or len(e.output) <= 2 * half:
            continue
        command, output, valid = (_windows(each, half) for each in (sign * e.drive.inputs[0], sign * e.output, e.valid))
        weakest, strongest, known = command.min(axis=1), command.max(axis=1), valid.all(axis=1)
        first, second = output[:, half] - output[:, 0], output[:, -1] - output[:, half]
        at_end = known & (output.min(axis=1) > end - still)
        moves = known & (weakest > 0.0) & (first > still) & (2.0 * second > first)
        resisted += [float(np.max(weakest[at_end], initial=0.0))]
        moved += [float(np.min(strongest[moves], initial=np.inf))]
    return max(resisted) > CRITERIA.driven_harder * min(moved)


def _windows(values: Array | Mask, half: int) -> Array:
    """Of twice so many steps, each begun a sixteenth of that after the one before."""
    every = np.lib.stride_tricks.sliding_window_view(values, 2 * half + 1)
    return np.asarray(every[:: max(half // 8, 1)])
