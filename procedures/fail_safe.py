"""Fail-safe: command, supply of the electronics or feedback are lost; in what time the valve closes, and how far.

A lost command goes to its safe value at once. The others need an output with the role `electronics supply` or
`feedback`, of a relay that opens while the command stands; it closes again at neutral.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval, Unit

from hil.errors import InputError, SettingError
from hil.identification.steady.characteristic import Read
from hil.identification.steady.threshold_estimate import Stop, drift_of
from hil.identification.step.step_estimate import measured_steps
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Recording
from hil.rig import SWITCHED, ConditionRole, Rig, RoleChannel, SwitchedRole
from hil.signals.interval import CERTAIN
from procedures._characteristic import steady
from procedures._conditions import Values, adjusting, adjusting_s, usual
from procedures._definitions import FAIL_SAFES, defined
from procedures._recorded import calibration_share, departures, parts_of, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import check_stands, scale_of
from procedures._settings import NotNegative, Percent, Positive, Twice
from procedures._statistics import mean_of

CLOSING = Measurement("closing_time", "ms", "from the loss until the response stays at its final value")
LEFT = Measurement("left_open", "", "response after the loss, less that at neutral before")
MEASUREMENTS = defined(FAIL_SAFES, CLOSING, LEFT)
_HOLD_SETTLINGS = 2.0
_COMMAND: Literal["command"] = "command"

_Loss = Literal["command", SwitchedRole]


def run(
    rig: Rig,
    *,
    losses: tuple[_Loss, ...] | None = None,
    levels: tuple[Percent, ...] | None = None,
    band: Annotated[float, Interval(gt=0.0, lt=50.0), Unit("%")] = 5.0,  # noqa: ARG001 — for the evaluation
    hold_s: Positive | None = None,
    repeats: Twice = 3,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive each level, and from there each loss.

    Args:
        rig: the bench.
        losses: what is lost, one after another; the command, and all that the bench can switch off, when not given.
        levels: from which it is lost, in % of full command from neutral; the ends of its range when not given.
        band: about the final response within which the valve counts as closed, in % of the change.
        hold_s: time at each level and after it, in s; twice the settling time of the valve when not given.
        repeats: how often each is driven.
        warm_up_s: time at the first level before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    scale = scale_of(rig, full_command)
    check_stands(scale, "a fail-safe test")
    held = max(2, round((hold_s or _HOLD_SETTLINGS * rig.settling_s) * rate_hz))
    asked = scale.levels("levels", levels)
    pieces = [np.repeat([level, scale.neutral], held) for level in asked]
    if losses is None:
        losses = (_COMMAND, *(role for role in SWITCHED if role in rig.adjustable))
    if not losses or len(set(losses)) < len(losses):
        raise SettingError(f"setting losses: {', '.join(losses) or 'none'}; at least one, and each once")
    switched: dict[ConditionRole, RoleChannel]
    switched = {role: adjusting(rig, role, f"the loss of the {role}") for role in SWITCHED if role in losses}
    ways: Sequence[Values] = [{role: channel.low} for role, channel in switched.items()] * repeats * len(asked)
    pieces *= repeats if _COMMAND in losses else 0
    path = [*pieces, *[np.full(2 * held, level) for level in asked] * repeats * len(switched)]
    sequence = RunSequence(
        rig, rate_hz, joined(rig, rate_hz, warm_up_s, path), {"levels": asked}, adjusting_s(rig, ways)
    )
    sequence.play(np.full(held, scale.neutral), "neutral", {"kind": "neutral"})
    sequence.warm_up(asked[0], warm_up_s)
    for piece in pieces:
        level = float(piece[0])
        sequence.go_to(level)
        part = {"kind": "fail-safe", "level": level, "held": held, "label": f"{level:.4g} {rig.command.unit}"}
        sequence.play(piece, f"command lost at {part['label']}", part)
    for role, channel in switched.items():
        for level in asked * repeats:
            sequence.go_to(level)
            label = f"{level:.4g} {rig.command.unit}, {role} lost"
            sequence.play(np.full(held, level), label, {"kind": "before a loss"})
            opened = len(rig.adjust({role: channel.low}, rate_hz))
            sequence.play(np.full(held, level), label, {"kind": "after a loss"})
            part = {"kind": "fail-safe", "level": level, "held": held, "label": label, "lost": role}
            rig.mark(2 * held + opened, part)
            sequence.finish()
            rig.adjust({role: usual(channel)}, rate_hz)
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """Closing time and what is left open, for each level the mean of the repeats."""
    parts = parts_of(recording, "fail-safe")
    _, response = roles_of(recording)
    (before,) = parts_of(recording, "neutral")
    neutral = _stop(recording, before["first"], before["count"])
    by_level = {part["label"]: [one for one in parts if one["label"] == part["label"]] for part in parts}
    after = {
        label: [_stop(recording, one["first"] + one["held"], one["count"] - one["held"]) for one in mine]
        for label, mine in by_level.items()
    }
    drift = drift_of(list(after.values()))
    steady_reading = _without(recording, drift)
    measured = [_closing(steady_reading, label, mine) for label, mine in by_level.items()]
    measured += [_left_open(recording, label, mine, neutral, drift) for label, mine in after.items()]
    curves = []
    for label, mine in by_level.items():
        rows = slice(mine[0]["first"] + mine[0]["held"] // 2, mine[0]["first"] + mine[0]["count"])
        every = max(1, (rows.stop - rows.start) // 1500)
        lost_s = recording.time_s[mine[0]["first"] + mine[0]["held"]]
        curves.append({
            "label": label, "response_unit": response.unit,
            "time_s": recording.time_s[rows][::every] - lost_s, "measured": response.values[rows][::every],
        })  # fmt: skip
    return Findings(tuple(measured), {"fail_safe": curves}, deviations=departures(recording))


def _without(recording: Recording, drift: Read) -> Recording:
    """The recording without a drift of the response that is more than noise: it would move the final value."""
    if abs(drift[0]) <= CERTAIN * drift[1]:
        return recording
    _, response = roles_of(recording)
    still = replace(response, values=response.values - drift[0] * (recording.time_s - recording.time_s[0]))
    return replace(recording, channels={**recording.channels, response.name: still})


def _closing(recording: Recording, label: str, parts: Sequence[Mapping[str, Any]]) -> Measured:
    _, response = roles_of(recording)
    band = float(recording.meta["settings"]["band"]) / 100.0
    found = []
    for part in parts:
        rows = recording.rows(part["first"], part["count"])
        try:
            lost = recording.meta["roles"][part.get("lost", _COMMAND)]
            (step,) = measured_steps(rows, lost, response.name, band=band)
        except InputError:
            return CLOSING.at(label).of(None)
        found.append((step.figures.settling_s, step.std.settling_s))
    if not np.isfinite(found).all():
        return CLOSING.at(label).of(None)
    value, std = mean_of(found)  # what a smooth estimate is off by is in every repeat
    return CLOSING.at(label).of(1e3 * value, 1e3 * std)


def _stop(recording: Recording, first: int, count: int) -> Stop:
    """The steady response over the second half of a time at which the command stands."""
    value, std = steady(recording, {"first": first, "count": count}, roles_of(recording)[1])
    return Stop(value, std, float(recording.time_s[first + count // 2 : first + count].mean()))


def _left_open(recording: Recording, label: str, after: Sequence[Stop], neutral: Stop, drift: Read) -> Measured:
    """Less the drift of the reading since neutral, which the repeats show."""
    _, response = roles_of(recording)
    since = [stop.time_s - neutral.time_s for stop in after]
    read = [(stop.response - drift[0] * s, stop.std) for stop, s in zip(after, since, strict=True)]
    value, std = mean_of(read, shared=False)
    left = value - neutral.response
    whole = math.hypot(std, neutral.std, drift[1] * float(np.mean(since)))
    return LEFT.at(label, response.unit).of(left, whole, calibration=calibration_share(response) * abs(left))
