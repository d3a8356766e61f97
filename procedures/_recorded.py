"""What every evaluation asks of a recording: its channels by role, its measuring chain, its parts, its conditions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.errors import FileError
from hil.identification.frequency.measuring_chain import MeasuringChain
from hil.language.note import Note
from hil.record.conditions import measured_conditions
from hil.record.measurement import COVERAGE_FACTOR
from hil.record.recording import Array, Channel, Recording
from hil.signals.rounding import rounding_step
from hil.units import scale_and_offset

_TEMPERATURE_C, _TEMPERATURE_TOLERANCE_C = 40.0, 4.0
_SPAN = 50  # samples over which the interval that was planned is judged
# Driving and reading are an exchange each, stamped in the middle; the device acts anywhere within them. The delay is
# half of both, so that two equal rectangles, each a whole delay wide, have this share of it as standard deviation.
_WITHIN_EXCHANGES = 6.0**-0.5
_STATED = {
    "fluid": Note("the fluid"),
    "viscosity_class": Note("the viscosity class of the fluid"),
    "fluid_temperature_c": Note("the temperature of the fluid"),
    "supply_pressure_bar": Note("the supply pressure"),
}

NO_ONSET = Note("noise alone reaches 2 % of the change; the onset cannot be determined.")


def roles_of(recording: Recording) -> tuple[Channel, Channel]:
    """The command and the response.

    Raises:
        FileError: the recording does not say which they are.
    """
    roles = recording.meta.get("roles", {})
    if not {"command", "response"} <= set(roles):
        raise FileError(f"{recording.name}: it does not say which channels are the command and the response")
    return recording.channel(roles["command"]), recording.channel(roles["response"])


def settings_of(recording: Recording) -> Mapping[str, Any]:
    """The settings of the run, defaults included."""
    return recording.meta["settings"]


def parts_of(recording: Recording, kind: str) -> list[Mapping[str, Any]]:
    """What the procedure said about its samples, of one kind.

    Raises:
        FileError: nothing of that kind was recorded.
    """
    if not (found := parts_if_any(recording, kind)):
        raise FileError(f"{recording.name}: no part of kind '{kind}' was recorded; the run ended before it")
    return found


def parts_if_any(recording: Recording, kind: str) -> list[Mapping[str, Any]]:
    """The same; empty where the run ended before it."""
    return [part for part in recording.meta.get("parts", ()) if part.get("kind") == kind]


def rows_of(part: Mapping[str, Any]) -> slice:
    """The samples of a part, of an array of all."""
    return slice(int(part["first"]), int(part["first"]) + int(part["count"]))


def noted(recording: Recording, event: str) -> list[Mapping[str, Any]]:
    """Details of every event of a name."""
    return [found.get("details", {}) for found in recording.meta.get("events", ()) if found.get("event") == event]


def chain_of(recording: Recording) -> MeasuringChain:
    """What lies between the command and the response as they were recorded, as far as the bench states it.

    Where each sample of the response has a stamp of its own, the estimators have used it and no delay is left.
    """
    _, response = roles_of(recording)
    lag_s = float(response.calibration.get("lag_s") or 0.0)
    if has_own_stamps(recording):
        delay_s = float(np.mean(recording.stamps(response.name) - recording.time_s))
        return MeasuringChain(
            lag_s, hold_s=_planned_interval_s(recording.time_s), read_std_s=abs(delay_s) * _WITHIN_EXCHANGES
        )
    sampling = recording.meta.get("sampling", {})
    interval_s = recording.interval_s
    read_at_s = float(sampling.get("read_at") or 0.0) * interval_s
    delay_s = float(sampling.get("delay_s", {}).get(response.name, read_at_s))
    return MeasuringChain(lag_s, delay_s - read_at_s, interval_s, read_at_s)


def reading_of(recording: Recording, chain: MeasuringChain) -> Note:
    """When the response was read, in words."""
    if not has_own_stamps(recording):
        late_ms = 1e3 * (chain.skew_s + chain.read_at_s)
        return Note("response read {late_ms:.3g} ms after the command changes", late_ms=late_ms)
    delay_s = recording.stamps(roles_of(recording)[1].name) - recording.time_s
    return Note(
        "each sample of the response taken when it was read, {late_ms:.3g} ms (standard deviation {std_ms:.2g} ms) "
        "after the command changes",
        late_ms=1e3 * np.mean(delay_s), std_ms=1e3 * np.std(delay_s),
    )  # fmt: skip


def has_own_stamps(recording: Recording) -> bool:
    """Whether the recording says of every sample of the response when it was read."""
    return recording.stamps(roles_of(recording)[1].name) is not recording.time_s


def _planned_interval_s(time_s: Array) -> float:
    """The sample interval that the host was to keep.

    A sample that comes late makes one interval longer and those after it shorter: together they hold the command as
    long as planned, and on the whole half a planned interval is what holding delays it by. Pauses between tasks are
    in few spans.
    """
    span = min(_SPAN, len(time_s) - 1)
    return float(np.median(time_s[span:] - time_s[:-span])) / span


def reading_step(recording: Recording, channel: Channel) -> float:
    """How far two readings of a channel lie apart at least; 0 where neither they nor the bench tell it.

    Readings that stand on one code tell nothing of it: what the device says of its converter is taken then.
    """
    seen = rounding_step(channel.values)
    step = recording.meta.get("read", {}).get(channel.name, {}).get("step")
    if seen or not step:
        return seen
    per, _ = scale_and_offset(recording.channel(channel.name).unit, channel.unit)
    return abs(per) * float(step)


def calibration_std(channel: Channel) -> float:
    """Standard uncertainty of a level of a channel by its calibration; 0 when nobody stated one."""
    return float(channel.calibration.get("uncertainty") or 0.0) / COVERAGE_FACTOR


def calibration_share(channel: Channel) -> float:
    """Standard uncertainty of a difference of two levels of a channel, as a share of it, by its calibration.

    A level is stated to be within so much wherever it lies, so the slope is off by no more than that over the largest
    level that was read. An offset cancels in a difference.
    """
    largest = float(np.max(np.abs(channel.values)))
    return calibration_std(channel) / largest if largest else 0.0


def departures(recording: Recording) -> tuple[Note, ...]:
    """Where the stated conditions depart from those of the standard, a sentence each."""
    conditions = recording.meta.get("conditions", {})
    silent = tuple(words for name, words in _STATED.items() if conditions.get(name) in (None, ""))
    found = [Note("Not stated: {listed}.", listed=silent)] if silent else []
    measured = measured_conditions(recording).get("fluid_temperature_c")
    temperature_c = conditions.get("fluid_temperature_c") if measured is None else measured.mean
    if temperature_c is not None and abs(float(temperature_c) - _TEMPERATURE_C) > _TEMPERATURE_TOLERANCE_C:
        found.append(
            Note("The fluid was at {was_c:.3g} °C; {asked_c:g} °C is customary.",
                 was_c=temperature_c, asked_c=_TEMPERATURE_C)
        )  # fmt: skip
    return tuple(found)
