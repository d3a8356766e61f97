"""Flow over valve pressure drop: steady flow at full command while the supply pressure is adjusted.

The flow follows a power of the pressure drop; the one at the rated drop is read from it. Needs an output with the role
`supply pressure`, and the channels `supply pressure` and `return pressure`; a `load pressure` is taken off.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.language.note import Note
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Recording
from hil.rig import Rig
from procedures._definitions import PRESSURE_DROPS, defined
from procedures._recorded import departures, parts_of, roles_of
from procedures._scale import scale_of
from procedures._settings import NotNegative, Percent, Positive, PositivePercent
from procedures._supplies import KIND, Points, by_command, drive_supplies

FLOW = Measurement("flow", "", "steady response at a command and a supply pressure")
DROP = Measurement("pressure_drop", "bar", "valve pressure drop of that flow")
EXPONENT = Measurement("flow_exponent", "", "power of the pressure drop that the flow follows")
RATED = Measurement("rated_flow", "", "flow at the rated valve pressure drop")
MEASUREMENTS = defined(PRESSURE_DROPS, EXPONENT, RATED, FLOW, DROP)


def run(
    rig: Rig,
    *,
    commands: tuple[Percent, ...] | None = None,
    supplies: tuple[PositivePercent, ...] = (50.0, 75.0, 100.0, 150.0, 200.0),
    rated_drop: Positive = 70.0,  # noqa: ARG001 — for the evaluation
    hold_s: Positive = 4.0,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive every command at every supply pressure.

    Args:
        rig: the bench.
        commands: in % of full command from neutral; the ends of its range when not given.
        supplies: supply pressures, in % of the bench's own.
        rated_drop: valve pressure drop at which the rated flow is stated, in bar.
        hold_s: time at each command; the second half is measured, in s.
        warm_up_s: time at the first command before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    scale = scale_of(rig, full_command)
    levels = scale.levels("commands", commands)
    drive_supplies(rig, scale, levels, supplies, "a flow over pressure drop", hold_s, warm_up_s, rate_hz)


def evaluate(recording: Recording) -> Findings:
    """Flow and pressure drop of every point, and the power law through those of one command."""
    laws: list[Measured] = []
    points: list[Measured] = []
    notes: list[Note] = []
    curves = []
    for label, parts in by_command(parts_of(recording, KIND)).items():
        law, found, curve, mine = _at(recording, label, parts)
        laws, points, notes = [*laws, *law], [*points, *found], [*notes, *mine]
        curves.append(curve)
    return Findings((*laws, *points), {"flow_over_pressure_drop": curves}, tuple(notes), departures(recording))


def _at(
    recording: Recording, label: str, parts: Sequence[Mapping[str, Any]]
) -> tuple[list[Measured], list[Measured], dict[str, Any], list[Note]]:
    """(the law, its points, the curve, notes) of one command."""
    _, response = roles_of(recording)
    read = Points.of(recording, parts, response)
    flow, drop = read.flow, read.drop
    points = []
    for part, flow_read, drop_read in zip(parts, flow, drop, strict=True):
        place = f"{label}, {part['supply']}"
        points.append(FLOW.at(place, response.unit).of(*flow_read, calibration=read.meter))
        points.append(DROP.at(place).of(*drop_read, calibration=read.gauges))
    exponent, at_rated = EXPONENT.at(label), RATED.at(label, response.unit)
    curve = {
        "label": label, "drop_unit": "bar", "response_unit": response.unit, "drop": drop[:, 0],
        "measured": flow[:, 0], "fitted": None,
    }  # fmt: skip
    if not read.have_a_law:
        return [exponent.of(None), at_rated.of(None)], points, curve, []
    rated_bar = float(recording.meta["settings"]["rated_drop"])
    law = _law(flow, drop, rated_bar)
    offsets = np.array([[read.meter, 0.0], [read.gauges, 0.0]])
    moved = [_law(flow + offsets[0], drop, rated_bar), _law(flow, drop + offsets[1], rated_bar)]
    by_meters = [math.hypot(*(other.values[k] - law.values[k] for other in moved)) for k in (0, 1)]
    laws = [
        what.of(law.values[k], law.stds[k], calibration=by_meters[k]) for k, what in enumerate((exponent, at_rated))
    ]
    curve["fitted"] = law.fitted
    least, most = float(drop[:, 0].min()), float(drop[:, 0].max())
    beyond = Note(
        "{label}: the rated pressure drop, {rated:g} bar, is outside what was driven, {least:.3g} … {most:.3g} bar.",
        label=label, rated=rated_bar, least=least, most=most,
    )  # fmt: skip
    return laws, points, curve, [] if least <= rated_bar <= most else [beyond]


@dataclass(frozen=True, slots=True)
class _Law:
    """flow = flow at the rated drop · (drop / rated drop)^exponent.

    Attributes:
        values, stds: exponent, and flow at the rated drop. `fitted`: the flows of the law at the points.
    """

    values: tuple[float, float]
    stds: tuple[float, float]
    fitted: Array


def _law(flow: Array, drop: Array, rated_bar: float) -> _Law:
    """The least-squares line through the logarithms of points, each with its standard uncertainty beside it."""
    sense = math.copysign(1.0, float(flow[0, 0]))
    rows = np.column_stack((np.log(drop[:, 0] / rated_bar), np.ones(len(drop))))
    by = np.linalg.pinv(rows)
    exponent, level = by @ np.log(sense * flow[:, 0])
    stds = np.sqrt(by**2 @ ((flow[:, 1] / flow[:, 0]) ** 2 + (exponent * drop[:, 1] / drop[:, 0]) ** 2))
    at_rated = sense * math.exp(level)
    return _Law(
        (float(exponent), at_rated), (float(stds[0]), abs(at_rated) * float(stds[1])),
        sense * np.exp(rows @ [exponent, level]),
    )  # fmt: skip
