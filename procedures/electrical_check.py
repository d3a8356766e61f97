"""Electrical check of an EFC coil: resistance at 72 °F and inductance, from small steps of the current.

The current goes up and down between rests, far below the coil's rating; voltage and current at the terminal posts
give both numbers whatever drives the coil. Limits are those of the EFC thesis, section 3.1.2.2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval

from hil.errors import SettingError
from hil.identification.steady.coil import COPPER_PER_K, Coil, CoilReadings, copper_factor, fit_coil
from hil.language.note import Note
from hil.physics.published.tugsal import OVERVOLTAGE, RESISTANCE_OHM
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Channel, Recording
from hil.rig import Rig
from hil.signals.ramps import ramp
from hil.signals.rounding import mean_rounding_std
from procedures._efc import (
    COIL_CURRENT,
    COIL_TEMPERATURE,
    COIL_VOLTAGE,
    Stage,
    channel,
    check_channels,
    held,
    part_recordings,
    play,
)
from procedures._recorded import calibration_std, reading_step
from procedures._scale import check_at_least
from procedures._settings import Celsius, Positive, PositiveAmpere, Twice

RESISTANCE = Measurement("coil_resistance", "ohm", "resistance of the coil at 72 °F", 1.7, 2.5)
INDUCTANCE = Measurement("coil_inductance", "mH", "inductance of the coil", None, 120.0)
MEASUREMENTS = (
    RESISTANCE,
    INDUCTANCE,
    Measurement("coil_temperature", "degC", "temperature at which the resistance was measured"),
    Measurement("test_voltage", "V", "voltage at the test current"),
)
KIND = "coil"

_PARTS = 40  # of the test: one of them stands still

_REFERENCE_C = (72.0 - 32.0) / 1.8
_STATED_TEMPERATURE_STD_K = 2.0


def run(
    rig: Rig,
    *,
    voltage: Literal["12", "24"] = "12",
    test_current: PositiveAmpere = 0.5,
    rise_s: Positive = 0.02,
    hold_s: Annotated[float, Interval(ge=0.4)] = 0.6,
    repeats: Twice = 5,
    coil_temperature: Celsius | None = None,
    rate_hz: Positive | None = None,
) -> Recording:
    """Drive the steps; returns what was recorded, so that a sequence can decide whether to go on.

    Args:
        rig: the bench.
        voltage: nominal voltage of the coil; its specification is judged.
        test_current: to which the current steps, in A; 133 % of the nominal voltage over the resistance is the most.
        rise_s: time of the step's flank, in s; a flank longer than the sample interval lets samples see its area.
        hold_s: rest after each flank, in s.
        repeats: how often it goes up and down.
        coil_temperature: in °C; from the channel "coil temperature" or the fluid's when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    check_channels(rig, (COIL_CURRENT, COIL_VOLTAGE), "the electrical check")
    ohm, tolerance = RESISTANCE_OHM[int(voltage)]
    most = OVERVOLTAGE * float(voltage) / (ohm + tolerance)
    if test_current > most:
        raise SettingError(
            f"setting test_current: {test_current:g} A; a {voltage} V coil takes {most:.3g} A at most (133 % of its "
            "voltage)"
        )
    check_at_least("rise_s", 2.0 / rate_hz, rise_s, "s")
    part = {"kind": KIND, "voltage": voltage, "coil_temperature": coil_temperature}
    (made,) = play(rig, stages(test_current, rise_s, hold_s, repeats, rate_hz, part), rate_hz)
    return made


def stages(
    test_current: float, rise_s: float, hold_s: float, repeats: int, rate_hz: float, part: Mapping[str, Any]
) -> list[Stage]:
    """The steps, up and down."""
    low, high = held(0.0, hold_s, rate_hz), held(test_current, hold_s, rate_hz)
    up = ramp(0.0, test_current, rise_s, rate_hz)[1:-1]
    command = np.concatenate([low, *([up, high, up[::-1], low] * repeats)])
    return [Stage(command, f"coil at {test_current:g} A", part)]


def evaluate(recording: Recording) -> Findings:
    """Resistance at 72 °F, inductance, and what they say about the coil."""
    found = part_recordings(recording, KIND)
    if not found:
        return Findings(tuple(m.of(None) for m in MEASUREMENTS), notes=(Note("The coil was not tested."),))
    part, samples = found[0]
    return judged(samples, part, recording.meta.get("conditions", {}))


