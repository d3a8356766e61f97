"""Before any physics is blamed: recordings that cannot be what their headings say."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.thresholds import NEXT_TO_NOTHING, PLAINLY, SELDOM_BY_CHANCE
from hil.errors import FileError
from hil.identification.preparation.clipped import without_clipped
from hil.identification.preparation.content import is_of_its_origin
from hil.identification.preparation.experiment import DEAD, OUTPUT, Experiment, require_excitation
from hil.identification.preparation.gaps import bridged
from hil.identification.preparation.plausibility.look import implausible
from hil.identification.preparation.plausibility.suspicion import Suspicion, expected
from hil.identification.preparation.plausibility.time_unit import wrong_time
from hil.identification.preparation.repeated import without_held
from hil.identification.preparation.start_in_motion import begun_in_motion
from hil.identification.preparation.time_constant import time_constant_s
from hil.identification.uncertainty.noise import resolution, white_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Checked:
    """Experiments fit for a diagnosis, and what was noticed and done about it, one sentence each.

    `clocks_set`: the same with clocks set back that may be shifted, and what that means; empty when none may be. It is
    a second opinion, for when no physics explains the recordings: a play also looks like a delay in a slow sweep.
    """

    experiments: tuple[Experiment, ...]
    warnings: tuple[Note, ...]
    clocks_set: tuple[Experiment, ...] = ()
    clock_warnings: tuple[Note, ...] = ()


def check(model: Model, experiments: Sequence[Experiment]) -> Checked:
    """Look for recordings that would be taken for physics.

    Raises:
        FileError: the command or the output never moves, a recording is shorter than one time constant of the plant
            that recordings of identification reach, two columns are swapped, or a channel or the time is off by the
            factor of a wrong unit.
    """
    require_excitation(experiments)
    strange = [e for e in experiments if not is_of_its_origin(model, e)]  # what a model was made of is what it says
    _refuse(wrong_time(model, strange))
    alive, warnings = _without_dead(model, experiments)
    for e in alive:
        if e in strange:
            _refuse_short(model, e)
            _refuse(implausible(model, e))
    even, bridges = bridged(model, alive)
    warnings += bridges
    kept = []
    for e in even:
        e, moved_before = begun_in_motion(model, e)
        e, clipped = without_clipped(e)
        e, held = without_held(e)
        warnings += [*moved_before, *clipped, *held]
        simulated = e.simulated(model)[0]
        kept.append(_Timed(e, simulated, _floor(model, e)))
    moved, notes = _with_clocks_set(kept)
    return Checked(
        tuple(timed.experiment for timed in kept), tuple(warnings), tuple(moved) if notes else (), tuple(notes)
    )


def _without_dead(model: Model, experiments: Sequence[Experiment]) -> tuple[list[Experiment], list[Note]]:
    """Without recordings whose output stands still where it should move by more than a coarse channel could hide."""
    hidden = SELDOM_BY_CHANCE * max(resolution(e.output) for e in experiments)
    kept, notes = [], []
    for e in experiments:
        moves = float(np.ptp(expected(model, e))) if e.stands_still else 0.0
        if moves <= max(hidden, SELDOM_BY_CHANCE * _floor(model, e)):
            kept.append(e)
        else:
            dead = Note("{stands}, where the model moves by {moves:.3g}: {why}; the recording is left out",
                        stands=e.where_it_stands, moves=moves, why=DEAD)  # fmt: skip
            notes.append(dead.of(e.name))
    return kept, notes


def _refuse_short(model: Model, e: Experiment) -> None:
    """A time constant beyond all that a model was made of was never seen: there it is as one that does not settle."""
    longest_s = float(model.origin.get("longest_s", math.inf))
    if e.duration_s >= longest_s:  # what would be refused was never seen: nothing need be simulated
        return
    needed_s = time_constant_s(model, e)
    if e.duration_s < needed_s <= longest_s:
        raise FileError(
            f"{e.name}: {e.duration_s:.3g} s long; at least one time constant of the plant is needed, {needed_s:.3g} s"
        )


def _refuse(suspicions: Iterable[Suspicion]) -> None:
    """A model of the unit itself is at hand: what only fits it otherwise is not looked for in physics."""
    for suspicion in suspicions:
        raise FileError(suspicion.sentence)


def _with_clocks_set(timed: Sequence[_Timed]) -> tuple[list[Experiment], list[Note]]:
    """A recording that is late or early by itself, where most others would be worse off so, has a shifted clock.

    Recordings too slow to tell have no say: a dead time that only the fast ones show is not a clock.
    """
    kept, notes = [], []
    for k, own in enumerate(timed):
        lag = own.lag()
        votes = [other.vote(lag) for i, other in enumerate(timed) if i != k] if lag else []
        if votes.count(-1) > votes.count(1):
            kept.append(_shifted(own.experiment, lag))
            shifted = Note(
                "its output is {late_s:+.4g} s off its command while other recordings are not; its clock is taken as "
                "shifted and set back",
                late_s=lag * own.experiment.drive.interval_s,
            )
            notes.append(shifted.of(own.experiment.name))
        else:
            kept.append(own.experiment)
    return kept, notes


def _floor(model: Model, e: Experiment) -> float:
    return model.noise.std if model.noise else white_floor(e.output)


@dataclass(frozen=True, slots=True)
class _Timed:
    """An experiment beside the nominal simulation, and the noise between them."""

    experiment: Experiment
    simulated: Array
    floor: float

    def lag(self) -> int:
        """The shift in samples that alone brings the recording down to its noise, 0 if there is none."""
        e = self.experiment
        if e.grid_s is not None or self.floor <= 0.0 or self.error(0) < PLAINLY * self.floor:
            return 0
        most = min(len(e.output) // 4, int(2.0 / e.drive.interval_s))
        if most < 1:
            return 0
        size = 1 << (2 * len(self.simulated) - 1).bit_length()
        measured, expected = e.output - e.output.mean(), self.simulated - self.simulated.mean()
        correlation = np.fft.irfft(np.fft.rfft(measured, size) * np.conj(np.fft.rfft(expected, size)), size)
        around = np.concatenate((correlation[-most:], correlation[: most + 1]))
        middle = int(np.argmax(around)) - most
        best = min(range(middle - 2, middle + 3), key=self.error)
        return best if abs(best) > 1 and self.error(best) < 1.1 * self.floor else 0

    def vote(self, lag: int) -> int:
        """1 when this shift makes the recording fit better, −1 when worse, 0 when it is too slow to tell."""
        before, after = self.error(0), self.error(lag)
        if self.experiment.grid_s is not None or abs(after - before) < NEXT_TO_NOTHING * max(before, self.floor):
            return 0
        return 1 if after < before else -1

    def error(self, lag: int) -> float:
        """Standard deviation of the error after a shift."""
        measured, simulated = self.experiment.output, self.simulated
        if lag >= 0:
            return float(np.std(measured[lag:] - simulated[: len(simulated) - lag]))
        return float(np.std(measured[:lag] - simulated[-lag:]))


def _shifted(e: Experiment, lag: int) -> Experiment:
    """The experiment with its output moved earlier by `lag` samples; samples without partner are ignored."""
    moved = np.roll(e.output, -lag)
    lost = np.zeros(len(moved), dtype=np.bool_)
    if lag > 0:
        lost[-lag:] = True
    else:
        lost[:-lag] = True
    return replace(e, output=moved, invalid={**e.invalid, OUTPUT: np.roll(~e.valid, -lag) | lost})
