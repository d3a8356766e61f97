"""A recording made ready for a plant: what drives it, and what it is compared with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from hil.errors import FileError, SettingError, listed, option
from hil.identification.preparation.criteria import CRITERIA, EFFORT
from hil.identification.preparation.driven import FINER, PHASES, as_driven, stood_before, with_dither
from hil.identification.preparation.time_base import (
    held_grid,
    is_known_throughout,
    missing_of_even,
)
from hil.identification.uncertainty.noise import channel_floor, white_floor
from hil.language.note import Note
from hil.physics.model import Model
from hil.physics.plant import Parameters, Plant, Signal
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.invalid_samples import across, measured_rows
from hil.record.recording import Array, Channel, Mask, Recording, Samples, split_heading

OUTPUT = "output"  # among the names of a plant's inner signals
DEAD = Note("a dead sensor, no supply or a wrong column")


@dataclass(frozen=True, slots=True)
class Sine:
    """Samples first … first + count hold a sine that had settled when its procedure measured it."""

    frequency_hz: float
    first: int
    count: int


@dataclass(frozen=True, eq=False)
class Experiment:
    """One recording as a plant sees it.

    Attributes:
        name: of the recording.
        input, output_heading: the bound channels, as `name [unit]` in the units used.
        time_s: stamps of the samples.
        drive: the inputs on an even grid.
        grid_s: the grid's stamps when the recording's are uneven, else None.
        output: the measured output, shape (n,), in the plant's unit.
        observed: measured inner signals, by name, where the recording has them.
        invalid: samples that say nothing (clipped, held, lost), shape (n,), by inner signal, `OUTPUT` for the output's.
        reading_known: whether the recording (or a model) declared when in a sample the output is read.
        read_s: where the recording knows when every single sample was read: those instants for the output and the
            plant's inner signals, shape (1 + observed, n), else None. They lie on the time of `grid_s` then, and
            `drive.read_at` says nothing.
        skew_s: how much later than the output each row of `respond` was read, where that is the same in every sample.
        notes: what of the recording is used in another way than it was sampled, in words.
        is_late: whether the command is known before the first sample of the output: simulated from there, a unit that
            forgets its past is in its true state when the comparison begins.
        command_is_known: whether it was sampled apart from the output, and without a hole: gaps of the output say
            nothing of it.
        gain_stds: what calibrations state, as a relative standard uncertainty of the slope, by inner signal, `OUTPUT`
            and `""` for the command. The stated uncertainty is taken to belong to the largest reading.
        is_timed: whether the bench that made the recording timed its samples: their unit of time is no heading.
        stated_units: names of channels whose unit its user stated, `time` for that of the stamps: it is no mistake.
        ripples: what the command's dither adds to `drive.inputs` of a plant that rectifies it, at even phases, shape
            (PHASES, inputs, FINER * (m + n)), from m samples before the first on, in which the command stood as
            in the first; None where there is none.
        averaged: so many neighbouring samples are compared as one mean (see `hil.identification.preparation.averaged`).
        sines: those that had settled, in the order of time.
        root_counts: of samples that are means of several, the root of how many, shape (n,); `whole`: what they are
            means of (see `hil.identification.preparation.mean_period`). None where every sample is one.
    """

    name: str
    input: str
    output_heading: str
    time_s: Array
    drive: Drive
    grid_s: Array | None
    output: Array
    observed: Mapping[str, Array]
    reading_known: bool = False
    invalid: Mapping[str, Mask] = field(default_factory=dict)
    read_s: Array | None = None
    notes: tuple[Note, ...] = ()
    skew_s: tuple[float, ...] = ()
    is_late: bool = False
    command_is_known: bool = False
    gain_stds: Mapping[str, float] = field(default_factory=dict)
    is_timed: bool = False
    stated_units: frozenset[str] = frozenset()
    ripples: Array | None = None
    averaged: int = 1
    sines: tuple[Sine, ...] = ()
    root_counts: Array | None = None
    whole: Experiment | None = None

    def respond(
        self,
        plant: Plant,
        parameters: Parameters,
        effects: Sequence[ActiveEffect] = (),
        *,
        factor: float = 1.0,
        inject: tuple[str, Array] | None = None,
        following: bool = False,
    ) -> Array:
        """Simulated output and observed signals when the recording's own were read, shape (1 + observed, n).

        `factor` and `inject` as in `hil.physics.simulate.simulate`; `following`: led back to the recorded output.
        """
        measured = self.to_follow if following else None
        if self.ripples is None:
            rows = simulate(plant, parameters, self.drive, effects, factor=factor, inject=inject, measured=measured)
        else:
            # what the plant makes of a dither is the same at any phase but for its ripple, opposite at opposite ones
            each = [
                self._dithered(plant, parameters, effects, self.ripples[k], factor, inject) for k in (0, PHASES // 2)
            ]
            rows = (each[0] + each[1]) / 2.0
        if self.is_late and plant.integrates is not None and plant.integrates(parameters):
            grid_s, begins_s = self.time_s if self.grid_s is None else self.grid_s, self.time_s[self.valid][0]
            rows[0] += self.drive.first_output - np.interp(begins_s, grid_s, rows[0])  # where it stood then
        if self.grid_s is None or self.read_s is None:
            return self._skewed(self.at_stamps(rows))
        grid_s = self.grid_s
        return np.array([np.interp(read_s, grid_s, row) for read_s, row in zip(self.read_s, rows, strict=True)])

    def simulated(self, model: Model) -> Array:
        """Rows of `respond` of a model as it stands."""
        return self.respond(model.definition, model.values, model.active_effects)

    def by_dither(
        self, plant: Plant, parameters: Parameters, effects: Sequence[ActiveEffect] = ()
    ) -> tuple[Array, ...]:
        """What a dither of another phase may add to the rows of `respond`; none if there is no dither.

        Sine and cosine of it, and of its second harmonic: a dither that is cut off at the end of a range has one, and
        the two opposite phases of `respond` make the same of it.
        """
        if self.ripples is None:
            return ()
        each = np.array([self._skewed(self._dithered(plant, parameters, effects, ripple)) for ripple in self.ripples])
        turned = 2.0 * np.pi * np.arange(PHASES) / PHASES
        waves = [wave(harmonic * turned) for harmonic in (1, 2) for wave in (np.cos, np.sin)]
        return tuple(2.0 / PHASES * np.tensordot(wave, each, axes=1) for wave in waves)

    def _dithered(
        self, plant: Plant, parameters: Parameters, effects: Sequence[ActiveEffect], ripple: Array,
        factor: float = 1.0, inject: tuple[str, Array] | None = None,
    ) -> Array:  # fmt: skip
        before = ripple.shape[1] // FINER - len(self.time_s)
        held = np.pad(self.drive.inputs, ((0, 0), (before, 0)), mode="edge")
        finer = Drive(np.repeat(held, FINER, axis=1) + ripple, self.drive.first_output, self.drive.interval_s / FINER)
        given = (inject[0], np.repeat(np.pad(inject[1], (before, 0), mode="edge"), FINER)) if inject else None
        rows = simulate(plant, parameters, finer, effects, factor=factor, inject=given)
        read = FINER * (before + np.arange(len(self.time_s))) + round(FINER * self.drive.read_at)
        return rows[:, np.minimum(read, rows.shape[1] - 1)]

    def _skewed(self, rows: Array) -> Array:
        """Rows that were read a little later than the output, along straight lines between the samples."""
        if not any(self.skew_s):
            return rows
        for row, late_s in zip(rows, self.skew_s, strict=True):
            if self.grid_s is None and 0.0 < late_s < self.drive.interval_s:  # the usual case, several times as quick
                row[:-1] += late_s / self.drive.interval_s * np.diff(row)
            elif late_s:
                row[:] = np.interp(self.time_s + late_s, self.time_s, row)
        return rows

    def observed_errors(self, plant: Plant, rows: Array, noise: Mapping[str, float]) -> Iterator[Array]:
        """Simulated minus recorded inner signals, in units of the noise of those that have one; `rows` of `respond`.

        0 where they are lost. One after another: of a long recording each takes megabytes.
        """
        for signal, row in zip(plant.observed, rows[1:], strict=True):
            if signal.name in noise:
                error = row - self.observed[signal.name]
                error /= noise[signal.name]
                yield self.telling(error, signal.name)

    @property
    def valid(self) -> Mask:
        """Which samples of the output say something, shape (n,)."""
        return self.valid_in(OUTPUT)

    @property
    def valid_output(self) -> Array:
        """The output where it says something, one sample after another."""
        return self.output[self.valid]

    @cached_property
    def weight(self) -> float:
        """One over the least noise of the output: what its channel shows, and no less than 1e-4 of its span."""
        if self.whole is not None:
            return self.whole.weight
        return 1.0 / max(channel_floor(self.valid_output), 1e-4 * float(np.ptp(self.output)) or 1.0)

    @property
    def valid_observed(self) -> dict[str, Array]:
        """Inner signals where they say something, one sample after another."""
        return {name: values[self.valid_in(name)] for name, values in self.observed.items()}

    @property
    def count_lost(self) -> int:
        """How many samples no channel says anything at."""
        seen = np.any([self.valid_in(name) for name in (OUTPUT, *self.observed)], axis=0)
        return int(np.count_nonzero(~seen))

    def telling(self, errors: Array, name: str = OUTPUT) -> Array:
        """Errors of the output or of an inner signal, 0 where it says nothing, shape (n,)."""
        return np.where(self.invalid[name], 0.0, errors) if name in self.invalid else errors

    def valid_in(self, name: str) -> Mask:
        """Which samples of an inner signal, or of `OUTPUT`, say something, shape (n,)."""
        return ~self.invalid[name] if name in self.invalid else np.ones(len(self.output), dtype=np.bool_)

    def across_silence(self, errors: Array) -> Array:
        """Errors of the output, straight from one telling sample to the next where it says nothing, shape (n,).

        For filters with a memory: what was recorded there is no measurement, and would be felt after it.
        """
        if OUTPUT not in self.invalid:
            return errors
        telling = np.flatnonzero(self.valid)
        return np.interp(np.arange(len(errors)), telling, errors[telling]) if telling.size else errors

    @property
    def duration_s(self) -> float:
        """From the first stamp to the last."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def interval_s(self) -> float:
        """The median interval of the samples; that of the drive's grid is `drive.interval_s`."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def stands_still(self) -> bool:
        """Whether the output has one value all the time."""
        return float(np.ptp(self.output)) == 0.0

    @property
    def where_it_stands(self) -> Note:
        """The channel and its value, for an operator."""
        return Note("channel '{channel}' stands at {at:.4g} all the time",
                    channel=self.output_heading, at=self.output[0])  # fmt: skip

    @property
    def to_follow(self) -> Array:
        """The recorded output on the grid, NaN where it says nothing."""
        recorded = np.where(self.valid, self.output, np.nan)
        return recorded if self.grid_s is None else np.interp(self.grid_s, self.time_s, recorded)

    def at_stamps(self, rows: Array) -> Array:
        """Rows on the grid, read at the recording's stamps."""
        if self.grid_s is None:
            return rows
        return np.array([np.interp(self.time_s, self.grid_s, row) for row in rows])

    def on_grid_input(self) -> Array:
        """The command at the recording's stamps, shape (n,)."""
        return self.at_stamps(self.drive.inputs)[0]

    def without(self, samples: Mask, name: str = OUTPUT) -> Experiment:
        """The same with more samples of the output, or of an inner signal, left out, shape (n,)."""
        return replace(self, invalid={**self.invalid, name: ~self.valid_in(name) | samples})

    def without_all(self, samples: Mask) -> Experiment:
        """The same with more samples of every channel left out, shape (n,)."""
        return replace(self, invalid={name: ~self.valid_in(name) | samples for name in (OUTPUT, *self.observed)})

    def driven(self, inputs: Array) -> Experiment:
        """The same with other inputs on its grid, shape (inputs, n)."""
        return replace(self, drive=replace(self.drive, inputs=inputs))

    def reading_at(self, read_at: float) -> Experiment:
        """The same with another reading instant, unless the instants are known one by one."""
        return self if self.read_s is not None else replace(self, drive=replace(self.drive, read_at=read_at))

    def reading_as_in(self, model: Model) -> Experiment:
        """The same read when the model's recordings were, where nothing tells when this one was."""
        return self if self.reading_known else self.reading_at(model.read_at)


