"""The valve pressure drop at which a rated flow was taken: supply less return pressure, less that of the load."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hil.record.measurement import Measured, Measurement
from hil.record.recording import Recording
from hil.signals.rounding import mean_rounding_std
from procedures._characteristic import at_ends
from procedures._efc import SUPPLY_PRESSURE, channel_in
from procedures._recorded import calibration_std, reading_step

RETURN_PRESSURE, LOAD_PRESSURE = "return pressure", "load pressure"


def pressure_drops(
    recording: Recording, parts: Sequence[Mapping[str, Any]], of: Mapping[str, Measurement]
) -> list[Measured]:
    """At both ends of the sweeps; nothing where supply or return pressure was not recorded."""
    if not {SUPPLY_PRESSURE, RETURN_PRESSURE} <= recording.channels.keys():
        return []
    names = [SUPPLY_PRESSURE, RETURN_PRESSURE, *({LOAD_PRESSURE} & recording.channels.keys())]
    channels = [channel_in(recording, name, "bar") for name in names]
    supply, back, *load = (channel.values for channel in channels)
    drop = supply - back - sum((np.abs(one) for one in load), np.zeros(len(supply)))
    calibration = math.hypot(*map(calibration_std, channels))
    coded = math.hypot(*(mean_rounding_std(0.0, reading_step(recording, channel)) for channel in channels))
    return [
        of[f"pressure_drop_{end}"].of(found.response, math.hypot(found.std, coded), calibration=calibration)
        for end, found in zip(("low", "high"), at_ends(recording, parts, drop), strict=True)
    ]