def judged(samples: Recording, part: Mapping[str, Any], conditions: Mapping[str, Any]) -> Findings:
    """Findings of the samples of one test."""
    command = (
        samples.channel(samples.meta["roles"]["command"]) if "roles" in samples.meta else samples.channel("current")
    )
    current = channel(samples, COIL_CURRENT, "A", "the electrical check")
    voltage = channel(samples, COIL_VOLTAGE, "V", "the electrical check")
    coil = fit_coil(
        CoilReadings(
            samples.time_s, samples.values(command.name, "A"), current.values, voltage.values,
        )
    )  # fmt: skip
    temperature_c, scatter_k, temperature_std, source = _temperature(samples, part, conditions)
    factor = copper_factor(temperature_c, _REFERENCE_C)
    ohm, tolerance = RESISTANCE_OHM[int(part["voltage"])]
    resistance = replace(RESISTANCE, low=ohm - tolerance, high=ohm + tolerance)
    scale = math.hypot(
        calibration_std(current) / max(abs(coil.current_a), 1e-9),
        calibration_std(voltage) / max(abs(coil.voltage_v), 1e-9),
    )
    measured: tuple[Measured, ...]
    if coil.is_open:
        least = coil.voltage_v / (abs(coil.current_a) + 2.0 * max(calibration_std(current), 1e-6)) / factor
        measured = (resistance.of(least, 0.0, relation=">"), INDUCTANCE.of(None))
    else:
        rounding = math.hypot(
            _rounding_std(samples, current) / coil.current_a, _rounding_std(samples, voltage) / coil.voltage_v
        )
        std = math.hypot(coil.resistance_std_ohm, rounding * coil.resistance_ohm, COPPER_PER_K * scatter_k * ohm)
        known = math.hypot(scale * coil.resistance_ohm, COPPER_PER_K * temperature_std * ohm)
        measured = (
            resistance.of(coil.resistance_ohm / factor, std / factor, calibration=known / factor),
            INDUCTANCE.of(
                1e3 * coil.inductance_h,
                1e3 * math.hypot(coil.inductance_std_h, rounding * coil.inductance_h),
                calibration=1e3 * scale * coil.inductance_h,
            ),
        )
    return Findings(
        (
            *measured,
            MEASUREMENTS[2].of(temperature_c, scatter_k, calibration=temperature_std),
            MEASUREMENTS[3].of(
                coil.voltage_v,
                math.hypot(coil.voltage_std_v, _rounding_std(samples, voltage)),
                calibration=calibration_std(voltage),
            ),
        ),
        notes=(*_notes(coil, coil.resistance_ohm / factor, str(part["voltage"])), source),
    )


def _temperature(
    samples: Recording, part: Mapping[str, Any], conditions: Mapping[str, Any]
) -> tuple[float, float, float, Note]:
    """Temperature of the copper in °C, how it scatters, how well it is known, and where it is from."""
    if part.get("coil_temperature") is not None:
        given = float(part["coil_temperature"])
        return given, 0.0, _STATED_TEMPERATURE_STD_K, Note("Coil temperature as set: {was_c:g} °C.", was_c=given)
    if COIL_TEMPERATURE in samples.channels:
        measured = channel(samples, COIL_TEMPERATURE, "degC", "the electrical check")
        values = measured.values
        std = math.hypot(calibration_std(measured), 0.5)
        scatter = math.hypot(float(values.std()) / math.sqrt(len(values)), _rounding_std(samples, measured))
        note = Note("Coil temperature measured at its housing; ± 0.5 K are granted to the copper.")
        return float(values.mean()), scatter, std, note
    if conditions.get("fluid_temperature_c") is not None:
        given = float(conditions["fluid_temperature_c"])
        note = Note("Coil temperature taken to be the fluid's, {was_c:g} °C.", was_c=given)
        return given, 0.0, _STATED_TEMPERATURE_STD_K, note
    note = Note("Coil temperature not known; 72 °F ± 18 °F assumed. State it with coil_temperature.")
    return _REFERENCE_C, 0.0, 10.0, note


def _rounding_std(samples: Recording, of: Channel) -> float:
    """What the converter leaves in a mean of a channel that stands, as a standard uncertainty."""
    quietest = min(float(part.std()) for part in np.array_split(of.values, _PARTS))
    return mean_rounding_std(quietest, reading_step(samples, of))


def _notes(coil: Coil, ohm: float, voltage: str) -> list[Note]:
    """What the numbers mean, where it is not plain."""
    if coil.is_open:
        return [Note(
            "Coil or its wiring open: {current_a:.3g} A of {asked_a:g} A flow at {voltage_v:.3g} V.",
            current_a=coil.current_a, asked_a=coil.asked_a, voltage_v=coil.voltage_v,
        )]  # fmt: skip
    nominal, _ = RESISTANCE_OHM[int(voltage)]
    other = 24 if voltage == "12" else 12
    notes = []
    if ohm < 0.0:
        notes.append(Note("Voltage and current have opposite signs: the sense leads of one of them are swapped."))
    elif ohm < 0.3 * nominal:
        notes.append(Note(
            "Coil or its wiring shorted: {voltage_v:.3g} V drive {current_a:.3g} A.",
            voltage_v=coil.voltage_v, current_a=coil.current_a,
        ))  # fmt: skip
    elif abs(ohm - RESISTANCE_OHM[other][0]) <= RESISTANCE_OHM[other][1]:
        notes.append(Note("The resistance is that of a {other} V coil.", other=other))
    return notes
