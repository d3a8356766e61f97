"""What the procedures of the Cummins EFC share: channels by name, what instruments are known to, and playing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.errors import FileError, SettingError
from hil.record.recording import Array, Channel, Recording
from hil.rig import Rig
from hil.units import is_convertible, scale_and_offset
from procedures._recorded import parts_if_any

COIL_CURRENT, COIL_VOLTAGE, COIL_TEMPERATURE = "coil current", "coil voltage", "coil temperature"
THROUGH_FLOW, SUPPLY_PRESSURE = "through flow", "supply pressure"


@dataclass(frozen=True, slots=True)
class Stage:
    """A piece of command that is played without a gap, what the operator reads, and what the record says it is."""

    command: Array
    text: str
    part: Mapping[str, Any]


def play(rig: Rig, stages: Sequence[Stage], rate_hz: float) -> list[Recording]:
    """Check every stage, then play one after the other, each from a ramp to where it begins; ends at the safe value.

    The limits of the command stay as they are, so that another procedure may follow in the same run.

    Raises:
        SettingError: the command is no current in A, or the response no pressure.
        RangeError: a stage would leave the envelope; nothing has moved.
    """
    if rig.command.unit != "A":
        raise SettingError(
            f"command '{rig.command.name}' is in {rig.command.unit}; a test of an EFC states its currents in A"
        )
    if not is_convertible(rig.response.unit, "psi"):
        raise SettingError(
            f"'{rig.response.name}' is in {rig.response.unit}; a test of an EFC needs a response in psi or another "
            "pressure"
        )
    for stage in stages:
        rig.check(stage.command, rate_hz)
    made = []
    at: float | None = None
    rig.expect(expected_s(rig, stages, rate_hz))
    for stage in stages:
        rig.progress(0.0, stage.text)
        if at != stage.command[0]:
            rig.ramp_to(float(stage.command[0]), rate_hz)
        made.append(rig.play(stage.command, rate_hz, part=stage.part))
        at = float(stage.command[-1])
    if at != rig.command.safe:
        rig.ramp_to(rig.command.safe, rate_hz)
    return made


def expected_s(rig: Rig, stages: Sequence[Stage], rate_hz: float) -> float:
    """Bench time of stages, in s: those that begin where the one before them ended need no ramp."""
    ends = [rig.command.safe, *(float(stage.command[-1]) for stage in stages)]
    ramps = 1 + sum(float(stage.command[0]) != end for stage, end in zip(stages, ends, strict=False))
    return sum(len(stage.command) for stage in stages) / rate_hz + ramps * rig.settling_s


def check_channels(rig: Rig, names: Sequence[str], needed_for: str) -> None:
    """Raise `SettingError` before anything moves when the bench does not read a channel."""
    missing = [name for name in names if name not in rig.promises["delay_s"]]
    if missing:
        have = ", ".join(rig.promises["delay_s"])
        raise SettingError(f"{needed_for} needs the channels {', '.join(missing)}; the bench reads: {have}")


def channel(recording: Recording, name: str, unit: str, needed_for: str) -> Channel:
    """A channel that is known by its name, with its stated uncertainty, in this unit.

    Raises:
        FileError: there is none; says what it is needed for.
        UnitError: it is in a unit of another kind.
    """
    if name not in recording.channels:
        raise FileError(f"{recording.name}: {needed_for} needs a channel '{name}' [{unit}]; the bench has none")
    return channel_in(recording, name, unit)


def channel_in(recording: Recording, name: str, unit: str) -> Channel:
    """A channel with its stated uncertainty in this unit. Raises `UnitError` for one of another kind."""
    found, values = recording.channel(name), recording.values(name, unit)
    if found.unit == unit:
        return found
    per, _ = scale_and_offset(found.unit, unit)
    uncertainty = found.calibration.get("uncertainty")
    known = {} if uncertainty is None else {"uncertainty": abs(per) * float(uncertainty)}
    return replace(found, unit=unit, values=values, calibration={**found.calibration, **known})


def part_recordings(recording: Recording, kind: str) -> list[tuple[Mapping[str, Any], Recording]]:
    """Every part of a kind with its samples; empty when the run ended before it."""
    found = parts_if_any(recording, kind)
    return [(part, recording.rows(part["first"], part["count"])) for part in found]


def held(level: float, duration_s: float, rate_hz: float) -> Array:
    """A command that stands."""
    return np.full(max(1, round(duration_s * rate_hz)), level)
