"""Step response of an EFC: 1.2, 1.4, 1.6, 1.8 and 2.0 A from no current, three repeats each.

Onset, rise, settling and overshoot of the rail pressure for every current; currents and repeats are those of the
EFC thesis, section 3.1.3.2. Repeats tell the scatter of a valve that sticks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from hil.errors import InputError
from hil.identification.step.step_estimate import MeasuredStep, measured_steps
from hil.language.note import Note
from hil.physics.published.tugsal import STEP_CURRENTS_A
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Channel, Recording
from hil.rig import Rig
from hil.signals.colour import noisy_mean
from hil.signals.rounding import mean_rounding_std, rounding_step
from procedures._definitions import STEPS, defined
from procedures._efc import Stage, held, part_recordings, play
from procedures._recorded import NO_ONSET, calibration_std, roles_of
from procedures._scale import check_above
from procedures._settings import NotNegativeAmpere, Once, Positive, PositiveAmpere
from procedures._statistics import disagreement, extreme, mean_of

FINAL = Measurement("step_pressure", "psi", "steady pressure at the end of the step")
RISE = Measurement("rise", "ms", "from 10 % to 90 % of the change")
ONSET = Measurement("onset", "ms", "until the pressure has moved")
SETTLING = Measurement("settling", "ms", "after which the pressure stays within 5 % of its change")
OVERSHOOT = Measurement("overshoot", "%", "beyond the final pressure, of the change")
MEASUREMENTS = defined(STEPS, FINAL, RISE, ONSET, SETTLING, OVERSHOOT)
KIND = "efc-step"

_BAND = 0.05
_LEAST_CHANGE = 6.0  # psi, below which a step tells no times


def run(
    rig: Rig,
    *,
    currents: tuple[PositiveAmpere, ...] = STEP_CURRENTS_A,
    repeats: Once = 3,
    from_current: NotNegativeAmpere = 0.0,
    hold_s: Annotated[float, Interval(ge=0.2)] = 1.5,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the steps.

    Args:
        rig: the bench.
        currents: to which the current steps, in A.
        repeats: of each step.
        from_current: where each step begins, in A.
        hold_s: time at each level, in s.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    for current in currents:
        check_above("currents", from_current, current, "A")
    play(rig, stages(currents, repeats, from_current, hold_s, rate_hz), rate_hz)


def stages(currents: Sequence[float], repeats: int, from_current: float, hold_s: float, rate_hz: float) -> list[Stage]:
    """Every step with its repeats."""
    base = held(from_current, hold_s, rate_hz)
    return [
        Stage(
            np.concatenate((base, held(current, hold_s, rate_hz), base)),
            f"step to {current:g} A, {i + 1} of {repeats}",
            {"kind": KIND, "current": current, "repeat": i},
        )
        for current in currents for i in range(repeats)
    ]  # fmt: skip


def evaluate(recording: Recording) -> Findings:
    """Figures for each current: mean over the repeats, with what their scatter and the noise say."""
    found = part_recordings(recording, KIND)
    if not found:
        return Findings(tuple(m.of(None) for m in MEASUREMENTS), notes=(Note("No step was measured."),))
    command, response = roles_of(recording)
    by_current: dict[float, list[MeasuredStep | None]] = {}
    curves, notes = [], []
    drift = _drift(found, command.name, response)
    if drift:
        notes.append(Note(
            "The pressure before the steps changes by {drift:.2g} {unit} from step to step: reading or valve drifts. "
            "As much is granted to every steady pressure.",
            drift=drift, unit=response.unit,
        ))  # fmt: skip
    for part, samples in found:
        step = first_step(samples, command.name, response.name)
        by_current.setdefault(float(part["current"]), []).append(step)
        if step is not None:
            curves.append(_curve(part, samples, command.name, response.name, step))
    measured: list[Measured] = []
    for current, steps in by_current.items():
        usable, place = [step for step in steps if step is not None], f"{current:g} A"
        if len(usable) < len(steps):
            few = len(steps) - len(usable)
            notes.append(Note("{n} of {all} steps move the pressure too little.", n=few, all=len(steps)).at(place))
        if usable:
            measured += _figures(place, usable, calibration_std(response), drift)
            if not all(math.isfinite(step.std.onset_s) for step in usable):
                notes.append(NO_ONSET.at(place))
    return Findings(tuple(measured), {"steps": curves} if curves else {}, tuple(notes))


def first_step(samples: Recording, command: str, response: str) -> MeasuredStep | None:
    """The step up; None where the pressure hardly changes."""
    rise = np.flatnonzero(np.diff(samples.values(command)) > 0.0)
    fall = np.flatnonzero(np.diff(samples.values(command)) < 0.0)
    if not rise.size or not fall.size:
        return None
    try:
        step = measured_steps(samples.rows(0, int(fall[0]) + 1), command, response, band=_BAND)[0]
    except InputError:
        return None
    return step if abs(step.figures.final - step.figures.start) >= _LEAST_CHANGE else None


def _drift(found: list[tuple[Mapping[str, Any], Recording]], command: str, response: Channel) -> float:
    """What the pressures before the steps differ by, where that is more than noise and rounding make; else 0."""
    visits, grid = [], rounding_step(response.values)
    for _, samples in found:
        rise = np.flatnonzero(np.diff(samples.values(command)) > 0.0)
        values = samples.values(response.name)[: int(rise[0]) + 1] if rise.size else np.empty(0)
        rest = values[len(values) // 2 :]
        if len(rest) > 1:
            mean, noise = noisy_mean(rest)
            visits.append((mean, math.hypot(noise, mean_rounding_std(0.0, grid))))
    return disagreement(visits)


def _figures(place: str, steps: list[MeasuredStep], pressure_std: float, drift: float) -> list[Measured]:
    made = []
    for measurement, name, scale, floor in (
        (FINAL, "final", 1.0, pressure_std), (RISE, "rise_s", 1e3, 0.0), (ONSET, "onset_s", 1e3, 0.0),
        (SETTLING, "settling_s", 1e3, 0.0), (OVERSHOOT, "overshoot", 100.0, 0.0),
    ):  # fmt: skip
        value, std = mean_of([(getattr(step.figures, name), getattr(step.std, name)) for step in steps])
        if measurement is FINAL:
            std = math.hypot(std, drift / math.sqrt(3.0))
        what = measurement.at(place)
        if not (math.isfinite(value) and math.isfinite(std)):
            made.append(what.of(None))
        elif measurement is OVERSHOOT:
            by_noise = math.sqrt(float(np.mean([step.made_by_noise**2 for step in steps])))
            made.append(extreme(what, scale * value, scale * std, made_by_noise=scale * by_noise))
        else:
            made.append(what.of(scale * value, scale * std, calibration=floor))
    return made


def _curve(
    part: Mapping[str, Any], samples: Recording, command: str, response: str, step: MeasuredStep
) -> dict[str, Any]:
    figures = step.figures
    first = int(np.flatnonzero(np.diff(samples.values(command)) > 0.0)[0]) + 1
    return {
        "label": f"{part['current']:g} A, {part['repeat'] + 1}", "time_s": samples.time_s - samples.time_s[first],
        "measured": samples.values(response), "command": samples.values(command),
        "start": figures.start, "final": figures.final, "rise_s": figures.rise_s, "onset_s": figures.onset_s,
        "response_s": figures.response_s, "settling_s": figures.settling_s, "band_entry_s": figures.band_entry_s,
        "overshoot_percent": 100.0 * figures.overshoot,
        "command_unit": samples.channel(command).unit, "response_unit": samples.channel(response).unit,
    }  # fmt: skip
