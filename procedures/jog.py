"""Jog: one output by hand, to a value and back; what every input does meanwhile.

`hil jog BENCH CHANNEL VALUE` drives any output of a bench so; `hil run jog` drives its command.
"""

from __future__ import annotations

import math

import numpy as np

from hil.errors import SettingError
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Channel, Recording
from hil.rig import Rig
from hil.session.by_hand import HELD, hold

READING = Measurement(
    "reading", "1", "mean of a channel while the output stands at its value",
    definition="over the second half of that time; uncertainty of the mean of ten pieces, and of the calibration",
)  # fmt: skip
NOISE = Measurement("noise", "1", "standard deviation of single readings over the same time")
MEASUREMENTS = (READING, NOISE)

_PIECES = 10
_FEWEST = 20


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
    held = [part for part in recording.meta.get("parts", ()) if part.get("kind") == HELD]
    if not held:
        return Findings(notes=("The output never stood at its value.",))
    first, count = int(held[0]["first"]), int(held[0]["count"])
    chosen = slice(first + count // 2, first + count)
    measured = [
        found
        for channel in recording.channels.values()
        if not channel.name.startswith("delay of ")
        for found in _measured(channel, channel.values[chosen])
    ]
    notes = (f"{held[0]['channel']} stood at {held[0]['to']:g} {held[0]['unit']}.",)
    return Findings(tuple(measured), notes=notes)


def _measured(channel: Channel, values: np.ndarray) -> list[Measured]:
    if len(values) < _FEWEST:
        value = float(values.mean()) if len(values) else None
        return [READING.at(channel.name, channel.unit).of(value)]
    means = [piece.mean() for piece in np.array_split(values, _PIECES)]
    std = float(np.std(means, ddof=1)) / math.sqrt(_PIECES)
    expanded = (channel.calibration or {}).get("uncertainty") or 0.0
    return [
        READING.at(channel.name, channel.unit).of(float(values.mean()), std, calibration=0.5 * expanded),
        NOISE.at(channel.name, channel.unit).of(float(values.std(ddof=1))),
    ]
