"""What has changed since identification, on a model that left more than noise then: one gate, then a name."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.problem import Problem
from hil.diagnosis.skeleton.gate import Later, later_of
from hil.diagnosis.skeleton.rows import Rows
from hil.diagnosis.skeleton.table import Table
from hil.record.recording import Array

# An alarm of one recording within so many times the threshold is unsure.
_UNSURE = 1.5


@dataclass(frozen=True)
class Changed:
    """Later recordings beside what is known of before.

    Attributes:
        problem: the question, with the recordings as they are.
        table: of the recordings of before. `rows`: the later ones, in the rows of that table.
    """

    problem: Problem
    table: Table
    rows: Rows

    @cached_property
    def later(self) -> Later:
        """The recordings on the scale of before."""
        return later_of(self.table.before, self.rows)

    @property
    def needed(self) -> float:
        """The z from which it is an alarm."""
        return self.table.before.needed

    @property
    def is_alarm(self) -> bool:
        """Whether the unit has changed."""
        return self.later.z >= self.needed

    @property
    def is_unsure(self) -> bool:
        """Whether one recording alone makes an alarm near the threshold, or is of a kind unlike all of before."""
        strange = self.later.leverage > self.table.before.leverage
        return self.is_alarm and self.later.alone and (self.later.z < _UNSURE * self.needed or strange)

    @property
    def as_one(self) -> float:
        """How many rows tell as much as one."""
        return max(self.table.before.least, 1.0)

    @cached_property
    def judged(self) -> Problem:
        """The question without the skeleton misfit, on the scale of what that leaves of recordings not fitted."""
        misfit, floors = self.table.before.misfit, self.table.floors
        predicted = misfit.scaled(self.rows) @ misfit.coefficients
        one = math.sqrt(self.rows.samples * self.as_one)
        moved, scales, inner = [], [], []
        for k, e in enumerate(self.problem.experiments):
            at, count = self._rows(k, 0), len(e.output)
            moved.append(replace(e, output=e.output + floors["output"] * self._at_samples(predicted[at], count)))
            scales.append(floors["output"] * one * self._at_samples(self.later.std[at], count))
            inner.append({
                s.name: floors[s.name] * one * float(np.median(self.later.std[own]))
                for place, s in enumerate(self.problem.plant.observed, 1)
                if len(own := self._rows(k, place))
            })  # fmt: skip
        return replace(
            self.problem, experiments=tuple(moved), scales=tuple(scales), observed_noise=tuple(inner),
            recorded=self.problem.experiments,
        )  # fmt: skip

    def _rows(self, recording: int, channel: int) -> NDArray[np.int64]:
        return np.flatnonzero((self.rows.recording == recording) & (self.rows.channel == channel))

    def chi2(self, residuals: Array) -> float:
        """χ² of the rows: what white noise does within them is taken out of that of the samples."""
        n = self.rows.samples
        white = (n - 1.0) / n / self.as_one  # of n samples in a row, over the variance of what is left in it
        within = white * float(np.sum(1.0 / np.square(self.later.std[self.rows.valid])))
        return max(float(residuals @ residuals) - within, 1e-9)

    @property
    def count(self) -> float:
        """So many independent rows there are."""
        return max(float(np.count_nonzero(self.rows.valid)) / self.as_one, 1.0)

    def _at_samples(self, rows: Array, count: int) -> Array:
        """Values of rows at the samples of a recording, shape (count,)."""
        middle = (np.arange(len(rows)) + 0.5) * self.rows.samples - 0.5
        return np.interp(np.arange(count), middle, rows)

    def unsure(self) -> str:
        """In words what one recording alone leaves open; empty where nothing."""
        if not self.is_unsure:
            return ""
        return (
            f"one recording alone says so (z = {self.later.z:.1f}, {self.needed:.1f} is needed): the change is unsure. "
            "Record the test that the model was identified from once more; it settles this"
        )
