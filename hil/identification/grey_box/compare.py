"""Model against recording: the fit, what the noise allows, and where the model fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hil.arrays import LEAST, ROUNDING
from hil.identification.grey_box.criteria import EFFORT
from hil.identification.preparation.experiment import DEAD, Experiment
from hil.identification.preparation.gaps import bridged
from hil.identification.preparation.plausibility.look import suspicions
from hil.identification.preparation.recording_quality import without_invalid
from hil.identification.preparation.start_in_motion import begun_in_motion
from hil.identification.uncertainty.fit import fit_ceiling, fit_percent, rms
from hil.identification.uncertainty.noise import channel_floor, noise_in
from hil.language.note import Note
from hil.physics.model import Model
from hil.record.recording import Array, split_heading
from hil.record.run_folder.progress import Progress, quiet
from hil.record.simulated import marked


@dataclass(frozen=True, slots=True)
class Interval:
    """A stretch of time with the rms error there."""

    start_s: float
    stop_s: float
    rms: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """One model on one recording.

    Attributes:
        fit, ceiling: in %; the ceiling is what the true model would reach, given the noise, and never below a fit that
            is reached. None where the output stands still.
        rms_error, noise_std: in `unit`, the output's unit.
        mean_error: simulated minus measured.
        lag_s: by how much the model is late (positive) or early, where the error is least; None where one of them
            does not move.
        worst: where the error is largest, in time.
        by_level: rms error over the lower, middle and upper third of the model's output.
        notes: what of the recording says nothing and is left out, in words.
        simulated: whether the recording is of a simulated valve.
    """

    name: str
    unit: str
    fit: float | None
    ceiling: float | None
    rms_error: float
    noise_std: float
    mean_error: float
    lag_s: float | None
    worst: tuple[Interval, ...]
    by_level: tuple[float, float, float]
    notes: tuple[Note, ...]
    simulated: bool = False

    @property
    def headline(self) -> Note:
        """The fit in words."""
        if self.fit is None or self.ceiling is None:
            return Note("no fit: the output stands still")
        return Note("fit {fit:.2f} % (the noise allows {ceiling:.2f} %)", fit=self.fit, ceiling=self.ceiling)

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return {"file": self.name, **{k: v for k, v in asdict(self).items() if k != "name"}}

    def as_text(self) -> str:
        """As lines for a terminal."""
        worst = ", ".join(f"{i.start_s:.4g}…{i.stop_s:.4g} s ({i.rms:.3g})" for i in self.worst)
        low, middle, high = self.by_level
        late = "" if self.lag_s is None else f", model {_late(self.lag_s)}"
        notes = "".join(f"\n  note: {note}" for note in self.notes)
        return (
            f"{marked(self.name, simulated=self.simulated)}\n"
            f"  {self.headline}, "
            f"rms error {self.rms_error:.4g} {self.unit}, noise {self.noise_std:.3g} {self.unit}\n"
            f"  mean error {self.mean_error:+.3g} {self.unit}{late}\n"
            f"  largest errors at {worst}\n"
            f"  rms by level: low {low:.3g}, middle {middle:.3g}, high {high:.3g} {self.unit}{notes}"
        )


def _late(lag_s: float) -> str:
    by_ms = f"{1e3 * abs(lag_s):.1f}"
    return "neither late nor early" if float(by_ms) == 0.0 else f"{'early' if lag_s < 0.0 else 'late'} by {by_ms} ms"


def compare_all(model: Model, experiments: Sequence[Experiment], progress: Progress = quiet) -> list[Comparison]:
    """Each recording as `compare` does, with what looks wrong in it beside this model among its notes."""
    found = []
    for i, e in enumerate(experiments):
        progress(i / (len(experiments) + 1), f"{e.name}: the model beside {len(e.output)} samples")
        found.append(compare(model, e))
    progress(len(experiments) / (len(experiments) + 1), "checking units, signs and channels")
    implausible_metadata = list(suspicions(model, experiments))
    return [
        replace(
            one, notes=(*one.notes, *(wrong.sentence for wrong in implausible_metadata if wrong.recording == one.name))
        )
        for one in found
    ]


def compare(model: Model, experiment: Experiment) -> Comparison:
    """Simulate a model on a recording's input and measure the difference, where the recording says something."""
    measured_only, left_out = without_invalid(experiment)
    (even,), notes = bridged(model, [measured_only])
    e, moved = begun_in_motion(model, even)
    notes = (*left_out, *notes, *moved, *experiment.notes)
    response = e.simulated(model)[0]
    time_s, measured, simulated = e.time_s[e.valid], e.output[e.valid], response[e.valid]
    error = simulated - measured
    noise = noise_in(model.noise, channel_floor(measured)).std
    fit = fit_percent(measured, simulated)
    moves = not e.stands_still
    if not moves:
        notes = (*notes, Note("{stands}: no fit can be stated; {why}", stands=e.where_it_stands, why=DEAD))
    elif np.ptp(e.drive.inputs[0]) == 0.0:
        constant = Note(
            "channel '{channel}' never changes: what is compared is a level and no dynamics", channel=e.input
        )
        notes = (*notes, constant.of(e.name))
    return Comparison(
        e.name,
        split_heading(e.output_heading)[1],
        fit if moves else None,
        max(fit, fit_ceiling(measured, noise)) if moves else None,
        rms(error),
        noise,
        float(error.mean()),
        _lag(time_s, measured, simulated),
        _worst(time_s, error),
        _by_level(simulated, error),
        notes,
    )