def experiment(
    recording: Recording,
    plant: Plant,
    input_name: str | Sequence[str] | None = None,
    output_name: str | None = None,
    read_at: float | None = None,
) -> Experiment:
    """Bind a recording to a plant by channel names.

    A command acts as its output drives it and holds between its samples; the output is compared when it was sampled.

    Args:
        recording: what was measured.
        plant: what it is bound to.
        input_name: of the command, or of the plant's inputs in their order, if not the plant's own names.
        output_name: of the response, likewise.
        read_at: the reading instant, if it is known.

    Raises:
        FileError: a channel is missing, or the input never changes.
        UnitError: a channel's unit does not convert to the plant's.
    """
    names = _input_names(plant, input_name)
    output_name = output_name or plant.output.name
    _check_named(recording, plant, names[0], output_name)
    with_dithers = with_dither(stood_before(recording)) if plant.rectifies and recording.is_even() else ()
    recording, sampled = as_driven(recording), len(recording)
    recording = measured_rows(recording, names)
    stated = _gain_stds(recording, names[0], output_name, plant)
    sines = _sines(recording) if len(recording) == sampled else ()
    units = [_unit_in(recording, signal, name) for signal, name in zip(plant.inputs, names, strict=True)]
    unit = _unit_in(recording, plant.output, output_name)
    headings = f"{names[0]} [{units[0]}]", f"{output_name} [{unit}]"
    at = declared_read_at(recording) if read_at is None else read_at
    given = [recording.samples(name, unit) for name, unit in zip(names, units, strict=True)]
    waves = [[one.values(name, unit) for name, unit in zip(names, units, strict=True)] for one in with_dithers]
    taken = {OUTPUT: recording.samples(output_name, unit)}
    taken |= {s.name: recording.samples(s.name, s.unit) for s in plant.observed if s.name in recording.channels}
    compared = [output_name, *(signal.name for signal in plant.observed)]
    stamps = np.array([recording.stamps(n) if n in recording.channels else recording.time_s for n in compared])
    if any(name in recording.own for name in (*names, *compared)):
        adds_up = plant.observer is not None
        return replace(_on_own_stamps(recording, headings, given, taken, at, adds_up=adds_up), gain_stds=stated)
    read_s = None if (stamps == recording.time_s).all() else stamps
    at, skew_s = (at, _skew_s(recording, compared, at or 0.0)) if read_s is None else (0.0, ())
    inputs = np.array([one.values for one in given])
    channels = {name: across(one.values) for name, one in taken.items()}
    invalid = {name: lacking for name, (_, lacking) in channels.items() if lacking.any()}
    observed = {name: values for name, (values, _) in channels.items()}
    output = observed.pop(OUTPUT)
    grid_s, on_grid, interval_s = _even(recording, inputs, read_s)
    ripples = None
    if waves and grid_s is None and len(recording) == sampled:
        driven = np.array(waves)
        held = np.pad(on_grid, ((0, 0), (driven.shape[2] // FINER - sampled, 0)), mode="edge")
        ripples = driven - np.repeat(held, FINER, axis=1)
    drive = Drive(on_grid, _at_rest(inputs, output), interval_s, at or 0.0)
    if any(skew_s):
        late_s = dict(zip((signal.name for signal in plant.observed), skew_s[1:], strict=True))
        bent = {name: _bends(values, late_s[name] / interval_s) for name, values in observed.items()}
        invalid |= {name: samples | invalid.get(name, False) for name, samples in bent.items() if samples.any()}
    return Experiment(
        recording.name, *headings, recording.time_s, drive, grid_s, output, observed, at is not None, invalid,
        read_s=read_s, gain_stds=stated,
        ripples=ripples, skew_s=skew_s, is_timed="sampling" in recording.meta,
        stated_units=frozenset(recording.meta.get("stated_units", ())),
        sines=sines,
    )  # fmt: skip


def _sines(recording: Recording) -> tuple[Sine, ...]:
    """Those that a procedure found steady."""
    steady = (part for part in recording.meta.get("parts", ()) if part.get("kind") == "sine" and part.get("steady"))
    sines = (Sine(float(part["frequency_hz"]), int(part["first"]), int(part["count"])) for part in steady)
    return tuple(sine for sine in sines if sine.first + sine.count <= len(recording))


def _bends(values: Array, late: float) -> Mask:
    """Samples beside which a channel bends so much that straight lines do not tell it `late` samples later, shape (n,).

    A corner between two samples shows in what was read of it only from the corner on.
    """
    bend = np.abs(np.diff(values, 2, prepend=values[0], append=values[-1]))
    within = (values > values.min()) & (values < values.max())  # at the end of a range there is no noise
    beyond = bend * abs(late) > CRITERIA.felt_bend * white_floor(values[within])
    beyond[:-1] |= beyond[1:].copy()
    return beyond


def _gain_stds(recording: Recording, command: str, output: str, plant: Plant) -> dict[str, float]:
    named = {"": command, OUTPUT: output, **{signal.name: signal.name for signal in plant.observed}}
    found = {}
    for role, name in named.items():
        if (channel := recording.channels.get(name)) is None:
            continue
        stated, largest = channel.calibration.get("uncertainty"), float(np.nanmax(np.abs(channel.values), initial=0.0))
        if stated and largest > 0.0:
            found[role] = float(stated) / 2.0 / largest
    return found


def _input_names(plant: Plant, given: str | Sequence[str] | None) -> list[str]:
    """Channels of the plant's inputs: those given, in the plant's order, then its own names."""
    named = [given] if isinstance(given, str) else list(given or ())
    if len(named) > len(plant.inputs):
        raise SettingError(f"{plant.name} has {len(plant.inputs)} inputs, {len(named)} were named: {', '.join(named)}")
    return [
        *(name for name in named if name),
        *(signal.name for signal in plant.inputs[len([n for n in named if n]) :]),
    ]


def _on_own_stamps(
    recording: Recording, headings: tuple[str, str], given: Sequence[Samples], taken: Mapping[str, Samples],
    at: float | None, *, adds_up: bool,
) -> Experiment:  # fmt: skip
    """An experiment of channels that were sampled at different times: commands are held, the output stays as it was.

    Args:
        recording: of them.
        headings: of the command and of the output.
        given: the commands.
        taken: the output (`OUTPUT`), and inner signals by name. Slower ones, which would count more than once, are
            left out.
        at: the reading instant, None where nobody knows it.
        adds_up: whether the unit is a loop that adds up.
    """
    output = taken[OUTPUT]
    first, last = max(one.time_s[0] for one in given), recording.time_s[-1]
    kept = (output.time_s >= first - 1e-9) & (output.time_s <= last + recording.interval_s)
    if np.count_nonzero(kept) < CRITERIA.fewest_samples:
        command, answer = (split_heading(heading)[0] for heading in headings)
        raise FileError(
            f"{recording.name}: '{answer}' has {np.count_nonzero(kept)} samples while '{command}' is known; at "
            f"least {CRITERIA.fewest_samples} are needed"
        )
    output = Samples(output.time_s[kept], output.values[kept])
    # a loop that adds up starts at its first reading; what went before tells nobody where it stood
    begins_s = float(output.time_s[0] if adds_up else min(first, output.time_s[0]))
    grid_s, interval_s = held_grid(given, output.time_s, begins_s)
    ignored = missing_of_even(grid_s, output.time_s, interval_s)
    known = all(map(is_known_throughout, given))
    held = output.held_at(grid_s)
    inputs, at_samples = (np.array([one.held_at(at_s) for one in given]) for at_s in (grid_s, output.time_s))
    is_late = bool(output.time_s[0] - grid_s[0] > 0.5 * interval_s)
    if is_late and ignored is not None and not ignored[int(np.argmin(ignored)) :].any():
        ignored = None  # nothing is missing once it has begun
    inner = {name: one for name, one in taken.items() if name != OUTPUT}
    usual_s = np.median(np.diff(output.time_s))
    slow = [name for name, one in inner.items() if np.median(np.diff(one.time_s)) > 1.05 * usual_s]
    notes = [
        Note("'{channel}' is sampled more slowly than the output and is not compared", channel=name).of(recording.name)
        for name in slow
    ]
    observed = {n: np.interp(output.time_s, one.time_s, one.values) for n, one in inner.items() if n not in slow}
    drive = Drive(inputs, _at_rest(at_samples, output.values), interval_s, at or 0.0)
    bound = Experiment(
        recording.name, *headings, output.time_s, drive, grid_s, output.values, observed, at is not None,
        notes=tuple(notes), is_late=is_late,
    )  # fmt: skip
    if ignored is not None and not observed:
        return replace(bound, time_s=grid_s, grid_s=None, output=held, invalid={OUTPUT: ignored})
    on_grid = len(grid_s) == len(output.time_s) and bool(np.all(np.abs(grid_s - output.time_s) < 1e-3 * interval_s))
    return replace(bound, grid_s=None if on_grid else grid_s, command_is_known=known)


def _at_rest(inputs: Array, output: Array) -> float:
    """Where the output stands at the start: its mean while no input has moved and it shows no motion; else its first.

    One noisy sample as the start would leave a loop an error to correct, which play or friction then keep.
    """
    moved = np.flatnonzero((inputs != inputs[:, :1]).any(axis=0))
    count = int(moved[0]) if moved.size else len(output)
    while count >= CRITERIA.fewest_at_rest:
        early, late = output[: count // 2], output[count // 2 : count]
        uncertainty = np.hypot(np.std(early), np.std(late)) / np.sqrt(count / 2.0)
        if abs(early.mean() - late.mean()) <= CRITERIA.significant * uncertainty:
            return float(output[:count].mean())
        count //= 2
    return float(output[0])


def for_model(
    model: Model,
    recording: Recording,
    input_name: str | Sequence[str] = "",
    output_name: str = "",
    *,
    output_needed: bool = True,
) -> Experiment:
    """Bind a recording to a model: its channels (other names may be given) and its reading instant.

    Args:
        model: with the names of its channels.
        recording: what was measured.
        input_name: of the command, if not the model's own.
        output_name: of the response, if not the model's own.
        output_needed: no: a recording without the response is bound too, to be simulated; the response is NaN then.

    Raises:
        FileError: a channel is missing.
        UnitError: a channel's unit does not convert to the plant's.
    """
    plant = model.definition
    output_name = output_name or split_heading(model.output)[0]
    if output_name not in recording.channels and not output_needed:
        nothing = Channel(output_name, plant.output.unit, np.full(len(recording), np.nan))
        recording = replace(recording, channels={**recording.channels, output_name: nothing})
    named = [input_name] if isinstance(input_name, str) else list(input_name)
    input_name = [named[0] if named and named[0] else split_heading(model.input)[0], *named[1:]]
    return experiment(recording, plant, input_name, output_name, model.read_at)


def declared_read_at(recording: Recording) -> float | None:
    """The reading instant that the bench promised for this recording, None when it says nothing."""
    value = _promised(recording).get("read_at")
    return None if value is None else float(value)


def _promised(recording: Recording) -> Mapping[str, Any]:
    """What the bench promised of the sampling; nothing where the header says nothing that can be read."""
    sampling = recording.meta.get("sampling")
    return sampling if isinstance(sampling, Mapping) else {}


def _check_named(recording: Recording, plant: Plant, input_name: str, output_name: str) -> None:
    for role, name in (("input", input_name), ("output", output_name)):
        if name in recording.channels:
            continue
        have = listed(one.heading for one in recording.channels.values() if not np.isnan(one.values).all())
        alike = [known for known in recording.channels if known.casefold() == name.casefold()]
        hint = f", did you mean '{alike[0]}'?" if alike else ";"
        at_simulate = option(f"{role}-name")
        also = f", in hil simulate with {at_simulate}" if at_simulate.startswith("--") else ""
        raise FileError(
            f"{recording.name}: no channel '{name}', the {role} of {plant.name}{hint} it has: {have}; "
            f"name its channel with {option(role, 'NAME')}{also}"
        )


def _unit_in(recording: Recording, signal: Signal, name: str) -> str:
    """The plant's unit of a signal, or that of its channel where the plant takes any."""
    return recording.channels[name].unit if signal.unit == "any" else signal.unit


def _skew_s(recording: Recording, names: Sequence[str], read_at: float) -> tuple[float, ...]:
    """How much later than `read_at` says the output and the inner signals were read, as the header states it."""
    delays = _promised(recording).get("delay_s")
    if not isinstance(delays, Mapping):
        return ()
    at_s = read_at * recording.interval_s
    return tuple(float(delays.get(name, at_s)) - at_s for name in names)


def _even(recording: Recording, inputs: Array, read_s: Array | None) -> tuple[Array | None, Array, float]:
    if read_s is None and recording.is_even():
        return None, np.ascontiguousarray(inputs), recording.interval_s
    # Uneven stamps: inputs are held on a finer even grid, outputs are read at the stamps they really had.
    interval_s = recording.interval_s / EFFORT.grid_per_sample
    start, stop = (
        recording.time_s[0],
        recording.time_s[-1] if read_s is None else max(recording.time_s[-1], read_s.max()),
    )
    grid_s = start + interval_s * np.arange(int(np.ceil((stop - start) / interval_s)) + 1)
    # A stamp that falls on the grid must not miss it by a rounding error: its input would come a step late.
    reached = np.searchsorted(recording.time_s, grid_s + 1e-6 * interval_s, side="right")
    held = np.clip(reached - 1, 0, len(recording) - 1)
    return grid_s, np.ascontiguousarray(inputs[:, held]), interval_s


def sample_intervals_s(experiments: Sequence[Experiment]) -> list[float]:
    """The intervals at which these were recorded, each once, in ascending order."""
    return sorted({float(f"{e.interval_s:.6g}") for e in experiments})


def require_excitation(experiments: Sequence[Experiment]) -> None:
    """Raise `FileError` when a recording is too short to tell anything, or no output or its input moves."""
    for e in experiments:
        count = int(np.count_nonzero(e.valid))
        if count < CRITERIA.fewest_samples:
            of = "" if count == len(e.output) else f" of '{e.output_heading}' that were measured"
            raise FileError(f"{e.name}: {count} samples{of}; at least {CRITERIA.fewest_samples} are needed to identify")
    telling = [e for e in experiments if not e.stands_still] or experiments
    if all(np.ptp(e.drive.inputs[0]) == 0.0 for e in telling):
        names = ", ".join(e.name for e in telling)
        raise FileError(f"{names}: the input never changes; nothing can be identified from a constant input")
    if all(e.stands_still for e in experiments):
        e = experiments[0]
        raise FileError(
            Note("{stands}, and so in every recording: {why}", stands=e.where_it_stands, why=DEAD).of(e.name)
        )
