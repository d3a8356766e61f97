"""Step response: onset, rise, response and settling time, overshoot, first-order model with dead time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval, Unit

from hil.errors import InputError, SettingError
from hil.identification.frequency.table_fit import as_response
from hil.identification.papers.step_models import over_lowest, step_models
from hil.identification.step.step_estimate import MeasuredStep, measured_steps
from hil.language.note import Note
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Channel, Recording
from hil.record.table.response_table import ResponseTable
from hil.rig import Rig
from hil.session.sources import tables_of
from hil.signals.colour import noisy_mean
from hil.signals.rounding import rounding_step
from hil.signals.steps import CUSTOMARY_STEPS, step_sequence
from procedures._definitions import STEPS, defined
from procedures._recorded import NO_ONSET, calibration_share, departures, noted, parts_of, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import check_stands, scale_of
from procedures._settings import NotNegative, Once, Percent, Positive
from procedures._statistics import disagreement, extreme
from procedures._step_model import step_model

ONSET = Measurement("onset", "ms", "until the response has moved by more than noise and 2 % of its change")
RISE = Measurement("rise", "ms", "from 10 % to 90 % of the change")
RESPONSE = Measurement("response", "ms", "until 90 % of the change")
SETTLING = Measurement("settling", "ms", "after which the response stays within the band about its final value")
BAND_ENTRY = Measurement(
    "band_entry", "ms", "until the response first comes within the band: the HPV41 paper's settling time"
)
OVERSHOOT = Measurement("overshoot", "%", "beyond the final value, in % of the change")
CHANGE = Measurement("change", "", "final value minus the value before the step")
MEASUREMENTS = defined(STEPS, ONSET, RISE, RESPONSE, SETTLING, BAND_ENTRY, OVERSHOOT, CHANGE)

_BESIDE = "frequency response beside"
_HOLD_SETTLINGS = 2.0
_BEFORE = 0.1  # of a step's time, shown before it
_MOST_POINTS = 1500
_TAIL, _CLEAR = 4, 3.0  # the last quarter of a level is steady; a change of so many noise deviations can be read


def run(
    rig: Rig,
    *,
    sequence: Literal["paper", "small", "half", "full", "reversal", "inner", "quarter"] = "paper",
    levels: tuple[Percent, ...] | None = None,
    hold_s: Positive | None = None,
    repeats: Once = 1,
    band: Annotated[float, Interval(gt=0.0, lt=50.0), Unit("%")] = 2.0,  # noqa: ARG001 — for the evaluation
    beside: str = "",
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the steps.

    Args:
        rig: the bench.
        sequence: of levels: paper 0 80 0; small 0 10 0 -10 0; half 0 50 0 -50 0; full 0 100 0 -100 0; reversal
            -90 90 -90; inner 10 90 10; quarter 25 75 25, in % of full command from neutral.
        levels: other levels instead, in % of full command from neutral.
        hold_s: time at each level, in s; twice the settling time of the valve when not given.
        repeats: how often the sequence is driven.
        band: about the final value within which a response counts as settled, in % of its change.
        beside: a frequency response of the valve, beside which the models of each step are put: table, installed table
            or run with one frequency response.
        warm_up_s: time at the first level before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    held_s = _HOLD_SETTLINGS * rig.settling_s if hold_s is None else hold_s
    asked = CUSTOMARY_STEPS[sequence] if levels is None else levels
    if len(asked) < 2:
        raise SettingError(f"setting levels: {len(asked)} given; a step needs at least two")
    scale = scale_of(rig, full_command)
    check_stands(scale, "a step response")
    name = "sequence" if levels is None else "levels"
    values = [scale.level(name, percent) for percent in asked] * repeats
    steps = [step_sequence([level], held_s, rate_hz) for level in values]
    measured = _response_beside(beside)
    run_sequence = RunSequence(
        rig, rate_hz, joined(rig, rate_hz, warm_up_s, [np.concatenate(steps)]), {"levels": values}
    )
    if measured is not None:
        rig.note(_BESIDE, **measured)
    run_sequence.warm_up(values[0], warm_up_s)
    starts = [values[0], *values]
    run_sequence.say(_way(rig, starts[0], values[0]))
    for i, piece in enumerate(rig.stream(iter(steps), rate_hz)):
        rig.mark(len(piece), {"kind": "level", "from": starts[i], "to": values[i]})
        if i + 1 < len(values):  # the next one is under way when one has been recorded
            run_sequence.say(_way(rig, starts[i + 1], values[i + 1]))
    run_sequence.finish()


def _way(rig: Rig, start: float, level: float) -> str:
    return (f"at {level:.4g}" if start == level else f"{start:.4g} → {level:.4g}") + f" {rig.command.unit}"


def evaluate(recording: Recording) -> Findings:
    """Figures of every step with uncertainty, and beside each a fitted model and those that its two times make."""
    band = float(recording.meta["settings"]["band"])
    measured: list[Measured] = []
    curves, notes = [], []
    drift = _drift(recording)
    if drift:
        notes.append(Note(
            "The response at one and the same level changes by {drift:.2g} {unit} from visit to visit: reading or "
            "valve drifts. Half of that is granted to every level.",
            drift=drift, unit=roles_of(recording)[1].unit,
        ))  # fmt: skip
    beside = _noted_beside(recording)
    for number, (part, before) in enumerate(_steps(recording), start=1):
        label = _label(recording, part, number)
        try:
            found = _one(recording, part, before, band, drift / 2.0)
        except InputError as error:
            notes.append(Note("no figures: {why}.", why=_reason(error)).at(label))
            continue
        _, response = roles_of(recording)
        measured += _measured(label, found, response)
        if not np.isfinite(found.std.onset_s):
            notes.append(NO_ONSET.at(label))
        if found.tone_hz is not None:
            notes.append(Note(
                "a tone of {tone_hz:.3g} Hz goes on before and after it and was taken out.", tone_hz=found.tone_hz
            ).at(label))  # fmt: skip
        notes += [note.at(label) for note in found.still_moving(response.unit)]
        models, why = _models(label, found, beside)
        notes += why
        curves.append(_curve(recording, part, before, label, found) | models)
    return Findings(tuple(measured), {"steps": curves}, tuple(notes), departures(recording))


def _steps(recording: Recording) -> list[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """(the part after a step, the part before it)."""
    parts = parts_of(recording, "level")
    return [(after, before) for before, after in pairwise(parts) if after["from"] != after["to"]]


def _drift(recording: Recording) -> float:
    """The most that the visits of one level differ by, where noise does not explain it; else 0."""
    _, response = roles_of(recording)
    visits: dict[float, list[tuple[float, float]]] = {}
    for part in parts_of(recording, "level"):
        values = recording.rows(part["first"], part["count"]).values(response.name)
        mean, noise = noisy_mean(values[-max(1, len(values) // _TAIL) :])
        visits.setdefault(float(part["to"]), []).append((mean, math.hypot(noise, rounding_step(response.values))))
    return max(map(disagreement, visits.values()))


def _one(
    recording: Recording, part: Mapping[str, Any], before: Mapping[str, Any], band: float, level_std: float
) -> MeasuredStep:
    command, response = roles_of(recording)
    ends = [recording.rows(p["first"], p["count"]).values(response.name) for p in (before, part)]
    start, final = (values[-max(1, len(values) // _TAIL) :] for values in ends)
    if abs(float(final.mean() - start.mean())) < _CLEAR * float(np.hypot(start.std(), final.std())):
        raise InputError("the response does not follow it beyond the noise")
    rows = recording.rows(before["first"], before["count"] + part["count"])
    (found,) = measured_steps(rows, command.name, response.name, band=band / 100.0, level_std=level_std)
    return found


def _label(recording: Recording, part: Mapping[str, Any], number: int) -> str:
    """`0 → 80 %`, numbered where the same step is driven more than once."""
    command, _ = roles_of(recording)
    text = f"{part['from']:.4g} → {part['to']:.4g} {command.unit}"
    same = [p for p, _ in _steps(recording) if (p["from"], p["to"]) == (part["from"], part["to"])]
    return text if len(same) == 1 else f"{text} ({number})"


def _measured(label: str, found: MeasuredStep, response: Channel) -> list[Measured]:
    value, std = found.figures, found.std
    times = [
        (ONSET, value.onset_s, std.onset_s), (RISE, value.rise_s, std.rise_s),
        (RESPONSE, value.response_s, std.response_s), (SETTLING, value.settling_s, std.settling_s),
        (BAND_ENTRY, value.band_entry_s, std.band_entry_s),
    ]  # fmt: skip
    change = value.final - value.start
    return [
        *(_time(what.at(label), at_s, at_std_s) for what, at_s, at_std_s in times),
        extreme(
            OVERSHOOT.at(label),
            100.0 * value.overshoot,
            100.0 * std.overshoot,
            made_by_noise=100.0 * found.made_by_noise,
        ),
        CHANGE.at(label, response.unit).of(
            change, found.change_std, calibration=calibration_share(response) * abs(change)
        ),
    ]


def _time(what: Measurement, value_s: float, std_s: float) -> Measured:
    """A time; what noise can move past the record cannot be told."""
    known = bool(np.isfinite(value_s) and np.isfinite(std_s))
    return what.of(1e3 * value_s, 1e3 * std_s) if known else what.of(None)


def _curve(
    recording: Recording, part: Mapping[str, Any], before: Mapping[str, Any], label: str, found: MeasuredStep
) -> dict[str, Any]:
    command, response = roles_of(recording)
    lead = min(int(before["count"]), round(_BEFORE * part["count"]))
    rows = slice(part["first"] - lead, part["first"] + part["count"])
    every = max(1, (rows.stop - rows.start) // _MOST_POINTS)
    time_s = recording.time_s[rows] - recording.time_s[part["first"]]
    model = step_model(time_s, response.values[rows], found.figures)
    shown = slice(None, None, every)
    return {
        "label": label, "command_unit": command.unit, "response_unit": response.unit,
        "time_s": time_s[shown], "command": command.values[rows][shown], "measured": response.values[rows][shown],
        "fitted": model.response[shown], "fitted_text": model.text,
        "start": found.figures.start, "final": found.figures.final,
    }  # fmt: skip


def _models(label: str, found: MeasuredStep, beside: ResponseTable | None) -> tuple[dict[str, Any], list[Note]]:
    """The models that rise and settling make, and the response beside them; and what to say of them."""
    value, std = found.figures, found.std
    try:
        made = step_models(
            value.rise_s, value.settling_s, None if beside is None else as_response([beside]),
            band=value.band, std_s=(std.rise_s, std.settling_s),
        )  # fmt: skip
    except InputError as error:
        return {"models": [], "damping_roots": {}, "response": None}, [Note("{why}", why=str(error)).at(label).stopped]
    models: dict[str, Any] = {
        "models": [one.as_dict() for one in made.models],
        "damping_roots": {"label": "roots of eq. 17", "real": made.roots.real, "imaginary": made.roots.imag},
        "response": None,
    }
    if beside is not None:
        response = over_lowest(as_response([beside]))
        models["response"] = {
            "frequency_hz": response.frequency_hz, "magnitude_db": response.magnitude_db,
            "phase_deg": response.phase_deg,
        }  # fmt: skip
    return models, [note.at(label).stopped for note in made.notes]


def _response_beside(place: str) -> dict[str, Any] | None:
    """The lines of a frequency response as a run's header keeps them."""
    if not place:
        return None
    (table,) = tables_of([place])
    return {
        "source": table.name, "frequency_hz": table.frequency_hz.tolist(), "unit": table.unit,
        "real": table.response.real.tolist(), "imaginary": table.response.imag.tolist(),
    }  # fmt: skip


def _noted_beside(recording: Recording) -> ResponseTable | None:
    for found in noted(recording, _BESIDE):
        response = np.array(found["real"]) + 1j * np.array(found["imaginary"])
        return ResponseTable(found["source"], np.array(found["frequency_hz"]), response, found["unit"])
    return None


def _reason(error: InputError) -> str:
    return str(error).removeprefix("step response: ")
