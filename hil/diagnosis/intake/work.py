"""How far a diagnosis is, what it has simulated, and what it leaves out when its budget is spent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from threading import Lock
from typing import Any

from hil.language.note import Note
from hil.record.run_folder.progress import Progress, quiet

SAMPLES_PER_S = 10e6
"""Simulated samples that a second of a budget stands for, whatever the machine does."""


def budget_notes(not_searched: Sequence[str], size: str = "") -> tuple[Note, ...]:
    """What was left out for want of a larger budget than this `size`, in words; empty where nothing was."""
    note = Note(
        "the budget{size!l} was over before these were looked at: {what}; a larger budget may find more",
        size=size, what=tuple(map(Note, not_searched)),
    )  # fmt: skip
    return (note,) if not_searched else ()


class Work:
    """One diagnosis at work.

    Attributes:
        left_out: what was not done for want of a larger budget, in the order in which it came up.
        simulations, samples: that it took so far: of one recording each, and simulated in all of them.
    """

    def __init__(self, progress: Progress = quiet, budget_s: float = math.inf) -> None:
        self._progress, self._budget_s = progress, budget_s
        self.left_out: list[str] = []
        self.simulations = self.samples = 0
        self._one_at_a_time = Lock()

    def at(self, share: float, text: str) -> None:
        """Say how far it is."""
        self._progress(share, text)

    def simulated(self, simulations: int, samples: int) -> None:
        """Count simulations, and their samples in all; from any thread."""
        with self._one_at_a_time:
            self.simulations += simulations
            self.samples += samples

    @property
    def spent_s(self) -> float:
        """What it took, as a budget counts it."""
        return self.samples / SAMPLES_PER_S

    def as_dict(self) -> Mapping[str, Any]:
        """As `diagnosis.json` has it."""
        return {"simulations": self.simulations, "samples": self.samples, "not_searched": list(self.left_out)}

    def leaves_out(self, what: str) -> bool:
        """Whether no budget is left for something; it is remembered."""
        over = self.spent_s >= self._budget_s
        if over and what not in self.left_out:
            self.left_out.append(what)
        return over

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What was left out, in words; empty where nothing was."""
        size = f" of {self._budget_s:.3g} s ({self._budget_s * SAMPLES_PER_S:.3g} samples)"
        return budget_notes(self.left_out, size)
