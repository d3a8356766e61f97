"""Commands that stand, at several supply pressures: how they are driven, and flow and valve pressure drop of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.errors import SettingError
from hil.record.recording import Array, Channel, Recording
from hil.rig import Rig
from procedures._characteristic import steady
from procedures._conditions import SUPPLY, adjusted, adjusting, adjusting_s, check_within, usual
from procedures._efc import SUPPLY_PRESSURE, channel_in, check_channels
from procedures._pressure_drop import LOAD_PRESSURE, RETURN_PRESSURE
from procedures._recorded import calibration_std
from procedures._run_sequence import RunSequence, joined
from procedures._scale import Scale, check_stands

KIND = "flow at a supply pressure"
LEAST = 3  # points of a law that say whether it is one


def drive_supplies(
    rig: Rig, scale: Scale, levels: Sequence[float], supplies: Sequence[float], needing: str, hold_s: float,
    warm_up_s: float, rate_hz: float,
) -> None:  # fmt: skip
    """Hold every level, in the unit of the command, at every supply pressure, in % of the bench's own.

    Raises:
        SettingError: a role or a channel is missing, or the bench may not go there; nothing has moved.
        RangeError: a level would leave the envelope; nothing has moved.
    """
    supply = adjusting(rig, SUPPLY, needing)
    check_channels(rig, (SUPPLY_PRESSURE, RETURN_PRESSURE), needing)
    check_stands(scale, needing)
    if len(supplies) < LEAST:
        raise SettingError(f"setting supplies: {len(supplies)} given; {needing} needs {LEAST} at least")
    pressures = [usual(supply) * percent / 100.0 for percent in supplies]
    check_within(supply, "supplies", pressures)
    held = max(2, round(hold_s * rate_hz))
    pieces = [np.full(held, level) for level in levels]
    ways = [{SUPPLY: pressure} for pressure in pressures]
    first, once = (joined(rig, rate_hz, warm_s, pieces) for warm_s in (warm_up_s, 0.0))
    path = np.concatenate([first, *[once] * (len(ways) - 1)])
    sequence = RunSequence(rig, rate_hz, path, {"supplies_bar": pressures}, adjusting_s(rig, ways))
    for number, (way, pressure) in enumerate(zip(ways, pressures, strict=True)):
        with adjusted(rig, way, rate_hz):
            if warm_up_s and not number:
                sequence.warm_up(levels[0], warm_up_s)
            for level, piece in zip(levels, pieces, strict=True):
                sequence.go_to(level)
                label = scale.label(level)
                part = {"kind": KIND, "label": label, "supply": f"supply {pressure:.4g} {supply.unit}"}
                sequence.play(piece, f"{label} at {part['supply']}", part)
            sequence.finish()


@dataclass(frozen=True, slots=True)
class Points:
    """Flow and valve pressure drop of one command.

    Attributes:
        flow, drop: means and their standard uncertainties from noise, shape (n, 2); the drop in bar.
        meter, gauges: standard uncertainty of all flows, and of all drops, by calibration.
    """

    flow: Array
    drop: Array
    meter: float
    gauges: float

    @classmethod
    def of(cls, recording: Recording, parts: Sequence[Mapping[str, Any]], response: Channel) -> Points:
        """Of the parts, in their order; a drop is supply − return − size of the load pressure, where that was read."""
        names = [SUPPLY_PRESSURE, RETURN_PRESSURE, *({LOAD_PRESSURE} & recording.channels.keys())]
        channels = [channel_in(recording, name, "bar") for name in names]
        read = np.array([[steady(recording, part, channel) for channel in channels] for part in parts])
        drop = read[:, 0, 0] - np.abs(read[:, 1:, 0]).sum(axis=1)
        return cls(
            np.array([steady(recording, part, response) for part in parts]),
            np.column_stack((drop, np.hypot.reduce(read[:, :, 1], axis=1))),
            calibration_std(response), math.hypot(*map(calibration_std, channels)),
        )  # fmt: skip

    @property
    def rising(self) -> Points:
        """The same by rising drop."""
        order = np.argsort(self.drop[:, 0])
        return replace(self, flow=self.flow[order], drop=self.drop[order])

    @property
    def have_a_law(self) -> bool:
        """Whether they are enough, flow one way, and under pressure."""
        signs = np.sign(self.flow[:, 0])
        return len(self.flow) >= LEAST and bool(np.all(self.drop[:, 0] > 0.0)) and abs(signs.sum()) == len(signs)


def by_command(parts: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """The parts of each command, by its label."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for part in parts:
        found.setdefault(str(part["label"]), []).append(part)
    return found
