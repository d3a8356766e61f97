"""Acceptance test of an EFC valve: coil, function, leakage, curve, steps, frequency response; a pass/fail certificate.

One valve, one run, from the coil's resistance to the verdict. What would make the rest meaningless or unsafe ends
the run early: a coil that is open or shorted, a pressure that does not follow the current, a type mistaken. The
condition (good, malfunctioned, severely malfunctioned) is judged from friction, rise time, leakage and −3 dB frequency
against a simulated population: how probable the class good is, how usual the valve would be among good ones, and
whether its rise and its −3 dB frequency are theirs. Limits without a source in the thesis are settings of this project
and can be changed per bench.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from hil.errors import InputError
from hil.identification.papers.efc_condition import (
    BEYOND,
    FREQUENCIES_HZ,
    GoodRanges,
    ValveTest,
    condition,
    evaluated_test,
    good_ranges,
    reference_steps,
)
from hil.identification.steady.pressure_curve import PressureCurve, pressure_curve
from hil.identification.steady.sweep_estimate import Sweep
from hil.language.note import Note
from hil.physics.published.tugsal import (
    BURST_PSI,
    CLASSIFIED_CURRENT_A,
    OVERVOLTAGE,
    OVERVOLTAGE_H,
    STEP_CURRENTS_A,
    SWEEPS_PSI,
)
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.population_comparison import PopulationComparison
from hil.record.recording import Array, Recording
from hil.rig import Rig
from hil.session.analyses import thesis_class, thesis_error
from procedures import efc_frequency_response, efc_step_response, electrical_check, leakage_check, pressure_current
from procedures._efc import (
    COIL_CURRENT,
    COIL_VOLTAGE,
    SUPPLY_PRESSURE,
    THROUGH_FLOW,
    Stage,
    check_channels,
    expected_s,
    held,
    part_recordings,
    play,
)
from procedures._recorded import calibration_std, departures, noted, roles_of
from procedures._scale import check_at_least
from procedures._sequence import defaults_of, joined
from procedures._settings import Ampere, Positive, PositiveHertz

FUNCTION = Measurement(
    "function", "psi", "rise of pressure from the closing to the opening current, in the direction of the type", 100.0
)
GOOD = Measurement(
    "probability_good", "%", "probability that the valve is good, given that it belongs to a class", 80.0
)
MALFUNCTIONED = Measurement("probability_malfunctioned", "%", "probability that it is malfunctioned")
SEVERE = Measurement("probability_severe", "%", "probability that it is severely malfunctioned")
USUAL = Measurement("usual_among_good", "%", "good valves that lie farther from their middle than this one", 1.0)
RISE_RATIO = Measurement("rise_over_good", "1", "rise to 1.6 A over that of the good reference")
BANDWIDTH_RATIO = Measurement(
    "bandwidth_over_good", "1", "−3 dB frequency at the medium level over that of the good reference"
)
_CONDITION = (GOOD, MALFUNCTIONED, SEVERE, USUAL, RISE_RATIO, BANDWIDTH_RATIO)
DEVIATION = Measurement(
    "deviation_from_good",
    "psi/s",
    "of its steps from those of a simulated good valve, mean of the steps (eq. 4.1 of the EFC thesis): grows with the "
    "rate",
)
COMPLETE = Measurement("parts_completed", "1", "parts of the test that were completed, of six", 6.0)
CERTIFICATE = True
MEASUREMENTS = (
    COMPLETE,
    FUNCTION,
    *_CONDITION,
    DEVIATION,
    *electrical_check.MEASUREMENTS,
    *leakage_check.MEASUREMENTS,
    *pressure_current.MEASUREMENTS,
    *efc_step_response.MEASUREMENTS,
    *efc_frequency_response.MEASUREMENTS,
)
KIND = "function"

_PARTS: tuple[tuple[str, str, Any], ...] = (
    (Note("electrical check"), electrical_check.KIND, electrical_check),
    (Note("leakage"), leakage_check.KIND, leakage_check),
    (Note("pressure over current"), pressure_current.KIND, pressure_current),
    (Note("steps"), efc_step_response.KIND, efc_step_response),
    (Note("frequency response"), "sine", efc_frequency_response),
)
_ENDED, _LEFT_OUT = "ended early", "level left out"
_OPENING_A, _FOLLOWS_PSI = 1.8, 50.0
_CLASS_LEVEL = "medium"
_THESIS_RATE_HZ = 1000.0  # at which `_step_samples` gives the pressure; the thesis does not state its own


def run(
    rig: Rig,
    *,
    voltage: Literal["12", "24"] = "12",
    normally_open: bool = False,
    top_current: Ampere = 2.0,
    sweep_s: Positive = 20.0,
    frequencies: tuple[PositiveHertz, ...] = FREQUENCIES_HZ,
    levels: tuple[Literal["low", "medium", "high"], ...] = ("low", "medium", "high"),
    rate_hz: Positive | None = None,
) -> None:
    """Drive the whole sequence, or as much of it as the valve allows.

    Args:
        rig: the bench.
        voltage: nominal voltage of the coil.
        normally_open: whether current closes the valve.
        top_current: the highest current of the test, in A; at least 1.8.
        sweep_s: time of the first sweep of the pressure curve, in s.
        frequencies: of the frequency response, in Hz, rising.
        levels: of the frequency response.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    check_at_least("top_current", _OPENING_A, top_current, "A")
    check_channels(rig, (COIL_CURRENT, COIL_VOLTAGE, THROUGH_FLOW, SUPPLY_PRESSURE), "the acceptance test")
    rig.tighten(min(0.0, rig.command.safe), max(top_current, rig.command.safe))
    parts_s = _expected_s(rig, top_current, sweep_s, normally_open, levels, frequencies, rate_hz)
    with rig.before(sum(parts_s)):
        coil = electrical_check.run(rig, voltage=voltage, rate_hz=rate_hz)
    if not _usable(electrical_check.judged(coil, coil.meta["parts"][0], rig.conditions.get("conditions", {}))):
        rig.note(_ENDED, reason="the coil is not usable: see its resistance")
        return
    with rig.before(sum(parts_s[1:])):
        functions = _functions(rig, normally_open, rate_hz)
    if not functions:
        rig.note(_ENDED, reason="pressure does not follow the current as the valve's type asks")
        return
    with rig.before(sum(parts_s[2:])):
        leakage_check.run(rig, closing_current=top_current if normally_open else 0.0, rate_hz=rate_hz)
    with rig.before(sum(parts_s[3:])):
        pieces = pressure_current.run(
            rig, top_current=top_current, cycle_s=sweep_s, normally_open=normally_open, rate_hz=rate_hz
        )
    with rig.before(sum(parts_s[4:])):
        efc_step_response.run(rig, currents=_steps(top_current), rate_hz=rate_hz)
    curve = efc_frequency_response.curve_of(rig, pieces)
    if reached := [level for level in levels if _reached(rig, curve, level)]:
        efc_frequency_response.drive(rig, curve, reached, frequencies, rate_hz=rate_hz)


