"""Coil by hand: resistance cold and hot, inductance and insulation as an instrument beside the bench showed them.

Nothing is driven: what was read is typed in with its expanded uncertainty and the instrument, and is judged, reported
and kept as any measured value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.errors import SettingError
from hil.identification.steady.coil import COPPER_PER_K
from hil.language.note import Note
from hil.record.measurement import COVERAGE_FACTOR, Findings, Measured, Measurement
from hil.record.recording import Recording
from hil.rig import Rig
from procedures._definitions import COILS, defined
from procedures._recorded import parts_of
from procedures._run_sequence import RunSequence
from procedures._settings import Celsius, NotNegative, NotNegativePercent, Positive

COLD = Measurement("coil_resistance_cold", "ohm", "resistance of the coil after it rested at ambient temperature")
HOT = Measurement("coil_resistance_hot", "ohm", "resistance of the warm coil just after it was switched off")
INDUCTANCE = Measurement("coil_inductance", "mH", "inductance of the coil")
INSULATION = Measurement("insulation_resistance", "Mohm", "resistance between the coil and its housing")
WARMED = Measurement("coil_temperature_rise", "K", "how much warmer the copper was when hot than when cold")
MEASUREMENTS = defined(COILS, COLD, HOT, INDUCTANCE, INSULATION, WARMED)
_LATEST_S = 1.0  # ISO 10770-2:2012, 7.2: hot, within 1 s of switching off
_COPPER_REFERENCE_C = 20.0


def run(
    rig: Rig,
    *,
    instrument: str = "",
    cold: Positive | None = None,
    hot: Positive | None = None,
    inductance: Positive | None = None,
    insulation: Positive | None = None,
    resistance_uncertainty: NotNegativePercent | None = None,
    inductance_uncertainty: NotNegativePercent | None = None,
    insulation_uncertainty: NotNegativePercent | None = None,
    ambient: Celsius = 20.0,
    switched_off_s: NotNegative = 1.0,
    rate_hz: Positive | None = None,
) -> None:
    """Keep what was read; the command stays at its safe value.

    Args:
        rig: the bench.
        instrument: its name, serial number and certificate.
        cold: resistance after a rest of at least 2 h at ambient temperature, in ohm.
        hot: resistance after its temperature had settled under current, in ohm.
        inductance: in mH.
        insulation: resistance between coil and housing, in Mohm.
        resistance_uncertainty: expanded uncertainty (k = 2) of both resistances, in % of the reading.
        inductance_uncertainty: expanded uncertainty of the inductance, in %.
        insulation_uncertainty: expanded uncertainty of the insulation resistance, in %.
        ambient: temperature of the cold coil, in °C.
        switched_off_s: time from switching off to the hot reading, in s.
        rate_hz: sample rate; that of the bench when not given.
    """
    readings = {"cold": cold, "hot": hot, "inductance": inductance, "insulation": insulation}
    if not any(value is not None for value in readings.values()):
        raise SettingError(f"settings {', '.join(readings)}: none is given; at least one reading is needed")
    if not instrument.strip():
        raise SettingError("setting instrument: empty; a reading needs the instrument that it was read from")
    rate_hz = rig.actual_rate_hz(rate_hz)
    still = np.full(max(2, round(rig.settling_s * rate_hz)), rig.command.safe)
    sequence = RunSequence(rig, rate_hz, still, {"instrument": instrument})
    uncertainties = {
        "cold": resistance_uncertainty,
        "hot": resistance_uncertainty,
        "inductance": inductance_uncertainty,
        "insulation": insulation_uncertainty,
    }
    about = {"kind": "coil by hand", "instrument": instrument, "ambient": ambient, "switched_off_s": switched_off_s}
    sequence.play(still, "readings by hand", {**about, "readings": readings, "uncertainties": uncertainties})
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """The readings with their uncertainties, and how warm the copper became."""
    (typed,) = parts_of(recording, "coil by hand")
    whats = {"cold": COLD, "hot": HOT, "inductance": INDUCTANCE, "insulation": INSULATION}
    measured = [_reading(what, typed, name) for name, what in whats.items() if typed["readings"][name] is not None]
    readings = typed["readings"]
    if readings["cold"] is not None and readings["hot"] is not None:
        measured.append(_warmed(typed))
    late = readings["hot"] is not None and typed["switched_off_s"] > _LATEST_S
    hot = Note("Hot resistance read {time_s:g} s after switching off; 1 s is allowed.", time_s=typed["switched_off_s"])
    source = Note("Read by hand from {instrument}.", instrument=typed["instrument"])
    return Findings(tuple(measured), notes=(source,), deviations=(hot,) * late)


def _reading(what: Measurement, typed: Mapping[str, Any], name: str) -> Measured:
    """All of the uncertainty is the instrument's: a repeat with it would show the same."""
    value, expanded = float(typed["readings"][name]), typed["uncertainties"][name]
    if expanded is None:
        return what.of(value, None)
    return what.of(value, 0.0, calibration=value * float(expanded) / 100.0 / COVERAGE_FACTOR)


def _warmed(typed: Mapping[str, Any]) -> Measured:
    """R(T) of copper is a straight line; errors of both readings are taken as independent."""
    ratio = float(typed["readings"]["hot"]) / float(typed["readings"]["cold"])
    per_ratio = 1.0 / COPPER_PER_K + float(typed["ambient"]) - _COPPER_REFERENCE_C
    expanded = typed["uncertainties"]["hot"]
    if expanded is None:
        return WARMED.of(per_ratio * (ratio - 1.0), None)
    std = per_ratio * ratio * math.sqrt(2.0) * float(expanded) / 100.0 / COVERAGE_FACTOR
    return WARMED.of(per_ratio * (ratio - 1.0), 0.0, calibration=std)
