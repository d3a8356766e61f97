"""A recording: named channels with units on one time base."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hil.arrays import Array as Array
from hil.arrays import Complex as Complex
from hil.arrays import Integers as Integers
from hil.arrays import Mask as Mask
from hil.errors import FileError, UnitError, listed, naming, option
from hil.record.parts import moved
from hil.record.show import data_frame, dataset, figure_by_unit, table_html
from hil.units import check_unit, convert

SAME_STAMP = 1e-3  # of an interval, by which stamps of an even recording may differ
# A picture shows no more points of a channel.
_MOST_POINTS = 20_000
_HEADING = re.compile(r"^\s*(?P<name>.+?)\s*\[(?P<unit>[^\[\]]*)\]\s*$")
_LARGEST = 1e150  # of a sample: sums of squares of larger ones are no numbers


def split_heading(text: str) -> tuple[str, str]:
    """`"flow [l/min]"` → `("flow", "l/min")`; text without a unit raises `UnitError`."""
    match = _HEADING.match(text)
    if match is None:
        raise UnitError(f"'{text.strip()}' is not 'name [unit]'; write the unit, [1] if there is none")
    return match["name"], match["unit"].strip() or "1"


@dataclass(frozen=True, slots=True)
class Channel:
    """Samples of one quantity, in the unit it was recorded in.

    `source` names the instrument; `calibration` carries slope, offset, date and uncertainty as they stood
    when the samples were taken (see `hil.daq.calibration`), already applied to `values`.
    """

    name: str
    unit: str
    values: Array
    source: str = ""
    calibration: Mapping[str, Any] = field(default_factory=dict)

    @property
    def heading(self) -> str:
        """`name [unit]`, as in a column header."""
        return f"{self.name} [{self.unit}]"


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """What was sampled, and when: stamps in s and values, both of shape (n,)."""

    time_s: Array
    values: Array

    def held_at(self, time_s: Array) -> Array:
        """The last value at or before each of these times; the first one before there was any."""
        # a stamp that differs by its rounding alone is the same one
        step = 1e-6 * float(np.min(np.diff(self.time_s))) if len(self.time_s) > 1 else 0.0
        reached = np.searchsorted(self.time_s, time_s + step, side="right")
        return self.values[np.clip(reached - 1, 0, len(self.values) - 1)]


@dataclass(frozen=True, slots=True)
class Recording:
    """Channels on one time base.

    Attributes:
        name: the file or run it came from; used in every message about it.
        time_s: time stamps the samples really had, strictly increasing, not necessarily even. Shape (n,).
        channels: by name, each of shape (n,).
        meta: what else is known: procedure, settings, conditions, hold, device promises (JSON values).
        own: the samples as they were taken of channels that were sampled at other times than `time_s`, in the channel's
            unit. In `channels` their last value is held.
    """

    name: str
    time_s: Array
    channels: Mapping[str, Channel]
    meta: Mapping[str, Any] = field(default_factory=dict)
    own: Mapping[str, Samples] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time_s)

    def _repr_html_(self) -> str:
        rows = [
            (c.name, c.unit, f"{np.nanmin(c.values):.4g} … {np.nanmax(c.values):.4g}", c.source)
            for c in self.channels.values()
        ]
        caption = f"{self.name}: {len(self)} samples, {self.duration_s:g} s"
        return table_html(("channel", "unit", "range", "source"), rows, caption)

    def plot(self, *names: str) -> Any:
        """A matplotlib figure of these channels, of all when none is named; an axis for each unit."""
        shown = slice(None, None, max(1, len(self) // _MOST_POINTS))
        chosen = [self.channel(name) for name in names or self.channels]
        return figure_by_unit([(c.name, c.unit, c.values[shown]) for c in chosen], "time [s]", self.time_s[shown])

    def to_pandas(self) -> Any:
        """A pandas DataFrame: columns `name [unit]`, indexed by `time [s]`."""
        return data_frame({c.heading: c.values for c in self.channels.values()}, "time [s]", self.time_s)

    def to_xarray(self) -> Any:
        """An xarray Dataset over `time`, units as attributes. Raises `InputError` without xarray."""
        variables = {c.name: (c.values, c.unit) for c in self.channels.values()}
        return dataset(variables, ("time", self.time_s, "s"), self.name)

    @property
    def duration_s(self) -> float:
        """From the first stamp to the last."""
        return float(self.time_s[-1] - self.time_s[0]) if len(self.time_s) else 0.0

    @property
    def interval_s(self) -> float:
        """The median sample interval."""
        return float(np.median(np.diff(self.time_s)))

    def is_even(self, tolerance: float = 0.02) -> bool:
        """Whether every interval is within `tolerance` (relative) of the median one."""
        step = np.diff(self.time_s)
        return bool(np.all(np.abs(step - np.median(step)) <= tolerance * np.median(step)))

    def channel(self, name: str) -> Channel:
        """A channel by its name; `name [unit]` is accepted too.

        Raises:
            FileError: no such channel; the message lists what there is.
        """
        wanted = name if name in self.channels or "[" not in name else split_heading(name)[0]
        if wanted not in self.channels:
            have = listed(channel.heading for channel in self.channels.values())
            raise FileError(f"{self.name}: no channel '{wanted}'; it has: {have}")
        return self.channels[wanted]

    def values(self, name: str, unit: str | None = None) -> Array:
        """Samples of a channel, converted to `unit` when one is given."""
        channel = self.channel(name)
        return channel.values if unit is None else self._in_unit(channel, channel.values, unit)

    def samples(self, name: str, unit: str | None = None) -> Samples:
        """A channel as it was sampled, converted to `unit` when one is given."""
        channel = self.channel(name)
        taken = self.own.get(channel.name) or Samples(self.time_s, channel.values)
        return taken if unit is None else replace(taken, values=self._in_unit(channel, taken.values, unit))

    def _in_unit(self, channel: Channel, values: Array, unit: str) -> Array:
        try:
            return convert(values, channel.unit, unit)
        except UnitError as error:
            missing = channel.name in self.meta.get("units_missing", ())
            if missing:
                raise UnitError(
                    f"{self.name}: no unit is stated for channel '{channel.name}', and '{unit}' is needed; say it with "
                    f"{option('unit', f'{channel.name}={unit}')} if that is what it is"
                ) from None
            raise UnitError(
                f"{self.name}: channel '{channel.heading}': {error}; if the heading is wrong, say the right unit with "
                f"{option('unit', f'{channel.name}=UNIT')}"
            ) from None

    def stamps(self, name: str) -> Array:
        """When each sample of a channel was taken: `time_s`, and later where a link was asked for it afterwards.

        Over a link every sample has a delay of its own, recorded beside it (`meta["sampling"]["delay_channels"]`).
        """
        delay = self.delay_channels.get(self.channel(name).name)
        if delay is None or delay not in self.channels:
            return self.time_s
        return self.time_s + self.values(delay, "s")

    @property
    def delay_channels(self) -> Mapping[str, str]:
        """By channel that was asked over a link, the one with the delay of each of its samples."""
        sampling = self.meta.get("sampling")
        return (sampling.get("delay_channels") if isinstance(sampling, Mapping) else None) or {}

    def part(self, start_s: float, stop_s: float) -> Recording:
        """The samples with start_s ≤ time < stop_s, stamps unchanged."""
        first, end = np.searchsorted(self.time_s, [start_s, stop_s])
        return self.rows(int(first), max(0, int(end - first)))

    def rows(self, first: int, count: int) -> Recording:
        """So many samples from `first` on, stamps unchanged; `meta` speaks of these samples only.

        `recording.rows(part["first"], part["count"])` is what belongs to one of `meta["parts"]`.
        """
        keep = slice(first, first + count)
        channels = {name: replace(c, values=c.values[keep]) for name, c in self.channels.items()}
        time_s = self.time_s[keep]
        own = {name: _samples_within(taken, time_s) for name, taken in self.own.items()} if len(time_s) else {}
        meta = moved(self.meta, lambda row: row - first, time_s)
        return replace(self, time_s=time_s, channels=channels, meta=meta, own=own)

    def with_units(self, units: Mapping[str, str]) -> Recording:
        """The same values with stated units for some channels, whatever the file said; nothing is converted.

        Raises:
            FileError: no such channel.
            UnitError: a unit is unknown.
        """
        channels = dict(self.channels)
        for name, unit in units.items():
            check_unit(unit)
            channels[self.channel(name).name] = replace(self.channel(name), unit=unit)
        missing = [name for name in self.meta.get("units_missing", ()) if name not in units]
        meta = {key: value for key, value in self.meta.items() if key != "units_missing"}
        return replace(self, channels=channels, meta={**meta, "units_missing": missing} if missing else meta)


def _samples_within(taken: Samples, time_s: Array) -> Samples:
    """The samples within a stretch of time, and the one before that still holds at its start."""
    first = max(int(np.searchsorted(taken.time_s, time_s[0], side="right")) - 1, 0)
    keep = slice(first, max(int(np.searchsorted(taken.time_s, time_s[-1], side="right")), first + 1))
    return Samples(taken.time_s[keep], taken.values[keep])


def recording(
    name: str, time_s: Array, columns: Mapping[str, Array], meta: Mapping[str, Any] | None = None
) -> Recording:
    """A recording from `{"flow [l/min]": values, …}`, checked.

    Raises:
        FileError: lengths differ, a value is not finite, or time does not increase; says where.
        UnitError: a heading without a unit.
    """
    channels = {}
    for heading, values in columns.items():
        label, unit = split_heading(heading)
        channels[label] = Channel(label, unit, np.ascontiguousarray(values, dtype=np.float64))
    made = Recording(name, np.ascontiguousarray(time_s, dtype=np.float64), channels, dict(meta or {}))
    check(made)
    return made


def sample(index: int) -> str:
    """Where a sample stands, in a file that has no lines."""
    return f"sample {index}"


def check(recording: Recording, *, place: Callable[[int], str] = sample, measured: bool = True) -> None:
    """Raise `FileError` unless the recording is finite, of one length, and its time increases.

    Args:
        recording: what is looked at.
        place: says where a sample stands, so that a reader can speak of lines of its file.
        measured: every sample must be a measurement; otherwise some may be none (see `hil.record.invalid_samples`).
    """
    with naming(recording.name):
        check_samples(recording.time_s, recording.channels, place=place, measured=measured)


def check_samples(
    time_s: Array, channels: Mapping[str, Channel], *, place: Callable[[int], str] = sample, measured: bool = True
) -> None:
    """The same of samples that are no recording yet; the message does not name their file."""
    if "time" in channels:
        raise FileError("a channel is named 'time' like the time base; give it another name")
    if len(time_s) < 2:
        raise FileError(f"{len(time_s)} samples; at least 2 are needed")
    for channel in channels.values():
        if channel.values.shape != time_s.shape:
            raise FileError(f"channel '{channel.heading}' has {channel.values.size} samples, time has {time_s.size}")
    _check_finite("time", time_s, place)
    for channel in channels.values() if measured else ():
        _check_finite(channel.heading, channel.values, place)
    rises = np.diff(time_s) > 1.0 / _LARGEST
    if not rises.all():
        i = int(np.argmin(rises)) + 1
        raise FileError(
            f"{place(i)}: time {time_s[i]:.12g} s does not come after {time_s[i - 1]:.12g} s; time must "
            f"increase{_repeated(time_s)}"
        )


def _repeated(time_s: Array) -> str:
    """What helps where stamps are rounded so that several samples share one."""
    steps = np.diff(time_s)
    moves = steps[steps != 0.0]
    again = steps.size - moves.size
    if again and moves.size and moves.min() > 0.0 and again <= 0.1 * time_s.size:
        return (
            f". {again} of {time_s.size} samples have the stamp of the one before; {option('gaps')} leaves them out, "
            f"{option('interval', 'S')} reads all of them as evenly spaced"
        )
    if steps.size and steps.min() < 0.0 and np.unique(time_s).size == time_s.size:
        return ". No two rows have the same time: they stand out of order; sort them by it"
    if not moves.size or moves.min() < 0.0 or moves.size > 0.8 * steps.size:
        return f". If the samples are evenly spaced, {option('interval', 'S')} gives their distance in seconds"
    first, last = (1 + np.flatnonzero(steps)[[0, -1]]).tolist()  # at either end a stamp may have fewer samples
    each = (last - first) / max(moves.size - 1, 1)
    apart_s = (time_s[last] - time_s[first]) / max(last - first, 1)
    if last == first:  # one change of the stamp tells no distance
        return f". If the samples are evenly spaced, {option('interval', 'S')} gives their distance in seconds"
    return (
        f". About {each:.3g} samples share each stamp, as when stamps were rounded; if they are "
        f"evenly spaced, {option('interval', 'S')} gives their distance in seconds, here about {apart_s:.3g}"
    )


def _check_finite(heading: str, values: Array, place: Callable[[int], str]) -> None:
    usable = np.abs(values) <= _LARGEST
    if not usable.all():
        bad = np.flatnonzero(~usable)
        what = f"beyond ±{_LARGEST:g}" if np.isfinite(values[bad[0]]) else "not a number"
        raise FileError(
            f"{place(int(bad[0]))}, channel '{heading}': {values[bad[0]]} is {what} "
            f"({bad.size} such sample{'s' if bad.size > 1 else ''}); mend them, or leave them out with {option('gaps')}"
        )