def _expected_s(
    rig: Rig,
    top_current: float,
    sweep_s: float,
    normally_open: bool,
    levels: Sequence[str],
    frequencies: Sequence[float],
    rate_hz: float,
) -> list[float]:
    """Bench time of function, leakage, curve, steps and frequency response, in s."""
    settings = defaults_of(leakage_check.run), defaults_of(efc_step_response.run)
    leakage, steps = ({**one, "rate_hz": rate_hz} for one in settings)
    parts = (
        [_function_stage(rig, normally_open, rate_hz)],
        leakage_check.stages(**leakage),
        pressure_current.stages(top_current, sweep_s, normally_open, rate_hz),
        efc_step_response.stages(**{**steps, "currents": _steps(top_current)}),
    )
    times = [expected_s(rig, stages, rate_hz) for stages in parts]
    return [*times, efc_frequency_response.expected_s(rig, levels, frequencies)]


def evaluate(recording: Recording) -> Findings:
    """The certificate: every part's findings, the condition, and why the run ended early if it did."""
    reasons = [details["reason"] for details in noted(recording, _ENDED)]
    left_out = noted(recording, _LEFT_OUT)
    function = _function(recording)
    done: dict[str, Findings] = {}
    notes = [Note("Ended early: {reason}.", reason=reason) for reason in reasons]
    for name, kind, procedure in _PARTS:
        if not part_recordings(recording, kind):
            notes.append(Note("Not done: {part}.", part=name))
            continue
        try:
            done[name] = procedure.evaluate(recording)
        except InputError as error:
            notes.append(Note("Not evaluated: {part}: {why}.", part=name, why=str(error)))
    whole = len(done) + (function is not None) - bool(left_out and "frequency response" in done)
    complete = COMPLETE.of(float(whole), 0.0)
    judged, condition_notes, population = _condition(recording, done)
    notes += [
        Note("Level {level} of the frequency response left out: {why}.", level=one["level"], why=one["reason"])
        for one in left_out
    ]
    declared = Note(
        "Declared limits that are not driven here: burst above {burst_psi:g} psi; {hours:g} h at {over:.0f} % of the "
        "coil's voltage.",
        burst_psi=BURST_PSI, hours=OVERVOLTAGE_H, over=100.0 * OVERVOLTAGE,
    )  # fmt: skip
    together = joined(done.values(), (*notes, *condition_notes, declared))
    return replace(
        together,
        measured=(complete, *(() if function is None else (function,)), *judged, *together.measured),
        deviations=tuple(dict.fromkeys([*together.deviations, *departures(recording)])),
        population=population,
    )


