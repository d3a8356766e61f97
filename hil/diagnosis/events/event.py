"""What is said of events: causes without a law, which happen when they happen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.identification.preparation.experiment import Experiment
from hil.language.note import Note
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Interval:
    """A stretch of a recording in which something stood still."""

    recording: str
    start_s: float
    stop_s: float


@dataclass(frozen=True, slots=True)
class Events:
    """Events that explain a misfit.

    Attributes:
        name: of the effect. `stage`, `hook`: where in the chain.
        intervals: when. `values`: what is known of them: name → (value, std, unit).
        residuals: whitened, with the events taken into account, shape (n,).
        rest: the experiments without the events, to look at again.
        sentence: for the operator. `equation`: for the engineer.
        shows_as: an effect of the library that is there beside them and only another side of them.
    """

    name: str
    stage: str
    hook: str
    intervals: tuple[Interval, ...]
    values: dict[str, tuple[float, float | None, str]]
    residuals: Array
    rest: tuple[Experiment, ...]
    sentence: Note
    equation: str
    shows_as: str = ""

    @property
    def names(self) -> tuple[str, str]:
        """Effects that need no telling beside these events."""
        return self.name, self.shows_as

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)


def how_often(intervals: Sequence[Interval]) -> dict[str, tuple[float, float | None, str]]:
    """Number and length of intervals."""
    lasting = np.array([interval.stop_s - interval.start_s for interval in intervals])
    return {
        "events": (float(len(intervals)), None, "1"),
        "lasting": (float(lasting.mean()), float(lasting.std() / np.sqrt(len(intervals))), "s"),
        "longest": (float(lasting.max()), None, "s"),
    }
