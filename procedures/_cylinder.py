"""A cylinder on a position sensor: its stroke and speeds, what a test needs of them, and going to an end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hil.errors import InputError, SettingError
from hil.record.recording import Array
from hil.rig import Rig
from hil.units import is_convertible, scale_and_offset
from procedures._run_sequence import RunSequence
from procedures._scale import check_above

_CLOSED_MARGIN, _OPEN_MARGIN = 0.01, 0.06  # of the stroke, kept from either end; nothing stops an open loop at once
_PIECE_S = 0.05
_PIECES_AHEAD = 2  # that are under way when the last position is known
_PATIENCE = 4.0  # times the time that the rated speed needs


@dataclass(frozen=True, slots=True)
class Axis:
    """What a cylinder can do, in the unit of the response.

    Attributes:
        unit: of the position.
        closed: whether the command is a position (a closed loop), not an opening or a current.
        retracted, extended: readings at the ends.
        extend_per_s, retract_per_s: speeds at full command, by the rated flow and the areas.
        area_ratio: head over rod side.
    """

    unit: str
    closed: bool
    retracted: float
    extended: float
    extend_per_s: float
    retract_per_s: float
    area_ratio: float

    @property
    def stroke(self) -> float:
        """From end to end."""
        return self.extended - self.retracted

    @property
    def low(self) -> float:
        """Lowest reading that a test goes to."""
        return self.retracted + self._margin

    @property
    def high(self) -> float:
        """Highest reading that a test goes to."""
        return self.extended - self._margin

    @property
    def _margin(self) -> float:
        return (_CLOSED_MARGIN if self.closed else _OPEN_MARGIN) * self.stroke

    def speed_per_s(self, direction: int) -> float:
        """At full command, extending (1) or retracting (−1)."""
        return self.extend_per_s if direction > 0 else self.retract_per_s

    def check_position(self, setting: str, given: str, low: float, high: float) -> None:
        """Raise `SettingError` unless the cylinder can stand at every position from `low` to `high`."""
        if not (self.low <= low and high <= self.high):
            raise SettingError(
                f"setting {setting}: {given} needs {low:.4g} … {high:.4g} {self.unit}; a stroke of {self.stroke:g} "
                f"{self.unit} that begins at {self.retracted:g} {self.unit} allows {self.low:.4g} … {self.high:.4g}"
            )


def axis_of(
    rig: Rig, stroke_mm: float, retracted_mm: float | None, bore_mm: float, rod_mm: float, full_flow_lpm: float
) -> Axis:
    """The axis of a bench.

    Raises:
        SettingError: the response is no position, or a dimension cannot be.
    """
    per_mm = position_per_mm(rig)
    check_above("bore_mm", rod_mm, bore_mm, "mm")
    start_mm = -stroke_mm / 2.0 if retracted_mm is None else retracted_mm
    head_mm2, rod_side_mm2 = math.pi / 4.0 * bore_mm**2, math.pi / 4.0 * (bore_mm**2 - rod_mm**2)
    flow_mm3_per_s = full_flow_lpm * 1e6 / 60.0
    return Axis(
        rig.response.unit, is_convertible("mm", rig.command.unit), per_mm * start_mm, per_mm * (start_mm + stroke_mm),
        per_mm * flow_mm3_per_s / head_mm2, per_mm * flow_mm3_per_s / rod_side_mm2, head_mm2 / rod_side_mm2,
    )  # fmt: skip


def position_per_mm(rig: Rig) -> float:
    """What 1 mm is in the unit of the response.

    Raises:
        SettingError: the response is no position.
    """
    if not is_convertible("mm", rig.response.unit):
        raise SettingError(
            f"'{rig.response.name}' is in {rig.response.unit}; this test needs a response in mm or another length"
        )
    return scale_and_offset("mm", rig.response.unit)[0]


def approach(rig: Rig, sequence: RunSequence, target: float, opening: float, speed_per_s: float) -> None:
    """Drive an open loop until the position is going to pass a target, then wait at neutral.

    Args:
        rig: the bench.
        sequence: the run; its path must hold `opening` on both sides of neutral.
        target: in the unit of the response.
        opening: command that moves, counted from neutral, without its sign.
        speed_per_s: expected of it.

    Raises:
        InputError: the cylinder does not come there in four times the time that it should need.
    """
    name, unit = rig.response.name, rig.response.unit
    at = float(rig.hold(_PIECE_S, sequence.rate_hz).values(name)[-1])
    direction = math.copysign(1.0, target - at)
    longest_s = _PATIENCE * abs(target - at) / speed_per_s + 2.0
    piece = np.full(max(1, round(_PIECE_S * sequence.rate_hz)), rig.command.safe + direction * opening)

    arrived = False

    def pieces() -> Iterator[Array]:
        for _ in range(math.ceil(longest_s / _PIECE_S)):
            if arrived:
                return
            yield piece

    sequence.say(f"to {target:.4g} {unit}")
    for recorded in rig.stream(pieces(), sequence.rate_hz):
        moved = float(recorded.values(name)[-1]) - at
        at += moved
        arrived = arrived or direction * (target - at - _PIECES_AHEAD * moved) <= 0.0
    sequence.go_to(rig.command.safe)
    if not arrived:
        raise InputError(
            f"'{name}' stands at {at:.4g} {unit} after {longest_s:.3g} s on the way to {target:.4g} {unit}: no supply, "
            "a command inside the dead band, or one of the wrong sign"
        )
