"""Samples at the end of a channel's range: they say that the quantity was there or beyond, and no more."""

from __future__ import annotations

import numpy as np

from hil.identification.preparation.criteria import CRITERIA
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.noise import NOISE_OVER_RESOLUTION, resolution, white_floor
from hil.language.note import Note
from hil.record.recording import Array, Mask
from hil.signals.runs import runs

_TOP = 1.0 / (2.0**0.5 - 1.0)  # of a parabola: most samples of its highest step over those of the next


def without_clipped(e: Experiment) -> tuple[Experiment, list[Note]]:
    """The experiment without samples at the end of a channel's range, of the output and of inner signals; in words.

    Samples at one extreme value, in runs, are a channel at the end of its range, not the valve. Those of a unit of
    which nothing is asked are its rest.
    """
    notes = []
    clipped, at = clipped_samples(e.output)
    if clipped is not None:
        clipped = clipped & ~_rest(e, clipped)
    if clipped is not None and clipped.any():
        notes.append(_sentence(e.name, e.output_heading, clipped, at))
        e = e.without(clipped)
    for name, values in e.observed.items():
        clipped, at = clipped_samples(values)
        if clipped is not None:
            notes.append(_sentence(e.name, name, clipped, at))
            e = e.without(clipped, name)
    return e, notes


def _rest(e: Experiment, clipped: Mask) -> Mask:
    """Runs of samples at one value in most of which the command is at its least size, and it has others."""
    asked, rest = np.abs(e.on_grid_input()), np.zeros_like(clipped)
    for start, stop in runs(clipped):
        rest[start:stop] = asked.max() > np.median(asked[start:stop]) == asked.min()
    return rest


def clipped_samples(values: Array) -> tuple[Mask | None, float]:
    """Which samples are at the end of the channel's range, and that end; None where there are none."""
    floor = white_floor(values)
    if floor <= 0.0:
        return None, 0.0
    # a coarse channel is at its extreme again and again, and nothing in between is wrong
    fine = floor >= NOISE_OVER_RESOLUTION * resolution(values)
    few_below = CRITERIA.clipped_gap if fine else 0
    clipped = np.zeros(len(values), dtype=np.bool_)
    for extreme in (float(values.max()), float(values.min())):
        clipped |= _at_the_end(values == extreme, few_below)
    if clipped.mean() < CRITERIA.clipped_share:
        return None, 0.0
    at = values[clipped & ((values == values.max()) | (values == values.min()))]
    return clipped, float(at[0])


def clipped_note(name: str, heading: str, values: Array) -> tuple[Note, ...]:
    """What is said of a channel of a file where its clipped samples are used all the same; nothing where none are.

    The top of a slow sine that a coarse converter rounds is none: it has few more samples than the step below.
    """
    clipped, _ = clipped_samples(values)
    at = next((v for v in (float(values.max()), float(values.min())) if _stands_out(values, v)), None)
    if clipped is None or at is None:
        return ()
    return (
        Note(
            "channel '{channel}' is clipped at {at:.4g} in {share:.1f} % of its samples; it falls short there",
            channel=heading, at=at, share=100.0 * clipped.mean(),
        ).of(name),
    )  # fmt: skip


def _stands_out(values: Array, extreme: float) -> bool:
    """Whether more samples are at an extreme than a rounded parabola has there, beside those one step before it."""
    away = np.abs(values - extreme) / resolution(values)
    return bool(np.count_nonzero(away < 0.5) > _TOP * np.count_nonzero((away >= 0.5) & (away < 1.5)))


def _sentence(name: str, heading: str, clipped: Mask, at: float) -> Note:
    return Note(
        "channel '{channel}' is clipped at {at:.4g} in {share:.1f} % of its samples; they are left out",
        channel=heading, at=at, share=100.0 * clipped.mean(),
    ).of(name)  # fmt: skip


def _at_the_end(at_extreme: Mask, few_below: int) -> Mask:
    """Stretches of the extreme value in which there is a run; noise leaves it for a few samples where it just ends."""
    together, kept = at_extreme.copy(), np.zeros_like(at_extreme)
    for start, stop in runs(~at_extreme):
        if stop - start <= few_below:
            together[start:stop] = True
    for start, stop in runs(together):
        if any(last - first >= CRITERIA.clipped_run for first, last in runs(at_extreme[start:stop])):
            kept[start:stop] = True
    return kept
