"""What a model leaves beyond noise of the recordings that it was identified from: how much, and when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hil.identification.grey_box.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.time_constant import time_constant_s
from hil.identification.uncertainty.noise import Measured
from hil.language.note import Note
from hil.language.words import marked
from hil.physics.model import Model
from hil.record.recording import Array, Mask


def discrepancy_of(
    model: Model, experiments: Sequence[Experiment], errors: Sequence[Array], measured: Measured
) -> dict[str, float | str | bool]:
    """`rms` beyond the noise, all that is `left` and its standard uncertainty, and when it is `mostly`.

    Empty where nothing is left beyond the noise.

    Args:
        model: the fitted one.
        experiments: the recordings.
        errors: simulated minus measured, shape (n,) each.
        measured: the noise.
    """
    if measured.discrepancy == 0.0:
        return {}
    left = measured.left
    return {
        "rms": measured.discrepancy, "left": left.std, "left_uncertainty": left.std_uncertainty,
        "times_noise": left.std / measured.noise.std, "mostly": _mostly(model, experiments, errors),
        "is_witnessed": measured.is_witnessed,
    }  # fmt: skip


def note_of(found: Mapping[str, float | str | bool]) -> Note:
    """In words."""
    left = Note("the model leaves {times:.3g} times the noise", times=found["times_noise"])
    if found["mostly"]:
        left = Note("{left}, mostly {when}", left=left, when=Note(str(found["mostly"])))
    if found["is_witnessed"]:
        return Note("{left}: misfit", left=left)
    return Note("{left}: noise or misfit; without a rest or a repeat nothing tells them apart", left=left)


def _mostly(model: Model, experiments: Sequence[Experiment], errors: Sequence[Array]) -> str:
    """When more than half of the squared error is made in less than half of the time; empty where it is so never."""
    each = [_times(model, e, error) for e, error in zip(experiments, errors, strict=True)]
    power = np.concatenate([np.square(error[e.valid]) for e, error in zip(experiments, errors, strict=True)])
    times = {name: np.concatenate([own[name] for own in each]) for name in each[0]}
    shares = {
        name: (float(power[at].sum()) / float(power.sum()), float(at.mean())) for name, at in times.items() if at.any()
    }
    most = {name: part / time for name, (part, time) in shares.items() if part > CRITERIA.mostly > time}
    return max(most, key=lambda name: most[name]) if most else ""


def _times(model: Model, e: Experiment, error: Array) -> dict[str, Mask]:
    """Samples at reversals of the command, while it moves, at rest, and by level of the output, where they say
    something; what the command did a time constant ago counts still.
    """
    moved = np.diff(e.on_grid_input(), prepend=e.on_grid_input()[0])
    turns = np.flatnonzero(moved)
    reversals = np.zeros(len(moved), dtype=np.bool_)
    reversals[turns[1:][np.diff(np.sign(moved[turns])) != 0.0]] = True
    reach = max(1, round(time_constant_s(model, e) / e.interval_s))
    moving = _lasting(moved != 0.0, reach)
    simulated = e.output + error
    low, high = np.quantile(simulated, [1.0 / 3.0, 2.0 / 3.0])
    found = {
        marked("at reversals"): _lasting(reversals, reach), marked("while the command moves"): moving,
        marked("while the command rests"): ~moving, marked("at a low output"): simulated < low,
        marked("at a high output"): simulated > high,
        marked("at a middling output"): (simulated >= low) & (simulated <= high),
    }  # fmt: skip
    return {name: at[e.valid] for name, at in found.items()}


def _lasting(at: Mask, reach: int) -> Mask:
    """Samples at most so many after one of these."""
    last = np.maximum.accumulate(np.where(at, np.arange(len(at)), -reach - 1))
    return np.asarray(np.arange(len(at)) - last <= reach)
