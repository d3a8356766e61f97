"""The flow curve of recordings of one's own: what `hil run flow_curve` reads from its sweeps, from sweeps as found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import InputError, SettingError
from hil.identification.preparation.clipped import clipped_note
from hil.identification.steady.characteristic import (
    largest_slope,
    level_at,
    loop,
    over_all,
    polyline,
    reaches_both_sides,
    side,
    symmetry,
    worst_departure,
)
from hil.identification.steady.flow_curve import monotone, polynomial, polynomial_text
from hil.identification.steady.own_sweeps import OwnSweeps, own_sweeps
from hil.identification.steady.sweep_estimate import SweepEstimate, sweep_estimate, together
from hil.language.note import Note
from hil.record.csv_text import write_table
from hil.record.invalid_samples import measured_rows
from hil.record.plain import plain
from hil.record.recording import Array, Recording, split_heading
from hil.session.analyses import channels_of
from hil.signals.interval import CERTAIN, UNIFORM, rounded, width
from hil.signals.rounding import rounding_step

DEGREE = 9


@dataclass(frozen=True, slots=True)
class Figure:
    """A number of the curve; `std` is its standard uncertainty, from noise alone."""

    name: str
    value: float
    std: float
    unit: str

    def __str__(self) -> str:
        return f"{self.name:20} {rounded(self.value, self.std):>12} {width(self.std)} {self.unit}"


@dataclass(frozen=True, slots=True)
class FlowAnalysis:
    """A steady curve and what is read from it.

    Attributes:
        input, output: headings, `name [unit]`.
        command: levels, rising, shape (n,).
        rising, falling, std: the branches with the lag taken out, and the uncertainty of the curve between them.
        figures: dead band, gains, hysteresis and so on, as the procedure `flow_curve` calls them.
        polynomial, spline: of the curve between the branches, at the levels.
        polynomial_text: the polynomial as a sum of powers. `degree`: of it.
        notes: what the reader should know.
    """

    input: str
    output: str
    command: Array
    rising: Array
    falling: Array
    std: Array
    figures: tuple[Figure, ...]
    polynomial: Array
    spline: Array
    polynomial_text: str
    degree: int
    notes: tuple[Note, ...]

    @property
    def columns(self) -> dict[str, Array]:
        """The curve as `hil analyse compose` takes it, by heading."""
        unit = split_heading(self.output)[1]
        curves = {"rising": self.rising, "falling": self.falling, "std": self.std,
                  f"polynomial of degree {self.degree}": self.polynomial}  # fmt: skip
        named = {f"{name} [{unit}]": values for name, values in curves.items()}
        return {self.input: self.command, self.output: self.spline, **named}

    def as_text(self) -> str:
        """As lines for a terminal."""
        low, high = (float(round(end, 6 - round(math.log10(np.ptp(self.command))))) for end in self.command[[0, -1]])
        rows = [f"{self.output} over {self.input}, {low + 0.0:g} … {high:g}"]
        rows += [f"  {figure}" for figure in self.figures]
        rows.append(f"  polynomial {self.polynomial_text}")
        return "\n".join([*rows, *(f"  note: {note}" for note in self.notes)])

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return plain({
            "schema": "hil.flow-curve/1", "input": self.input, "output": self.output,
            "values": self.figures,
            "degree": self.degree, "polynomial": self.polynomial_text,
            "curve": [{"name": name, "values": values} for name, values in self.columns.items()],
            "notes": self.notes,
        })  # fmt: skip

    def write(self, path: Path) -> None:
        """The curve as CSV. Raises `StorageError`."""
        write_table(self.columns, np.column_stack(list(self.columns.values())).tolist(), path)


def flow_analysis(
    recordings: Sequence[Recording],
    input_name: str = "",
    output_name: str = "",
    degree: int = DEGREE,
    neutral: float = 0.0,
) -> FlowAnalysis:
    """The curve of the sweeps that recordings hold.

    Args:
        recordings: of one valve; sweeps at two speeds tell lag from hysteresis.
        input_name: the command; where not given, as the first recording declares it.
        output_name: the response, likewise.
        degree: of the polynomial.
        neutral: command from which both sides go; a sweep that stays on one side of it goes one way.

    Raises:
        FileError: nobody says which channels they are. InputError: no sweep, or no response beyond the noise.
        SettingError: a degree that is none.
    """
    if not 1 <= degree <= 30:
        raise SettingError(f"degree {degree}: a polynomial of degree 1 to 30")
    names = channels_of(recordings[0], input_name, output_name)
    rows = [measured_rows(one, names) for one in recordings]
    given, answer = (rows[0].channel(name) for name in names)
    for one in rows[1:]:
        for channel in (given, answer):
            if one.channel(channel.name).unit != channel.unit:
                raise InputError(f"{one.name}: '{channel.name}' is not in {channel.unit}, as in {rows[0].name}")
    found = own_sweeps(rows, *names, neutral=neutral)
    clipped = [note for one in rows for note in clipped_note(one.name, names[1], one.values(names[1]))]
    estimate = sweep_estimate(rows[0].name, found.sweeps, found.standing)
    figures, notes = _figures(found, estimate, (given.unit, answer.unit), neutral, rounding_step(answer.values))
    at = polyline()
    command, response = estimate.command[at], estimate.response[at]
    rising, falling = (estimate.completed_branch(sign)[at] for sign in (1, -1))
    return FlowAnalysis(
        given.heading, answer.heading, command, rising, falling, np.std(estimate.responses, axis=0)[at], figures,
        polynomial(command, response, degree)(command), monotone(command, response)(command),
        polynomial_text(command, response, degree), degree, (*found.notes, *clipped, *notes),
    )  # fmt: skip


def _figures(
    found: OwnSweeps, estimate: SweepEstimate, units: tuple[str, str], neutral: float, step: float
) -> tuple[tuple[Figure, ...], tuple[Note, ...]]:
    unit_in, unit_out = units
    low, high = float(estimate.command[0]), float(estimate.command[-1])
    ends = {sign: _end(found, estimate, sign) for sign in (1, -1)}
    made = [Figure("response_high", *ends[1], unit_out), Figure("response_low", *ends[-1], unit_out)]
    of_loop, notes = _loop(found, estimate, high - low, unit_in)
    made += of_loop
    if reaches_both_sides(low, high, neutral):
        made += _both_ways(found, estimate, ends, units, neutral, step)
    else:
        half = _half(estimate, ends)
        gain, steepest = largest_slope(estimate, [sweep.speed_per_s for sweep in found.sweeps])
        made += [Figure("command_half", *half, unit_in), Figure("gain_largest", *gain, f"{unit_out} per {unit_in}")]
        notes.append(Note("steepest at {at:.4g} {unit}: a good bias for dynamic tests", at=steepest, unit=unit_in))
        one_sided = Note(
            "the command stays on one side of {neutral:g} {unit}: a dead band and the symmetry need a sweep over both",
            neutral=neutral, unit=unit_in,
        )  # fmt: skip
        notes.append(one_sided)
    return tuple(made), tuple(notes)


def _end(found: OwnSweeps, estimate: SweepEstimate, sign: int) -> tuple[float, float]:
    """(response at an end, its standard uncertainty): where the command waited there, else of the curve.

    Where the command turned at once, a loop of hysteresis has closed by half its width, one of lag has not. Of one
    speed, which of them it is is not known: the end lies between the two.
    """
    waits = [one for one in found.standing if one.risen == (sign > 0)]
    if waits:
        end = together(waits)
        return end.response, end.std
    place = -1 if sign > 0 else 0
    response, std = float(estimate.response[place]), float(np.std(estimate.responses[:, place]))
    closed = sign * 0.5 * estimate.mean_width_or_all * float(estimate.slope[place])
    if math.isnan(estimate.mean_width):
        return response - 0.5 * closed, math.hypot(std, UNIFORM * closed)
    return response - closed, std


def _half(estimate: SweepEstimate, ends: dict[int, tuple[float, float]]) -> tuple[float, float]:
    """(command of half the way from end to end, its standard uncertainty): of the curve and of the ends."""
    level, level_std = (ends[1][0] + ends[-1][0]) / 2.0, math.hypot(ends[1][1], ends[-1][1]) / 2.0
    at, std = over_all(estimate, lambda curve, _: level_at(estimate.command, curve, level))
    slope = float(np.interp(at, estimate.command, estimate.slope))
    return at, math.hypot(std, level_std / slope)


def _loop(found: OwnSweeps, estimate: SweepEstimate, span: float, unit: str) -> tuple[list[Figure], list[Note]]:
    between = loop(estimate, CERTAIN, tuple(sweep.speed_per_s for sweep in found.sweeps))
    if between.width is None or between.lag is None:
        width = 2.0 * abs(float(estimate.half_widths[0]))
        std = 2.0 * float(np.std(estimate.resampled_half_widths[:, 0]))
        note = Note(
            "the loop is {width:.3g} {unit} wide; of one speed, how much of it is lag is not identifiable: sweep at "
            "half the speed too",
            width=width, unit=unit,
        )  # fmt: skip
        return [Figure("loop", 100.0 * width / span, 100.0 * std / span, "%")], [note]
    width, std = between.width
    lag_s, lag_std_s = between.lag
    return [
        Figure("hysteresis", 100.0 * width / span, 100.0 * std / span, "%"),
        Figure("lag", 1e3 * lag_s, 1e3 * lag_std_s, "ms"),
    ], []


def _both_ways(
    found: OwnSweeps, estimate: SweepEstimate, ends: dict[int, tuple[float, float]], units: tuple[str, str],
    neutral: float, step: float,
) -> list[Figure]:  # fmt: skip
    unit_in, unit_out = units
    beside = over_all(estimate, lambda curve, _: float(np.interp(neutral, estimate.command, curve)))
    zero, zero_std = found.at_rest or beside
    sides = {sign: side(estimate, neutral, (zero, zero_std), ends[sign], sign, step) for sign in (1, -1)}
    named = [(1, "positive"), (-1, "negative")]
    made = [Figure(f"dead_band_{word}", *sides[sign].edge, unit_in) for sign, word in named]
    made += [Figure(f"gain_{word}", *sides[sign].gain, f"{unit_out} per {unit_in}") for sign, word in named]
    departure, departure_std = worst_departure(sides.values())
    return [
        *made,
        Figure("symmetry", *symmetry(sides.values()), "1"),
        Figure("linearity", 100.0 * departure, 100.0 * departure_std, "%"),
        Figure("leakage", zero, zero_std, unit_out),
    ]
