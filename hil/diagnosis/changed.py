"""What has changed since identification, on a model that left more than noise then: one gate, then a name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil.cores import spread
from hil.diagnosis.problem import COARSER, Problem
from hil.diagnosis.skeleton.gate import Later, later_of
from hil.diagnosis.skeleton.rows import Rows, answers, samples_in
from hil.diagnosis.skeleton.table import Table
from hil.diagnosis.thresholds import PLAINLY
from hil.language.note import Note
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array


@dataclass(frozen=True)
class Changed:
    """Later recordings beside what is known of before.

    Attributes:
        problem: the question.
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
        return self.is_alarm and self.later.alone and (self.later.z < PLAINLY * self.needed or strange)

    @property
    def as_one(self) -> float:
        """How many rows tell as much as one."""
        return max(self.table.before.least, 1.0)

    @property
    def count(self) -> float:
        """So many independent rows there are: χ² that the remainder leaves."""
        return max(float(np.count_nonzero(self.rows.valid)) / self.as_one, 1.0)

    @property
    def left_as_it_was(self) -> Array:
        """What `residuals` are of the unit as it was, which nothing need be simulated for; shape (n,)."""
        return self._weight * self.later.left

    def residuals(self, parameters: Mapping[str, float], effects: Sequence[ActiveEffect]) -> Array:
        """What a changed model leaves of the rows, without the skeleton misfit; shape (n,).

        Over the scale of the left-out remainder and the root of how many rows tell as much as one, so that an unchanged
        unit leaves `count`; 0 where nothing was measured.
        """
        change = np.nan_to_num(self._answers(parameters, effects) - self._nominal)
        return self._weight * (self.later.left + change)

    @cached_property
    def _weight(self) -> Array:
        return np.where(self.rows.valid, 1.0 / (math.sqrt(self.as_one) * self.later.std), 0.0)

    @cached_property
    def _nominal(self) -> Array:
        return self._answers(self.problem.model.values, self.problem.model.active_effects)

    def _answers(self, parameters: Mapping[str, float], effects: Sequence[ActiveEffect]) -> Array:
        model, table, experiments = self.problem.model, self.table, self.problem.experiments
        self.problem.work.simulated(len(experiments), sum(e.drive.inputs.shape[1] for e in experiments))
        parts = spread(
            lambda e: answers(model, e, table.floors, table.row_s, parameters, effects, COARSER), experiments
        )
        return np.concatenate([rows for channels in parts for rows in channels.values()])

    def folds(self, of_residuals: NDArray[np.int64]) -> NDArray[np.int64]:
        """The fold of every row, shape (n,), from those of the residuals of the question."""
        found = np.zeros(len(self.rows.recording), dtype=np.int64)
        for k, (e, part) in enumerate(zip(self.problem.experiments, self.problem.output_slices(), strict=True)):
            own = self.rows.recording == k
            for channel in np.unique(self.rows.channel[own]):
                at = np.flatnonzero(own & (self.rows.channel == channel))
                found[at] = of_residuals[part][np.arange(len(at)) * samples_in(self.table.row_s, e)]
        return found

    def unsure(self) -> Note | None:
        """In words what one recording alone leaves open; None where nothing."""
        if not self.is_unsure:
            return None
        return Note(
            "one recording alone says so (z = {z:.1f}, {needed:.1f} is needed): the change is unsure. Record the test "
            "that the model was identified from once more; it settles this",
            z=self.later.z, needed=self.needed,
        )  # fmt: skip