def _usable(found: Findings) -> bool:
    """Whether the coil may be driven on: its resistance is not one of an open or shorted coil."""
    resistance = found.measured[0]
    if resistance.value is None or resistance.low is None or resistance.high is None or resistance.relation != "=":
        return False
    return 0.5 * resistance.low < resistance.value < 2.0 * resistance.high


def _functions(rig: Rig, normally_open: bool, rate_hz: float) -> bool:
    """Whether the pressure rises as the type asks, seen at two currents before anything goes on."""
    (made,) = play(rig, [_function_stage(rig, normally_open, rate_hz)], rate_hz)
    return _rise(made, rig.command.name, rig.response.name, normally_open)[0] > _FOLLOWS_PSI


def _function_stage(rig: Rig, normally_open: bool, rate_hz: float) -> Stage:
    wait_s = max(rig.settling_s, 0.2)
    path = np.concatenate((held(0.0, wait_s, rate_hz), held(_OPENING_A, 2.0 * wait_s, rate_hz)))
    return Stage(path, "function", {"kind": KIND, "normally_open": normally_open})


def _rise(samples: Recording, command: str, response: str, normally_open: bool) -> tuple[float, float]:
    """Change of pressure between the two currents, in the direction of the type, and its scatter."""
    driven, pressure = samples.values(command), samples.values(response, "psi")
    low = pressure[driven == driven.min()]
    high = pressure[driven == driven.max()][len(pressure) // 3 :]
    change = float(high.mean() - low[len(low) // 2 :].mean())
    noise = float(high.std()) / math.sqrt(len(high)) * math.sqrt(2.0)
    return (-change if normally_open else change), noise


def _reached(rig: Rig, curve: PressureCurve, level: str) -> bool:
    """Whether the valve's curve goes through the pressures of a level; noted where it does not."""
    try:
        for pressure in SWEEPS_PSI[level]:
            curve.current_at(pressure)
    except InputError as error:
        rig.note(_LEFT_OUT, level=level, reason=str(error))
        return False
    return True


def _function(recording: Recording) -> Measured | None:
    found = part_recordings(recording, KIND)
    if not found:
        return None
    command, response = roles_of(recording)
    part, samples = found[0]
    change, noise = _rise(samples, command.name, response.name, bool(part["normally_open"]))
    return FUNCTION.of(change, math.hypot(noise, calibration_std(response)))


def _steps(top_current: float) -> tuple[float, ...]:
    return tuple(current for current in STEP_CURRENTS_A if current <= top_current)


# -- condition ---------------------------------------------------------------------------------------------


def judged_condition(
    test: ValveTest, frequencies_hz: tuple[float, ...], normally_open: bool
) -> tuple[list[Measured], list[Note]]:
    """What the numbers of a test say of the valve's condition, each with its verdict, and what to read beside them.

    Args:
        test: friction, rise, leakage and −3 dB frequency.
        frequencies_hz: of the sines that the −3 dB frequency was read from.
        normally_open: the type, which the population is of as well.
    """
    found = condition(test, frequencies_hz, normally_open)
    good = good_ranges(frequencies_hz, normally_open).by_feature
    good_s, good_hz = good["rise"], good["bandwidth"]
    shares: list[float | None] = [round(100.0 * share, 1) for share in found.probabilities.values()]
    away = tuple(
        Note("{of} {distance:.1f}", of=Note(name), distance=distance) for name, distance in found.distances.items()
    )
    if found.unlike:
        shares = [None] * len(shares)
        notes = [Note(
            "Condition: unlike every class of a simulated population of EFC valves; distances in standard deviations: "
            "{away}.",
            away=away,
        )]  # fmt: skip
    else:
        notes = [Note(
            "Condition: {verdict} ({likely:.1f} %), against a simulated population; distances in standard deviations: "
            "{away}.",
            verdict=Note(found.verdict), likely=100.0 * found.probabilities[found.verdict], away=away,
        )]  # fmt: skip
    notes.append(Note(
        "This valve: rise to 1.6 A {own_rise_ms:.0f} ms, −3 dB at the medium level {own_hz:.2f} Hz. Good valves: "
        "{rise_ms:.0f} ms and {bandwidth_hz:.2f} Hz; one in forty is above {longest_ms:.0f} ms or below "
        "{least_hz:.2f} Hz.",
        rise_ms=1e3 * good_s.middle, longest_ms=1e3 * good_s.high, bandwidth_hz=good_hz.middle,
        least_hz=good_hz.low, own_rise_ms=1e3 * test.rise_s, own_hz=test.bandwidth_hz,
    ))  # fmt: skip
    rise, bandwidth = test.rise_s / good_s.middle, test.bandwidth_hz / good_hz.middle
    longest, least = good_s.high / good_s.middle, good_hz.low / good_hz.middle
    return [
        *(m.of(share, 0.0) for m, share in zip(_CONDITION[:3], shares, strict=True)),
        USUAL.of(round(100.0 * found.usual["good"], 2), 0.0),
        replace(RISE_RATIO, high=round(longest, 3)).of(rise, test.rise_std_s / good_s.middle),
        replace(BANDWIDTH_RATIO, low=round(least, 3)).of(bandwidth, test.bandwidth_std_hz / good_hz.middle),
    ], notes


def _condition(
    recording: Recording, done: dict[str, Findings]
) -> tuple[list[Measured], list[Note], PopulationComparison]:
    """The condition, and the valve beside good ones; not determined where the tests that they need are missing."""
    try:
        test, (errors, classes) = _valve_test(recording, done), _thesis(recording)
    except InputError as error:
        return (
            [m.of(None) for m in _CONDITION],
            [Note("Condition unknown: {why}.", why=str(error))],
            PopulationComparison(reason=str(error)),
        )
    settings = recording.meta["settings"]
    population = tuple(settings["frequencies"]), bool(settings["normally_open"])
    judged, notes = judged_condition(test, *population)
    beside = beside_good(test, done["leakage"].measured[0].std, good_ranges(*population))
    return [*judged, *errors], [*notes, *classes], beside


def beside_good(test: ValveTest, leakage_std_ml_min: float | None, good: GoodRanges) -> PopulationComparison:
    """The valve's four figures, each with the range of good valves."""
    ranges = good.by_feature
    figures = (
        (Measurement("friction", "mA", ""), 1e3, test.friction_a, test.friction_std_a, ranges["friction"]),
        (Measurement("leakage", "ml/min", ""), 1.0, test.leakage_ml_min, leakage_std_ml_min, ranges["leakage"]),
        (Measurement("rise", "ms", ""), 1e3, test.rise_s, test.rise_std_s, ranges["rise"]),
        (Measurement("bandwidth_3db", "Hz", ""), 1.0, test.bandwidth_hz, test.bandwidth_std_hz, ranges["bandwidth"]),
    )
    return PopulationComparison(
        tuple(replace(m.of(scale * value, None if std is None else scale * std), low=scale * range_.low,
                      high=scale * range_.high) for m, scale, value, std, range_ in figures),
        good.count, BEYOND,
    )  # fmt: skip


def _thesis(recording: Recording) -> tuple[list[Measured], list[Note]]:
    """Eq. 4.1 at both currents, and what section 4.1.3 of the thesis calls it; a remark, not a verdict."""
    command, response = roles_of(recording)
    measured, notes = [], []
    for level, current in CLASSIFIED_CURRENT_A.items():
        runs, reference = _step_samples(recording, current, command.name, response.name), reference_steps()[level]
        shared = min(runs.shape[1], len(reference))
        found = [thesis_error(run[:shared], reference[:shared], _THESIS_RATE_HZ, level) for run in runs]
        errors = np.array([one.error for one in found])
        mean = thesis_class(float(errors.mean()), level, shared / _THESIS_RATE_HZ, _THESIS_RATE_HZ)
        std = float(errors.std(ddof=1)) / math.sqrt(len(errors)) if len(errors) > 1 else None
        measured.append(DEVIATION.at(f"{current:g} A").of(mean.error, std))
        notes.append(Note("EFC thesis, {found}.", found=mean.sentence))
    return measured, notes


def _valve_test(recording: Recording, done: dict[str, Findings]) -> ValveTest:
    needed = ("leakage", "pressure over current", "steps", "frequency response")
    missing = [name for name in needed if name not in done]
    if missing:
        raise InputError(f"not measured: {', '.join(missing)}")
    leakage = done["leakage"].measured[0]
    if leakage.value is None:
        raise InputError("the leakage is not known")
    command, response = roles_of(recording)
    sweeps = [Sweep(s.values(command.name, "A"), s.values(response.name, "psi"), float(part["speed_per_s"]))
              for part, s in part_recordings(recording, pressure_current.KIND)]  # fmt: skip
    steps = _step_samples(recording, CLASSIFIED_CURRENT_A["high"], command.name, response.name)
    bandwidth = efc_frequency_response.bandwidth_at(recording, done["frequency response"], _CLASS_LEVEL)
    return evaluated_test(pressure_curve("sweeps", sweeps), steps, leakage.value, bandwidth)


def _step_samples(recording: Recording, current: float, command: str, response: str) -> Array:
    """Pressure from each step to a current on, at 1 kHz, shape (repeats, n).

    Raises:
        InputError: there is no such step.
    """
    made: list[Array] = []
    for part, samples in part_recordings(recording, efc_step_response.KIND):
        if float(part["current"]) != current:
            continue
        driven = samples.values(command)
        first, last = _up(driven)
        time_s = samples.time_s[first:last] - samples.time_s[first]
        grid = np.arange(0.0, float(time_s[-1]), 1e-3)
        made.append(np.interp(grid, time_s, samples.values(response, "psi")[first:last]))
    if not made:
        raise InputError(f"no step to {current:g} A was measured")
    return np.array([run[: min(map(len, made))] for run in made])


def _up(driven: Sequence[float] | Array) -> tuple[int, int]:
    """First sample at the step's level, and the end of it."""
    change = np.diff(np.asarray(driven))
    return int(np.flatnonzero(change > 0.0)[0]) + 1, int(np.flatnonzero(change < 0.0)[0]) + 1