def _worst(time_s: Array, error: Array) -> tuple[Interval, ...]:
    parts = np.array_split(np.arange(len(error)), min(EFFORT.compared_blocks, len(error)))
    found = [Interval(float(time_s[p[0]]), float(time_s[p[-1]]), rms(error[p])) for p in parts]
    return tuple(sorted(found, key=lambda i: -i.rms)[: EFFORT.worst])


def _by_level(simulated: Array, error: Array) -> tuple[float, float, float]:
    low, high = np.quantile(simulated, [1 / 3, 2 / 3])
    bins = np.digitize(simulated, [low, high])
    first, second, third = (rms(error[bins == k]) for k in range(3))
    return first, second, third


def _lag(time_s: Array, measured: Array, simulated: Array, steps: int = 10) -> float | None:
    """The shift of the model that leaves the least error: to a sample by correlation, then by Gauss-Newton."""
    if np.ptp(simulated) <= ROUNDING * float(np.abs(simulated).max()) or np.ptp(measured) == 0.0:
        return None
    even_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    model, unit = (np.interp(even_s, time_s, one - one.mean()) for one in (simulated, measured))
    size = 1 << (2 * len(even_s)).bit_length()
    alike = np.fft.irfft(np.fft.rfft(model, size) * np.conj(np.fft.rfft(unit, size)), size)
    late_s = float(((int(np.argmax(alike)) + len(even_s)) % size - len(even_s)) * (even_s[1] - even_s[0]))
    slope = np.gradient(simulated, time_s)

    def beside(shift_s: float) -> tuple[Array, Array]:
        """The error and the slope where both were recorded."""
        at = time_s + shift_s
        both = (at >= time_s[0]) & (at <= time_s[-1])
        return measured[both] - np.interp(at[both], time_s, simulated), np.interp(at[both], time_s, slope)

    late_s = min((0.0, late_s), key=lambda shift_s: rms(beside(shift_s)[0]))
    for _ in range(steps):
        error, there = beside(late_s)
        closer_s = late_s + float(there @ error) / max(float(there @ there), LEAST)
        if abs(closer_s) >= time_s[-1] - time_s[0] or rms(beside(closer_s)[0]) >= rms(error):
            break
        late_s = closer_s
    return late_s
