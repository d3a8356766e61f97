"""One valve at one range over many seeds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.record.measurement import Measured
from hil.record.recording import Recording
from hil.session.identification import bound
from hil.signals.interval import COVERED
from tests.studies.coverage.score import Tally
from tests.studies.identify.benches import RATE_HZ
from tests.studies.identify.cases import Case

_AT_REST = 1000  # samples before the first that is recorded


@dataclass
class Outcome:
    """The tallies of a valve at a range, and how many of the runs had which note."""

    case: Case
    range: str
    runs: int = 0
    tallies: dict[str, Tally] = field(default_factory=dict)
    notes: dict[str, int] = field(default_factory=dict)
    fit: float = float("nan")


def recordings(case: Case, at: str, seed: int, noise: float = 1.0) -> list[Recording]:
    """The recordings of one seed."""
    made = []
    for i, command in enumerate(case.commands[at]):
        at_rest = _AT_REST if case.starts_steady else 0
        before = np.full(at_rest, command[0])
        acting = case.bench.acting(np.concatenate((before, command)), case.sub_steps)
        solved = case.solve(acting, {**case.truth, **case.lacking}, 1.0 / (RATE_HZ * case.sub_steps))
        channels = {name: values[at_rest * case.sub_steps :] for name, values in solved.items()}
        made.append(case.bench.recorded(f"{at} {i}", command, channels, case.sub_steps, 100 * seed + i, noise))
    return made


def tried(case: Case, at: str, seeds: range) -> Outcome:
    """Identify from the recordings of all seeds."""
    start = starting_model(case.plant)
    made, fits = Outcome(case, at), []
    for seed in seeds:
        found = fit_plant(start, [bound(one, start.definition) for one in recordings(case, at, seed)])
        made.runs += 1
        fits += list(found.fits.values())
        for note in found.notes:
            short = note.partition(";")[0]
            made.notes[short] = made.notes.get(short, 0) + 1
        for name, truth in case.truth.items():
            value = found.model.parameters[name]
            is_told = value.std is not None and np.isfinite(value.std)
            tally = made.tallies.setdefault(name, Tally(truth, unit=value.unit, factor=COVERED))
            tally.add(Measured(name, value.value if is_told else None, value.unit, std=value.std))
    made.fit = float(np.mean(fits))
    return made
