"""Jog: one output by hand, to a value and back; what every input does meanwhile.

`hil jog BENCH CHANNEL VALUE` drives any output of a bench so; `hil run jog` drives its command.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.errors import SettingError
from hil.language.note import Note
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Channel, Recording
from hil.rig import Rig
from hil.session.manual_output import HELD, hold
from hil.signals.batch_mean import batch_mean
from hil.units import behind_a_number
from procedures._recorded import calibration_std, parts_if_any

READING = Measurement(
    "reading", "1", "mean of a channel while the output stands at its value",
    definition="over the second half of that time; uncertainty of the mean of ten pieces, and of the calibration",
)  # fmt: skip
NOISE = Measurement("noise", "1", "standard deviation of single readings over the same time")
MEASUREMENTS = (READING, NOISE)


def run(rig: Rig, *, value: float = 0.0, for_s: float = 2.0) -> None:
    """Drive it.

    Args:
        rig: the bench.
        value: where the output goes, in its unit.
        for_s: how long it stands there, in s.
    """
    if not (math.isfinite(value) and 0.0 < for_s < math.inf):
        raise SettingError(f"settings value = {value:g}, for_s = {for_s:g}: a number, and a time longer than 0 s")
    hold(rig, value, for_s)


def evaluate(recording: Recording) -> Findings:
    """What each channel read while the output stood there."""
    if not (held := parts_if_any(recording, HELD)):
        return Findings(notes=(Note("The output never stood at its value."),))
    measured = [
        found
        for part in held
        for channel in recording.channels.values()
        if not channel.name.startswith("delay of ")
        for found in _measured(channel, _settled(channel.values, part), _at(part) if len(held) > 1 else "")
    ]
    return Findings(tuple(measured), notes=tuple(map(_stood, held)))


def _stood(part: Mapping[str, Any]) -> Note:
    unit = behind_a_number(part["unit"])
    return Note("{channel} stood at {value:g}{unit}.", channel=part["channel"], value=part["to"], unit=unit)


def _settled(values: np.ndarray, part: Mapping[str, Any]) -> np.ndarray:
    """The second half of a part."""
    first, count = int(part["first"]), int(part["count"])
    return values[first + count // 2 : first + count]


def _at(part: Mapping[str, Any]) -> str:
    return f" at {part['to']:g}{behind_a_number(part['unit'])}"


def _measured(channel: Channel, values: np.ndarray, at: str) -> list[Measured]:
    place = f"{channel.name}{at}"
    if not len(values):
        return [READING.at(place, channel.unit).of(None)]
    mean, std = batch_mean(values)
    return [
        READING.at(place, channel.unit).of(mean, std, calibration=calibration_std(channel)),
        NOISE.at(place, channel.unit).of(float(values.std(ddof=1)) if len(values) > 2 else None),
    ]
