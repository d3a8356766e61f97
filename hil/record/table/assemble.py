"""A recording from the tables of a file: time bases found and kept, what is no signal left out.

Whatever had to be assumed or changed on the way is said in `meta["assumed"]`, a sentence each. Channels without
a stated unit get 1 and are named in `meta["units_missing"]`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.errors import FileError, UnitError, listed, naming, option
from hil.language.note import Note
from hil.record.reading import AS_IT_IS, Reading
from hil.record.recording import SAME_STAMP, Array, Channel, Recording, Samples, check_samples, sample
from hil.record.table.columns import Column, Table, by_length, even_times
from hil.record.table.heading import is_time, plain_name, time_unit, unit_of_stamps
from hil.record.table.long_format import split_by_channel
from hil.record.table.missing_values import Place, is_even, missing_values
from hil.record.table.named import even_note, named
from hil.record.table.response_table import (
    ResponseTable,
    are_responses,
    refuse_mislabelled,
    response_table,
    without_phase,
)
from hil.units import check_unit

_NAMELESS = frozenset({"data", "value", "values"})
ORIGIN = "time counts from"
"""In `meta`, of a recording with stamps of a calendar: the stamp of `time_s` = 0."""
_TICKS = 1000.0  # apart are no seconds, unless they are whole minutes
_SAME_UNIT = 5.0  # two clocks of one unit disagree by less; units of time lie 60 apart and more


def assemble(
    name: str,
    tables: Sequence[Table],
    meta: Mapping[str, Any] | None = None,
    reading: Reading = AS_IT_IS,
    place: Place = sample,
) -> Recording | ResponseTable:
    """One recording from tables; a frequency response where they hold one.

    Channels of several time bases share the one with the most samples, within the time that all of them cover; those
    that were sampled at other times, or earlier, keep their own samples in `own`, and in between the last one is held.
    A value that is not there (NaN) is a sample that was not taken. A table without a time takes that of another one of
    its length.

    Args:
        name: of the file.
        tables: what is in it.
        meta: what it says besides.
        reading: what its user says.
        place: where a row stands, for messages.

    Raises:
        FileError: no time, no signal, or samples that are no recording (see `recording.check`).
    """
    with naming(name):
        _refuse_frames(tables)
        by_channel, taken_apart = split_by_channel(tables)
        read, place = _oldest_first(named(by_channel, reading), reading, sample if taken_apart else place)
        if are_responses(read) and not reading.time and not reading.interval_s:
            return response_table(name, read, meta)
        pieces = list(_timed(read, reading))
        timed = [one for one in pieces if len(one.time_s)]
        if not timed:
            raise FileError(without_phase(read) or _why_no_signal(read))
        refuse_mislabelled([column for one in timed for column in one.signals])
        taken, assumed = _without_blanks(timed, place, reading.gaps)
        base = max(taken, key=lambda one: len(one.time_s))
        taken, brief = _without_brief(base, taken)
        assumed += brief
        for one in {id(one.time_s): one for one in reversed(taken)}.values():
            label, unit = one.column.name_and_unit
            own_channel = {} if label == "time" else {label: Channel(label, unit or "1", one.values)}
            check_samples(one.time_s, own_channel, place=place)
        time_s, notes = _common(base, taken)
        assumed += notes
        channels: dict[str, Channel] = {}
        own: dict[str, Samples] = {}
        units_missing = []
        for one in taken:
            wanted = one.column.name_and_unit[0]
            if wanted.casefold() in _NAMELESS and sum(t.column.heading == one.column.heading for t in taken) > 1:
                wanted = one.table  # each in a structure or group of its own
            label = _free_name(wanted, one.table, channels)
            if wanted and label != wanted:
                assumed.append(
                    Note("another channel is called '{wanted}'; this one is '{label}'", wanted=wanted, label=label)
                )
            unit = one.column.name_and_unit[1]
            values, apart = _values_at(time_s, one, base)
            channels[label] = Channel(label, unit or "1", values, one.column.source, one.column.calibration)
            if apart is not None:
                own[label] = apart
            if apart is not None and one.time_s is not base.time_s:
                assumed.append(_sampled_apart(label, one, base))
            units_missing += [] if unit else [label]
        file_meta: dict[str, Any] = {**(meta or {}), **({"units_missing": units_missing} if units_missing else {})}
        if not reading.interval_s and (origin := _origins(read, reading).get("M")) is not None:
            file_meta[ORIGIN] = str(origin)
        assumed = [*dict.fromkeys(sentence for one in pieces for sentence in one.assumed), *assumed]
        if assumed:
            file_meta["assumed"] = [*file_meta.get("assumed", ()), *assumed]
        check_samples(time_s, channels, place=place if len(time_s) == len(timed[0].time_s) else sample)
        return Recording(name, time_s, channels, file_meta, own)


def _refuse_frames(tables: Sequence[Table]) -> None:
    """Raise `FileError` for a list of the frames of a bus: their bytes are no signals."""
    for table in tables:
        words = {plain_name(column.heading) for column in table.columns}
        if any(word.split("(")[0].strip() in ("id", "can id") for word in words) and words & {"dlc", "len"}:
            raise FileError(
                "holds frames of a CAN bus, not signals; save the log as ASC, BLF, TRC or candump, and put "
                "its DBC beside it"
            )


def _oldest_first(tables: Sequence[Table], reading: Reading, place: Place) -> tuple[Sequence[Table], Place]:
    """A single table whose rows stand from the newest to the oldest, as some historians write, turned round."""
    if len(tables) != 1 or reading.interval_s:
        return tables, place
    (table,) = tables
    clock = next((c for c in table.columns if c.is_dated or c.is_time or c.name_and_unit[0] == reading.time), None)
    if clock is None or len(clock.values) < 3 or not np.all(clock.values[1:] < clock.values[:-1]):
        return tables, place
    last = len(clock.values) - 1
    notes = "; ".join(filter(None, (table.assumed, "the rows stand from the newest to the oldest; turned round")))
    turned = [replace(c, values=c.values[::-1]) if len(c.values) == last + 1 else c for c in table.columns]
    return [replace(table, columns=turned, assumed=notes)], lambda row: place(last - row)


@dataclass(frozen=True, slots=True, eq=False)
class _Timed:
    """Signals of one table on its own time base, empty where it has none, and what was assumed to get there."""

    table: str
    time_s: Array
    signals: tuple[Column, ...]
    assumed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Taken:
    """One channel with the stamps of its samples."""

    table: str
    column: Column
    time_s: Array
    values: Array


def _why_no_signal(tables: Sequence[Table]) -> str:
    columns = [column for table in tables for column in table.columns]
    for column in columns:
        if is_time(column.name_and_unit[0]) and column.values.dtype.kind in "OSU" and column.values.size:
            return _no_stamps(column)
    if any(column.is_time for column in columns):
        others = [column for column in columns if not column.is_time and column.values.size]
        texts = [(c.heading, c.values.flat[0]) for c in others if isinstance(c.values.flat[0], str)]
        begin = "".join(f"; '{heading}' begins with '{text:.20}'" for heading, text in texts)
        names = listed(f"'{column.heading}'" for column in others) if others else "no rows"
        return f"no column beside the time holds one number per sample: {names}{begin}"
    have = listed(f"'{column.heading}'" for column in columns)
    there = f"no signal with a time was found, but {have}" if columns else "no signal was found"
    return (
        f"{there}; say which of them is the time with {option('time', 'NAME')}, or how far the samples are apart with "
        f"{option('interval', 'S')} "
        "(in seconds)"
    )


def _no_stamps(clock: Column) -> str:
    return (
        f"'{clock.heading}' is called a time, but '{clock.values.flat[0]}' is no number, date or clock that is read, "
        "as 2026-11-28 10:11:12.5, 28.11.2026 10:11:12,5, Nov 28 2026 10:11:12 or 10:11:12.5; "
        f"{option('interval', 'S')} reads evenly spaced samples without it"
    )


def _timed(tables: Sequence[Table], reading: Reading) -> Iterator[_Timed]:
    origins = _origins(tables, reading)
    found = [piece for table in tables for piece in _pieces(table, reading, origins)]
    by_length = {len(time_s): time_s for _, time_s, _, _ in reversed(found) if time_s is not None}
    for table, own_s, columns, assumed in found:
        signals = tuple(column for column in columns if column.is_number)
        other = [column.heading for column in columns if not column.is_number]
        left_out = (f"left out, not one number per sample: {listed(other)}",) if other else ()
        length = len(signals[0].values) if signals else 0
        time_s = by_length.get(length) if own_s is None else own_s
        if signals and time_s is not None:
            if len(time_s) != length:
                raise FileError(f"channel '{signals[0].heading}' has {length} samples, its time has {len(time_s)}")
            yield _Timed(table, np.ascontiguousarray(time_s, dtype=np.float64), signals, (*assumed, *left_out))
        elif length > 1:
            names = listed(column.heading for column in signals)
            yield _Timed(table, np.empty(0), (), (f"left out, {length} samples and no time of as many: {names}",))


_Piece = tuple[str, Array | None, Sequence[Column], tuple[str, ...]]


def _origins(tables: Sequence[Table], reading: Reading) -> dict[str, Any]:
    """The earliest stamp of calendars, and that of clocks, by their kind: all tables of a file count from there."""
    first: dict[str, Any] = {}
    for table in tables:
        for clock in _clocks(table, reading):
            if clock.is_dated and len(clock.values):
                kind = clock.values.dtype.kind
                first[kind] = min(first.get(kind, clock.values[0]), clock.values[0])
    return first


def _pieces(table: Table, reading: Reading, origins: Mapping[str, Any]) -> Iterator[_Piece]:
    """The table, cut at its columns of time: each holds for those to its right, the first for those before it too."""
    notes = (table.assumed,) if table.assumed else ()
    clocks = [] if table.time_s is not None and not reading.time else _clocks(table, reading)
    if reading.interval_s:
        signals = [c for c in table.columns if c not in clocks and not (c.is_dated or c.counts_rows)]
        for columns in by_length(signals):
            time_s = even_times(len(columns[0].values), reading.interval_s)
            yield table.name, time_s, columns, (even_note(reading.interval_s),)
        return
    if not clocks:
        counter = next((c for c in table.columns[:1] if c.counts_rows and table.time_s is None), None)
        if counter is not None and counter.heading.strip().casefold().startswith("sampl"):
            asked = option("interval", "S")
            note = Note("sample number; 1 s per sample assumed, {option} says otherwise", option=asked)
            time_s = counter.values.astype(np.float64) - float(counter.values[0])
            yield table.name, time_s, table.columns[1:], (*notes, note)
        else:
            yield table.name, table.time_s, table.columns, notes
        return
    columns = [c for c in table.columns if c in clocks or not c.counts_rows]
    if len(columns) < len(table.columns):
        notes = (*notes, Note("a column that only numbers the rows is left out"))
    at = [columns.index(clock) for clock in clocks]
    for k, (start, clock) in enumerate(zip(at, clocks, strict=True)):
        stop = at[k + 1] if k + 1 < len(at) else len(columns)
        others = [*(columns[: at[0]] if k == 0 else ()), *columns[start + 1 : stop]]
        time_s, assumed = _seconds(clock, reading, origins.get(clock.values.dtype.kind))
        _refuse_contradiction(clock, time_s, table.columns, reading)
        _refuse_ticks(clock, reading)
        kept = [column for column in others if len(column.values) == len(time_s) or column.is_number]
        yield table.name, time_s, kept, (*notes, assumed) if assumed else notes


def _clocks(table: Table, reading: Reading) -> list[Column]:
    """The columns of time: the one that is named, else all that must be, with those that may be where there are two."""
    if reading.time:
        named_so = [c for c in table.columns if c.name_and_unit[0] == reading.time or c.heading.strip() == reading.time]
        return named_so[:1]
    sure = [column for column in table.columns if column.is_time]
    if not sure:
        maybe = [column for column in table.columns if column.may_be_time]
        return _without_twins(table.columns, maybe or [c for c in table.columns if c.is_like_time])
    both = [c for c in table.columns if c in sure or (c.may_be_time and len(table.columns) > 3)]
    first = next((column for column in both if column.rises), None)
    if first is None:
        return _without_twins(table.columns, both)
    name = first.name_and_unit[0]
    rising = [c for c in both if c.rises and (c.is_dated or c.name_and_unit[0] == name or _overlap(c, first))]
    return _without_twins(table.columns, rising)


def _overlap(one: Column, other: Column) -> bool:
    """Whether two columns can be times of one recording: most of the longer lies within the other."""
    (begun, ended), (first, last) = (c.seconds()[0][[0, -1]] for c in (one, other))
    return bool(2.0 * (min(ended, last) - max(begun, first)) > max(ended - begun, last - first))


def _without_twins(columns: Sequence[Column], clocks: Sequence[Column]) -> list[Column]:
    """Clocks side by side, or one at the end, tell the same time: numbers are taken before dates.

    So does a date further on, unless it is of other instants than the one before it.
    """
    kept: list[Column] = []
    for clock in clocks:
        beside = kept and columns.index(clock) - columns.index(kept[-1]) == 1
        at_end = kept and columns.index(clock) == len(columns) - 1
        if beside or at_end or (kept and clock.is_dated and not _of_other_instants(kept[-1], clock)):
            if kept[-1].is_dated and not clock.is_dated:
                kept[-1] = clock
        else:
            kept.append(clock)
    return kept


def _of_other_instants(one: Column, other: Column) -> bool:
    """Whether stamps of two columns differ by more than they are rounded to."""
    if one.values.dtype.kind != other.values.dtype.kind or len(one.values) != len(other.values):
        return False
    both = np.array(
        [column.values.astype(f"{column.values.dtype.kind}8[ns]").astype(np.int64) for column in (one, other)]
    )
    rounding = [max(step for step in 10 ** np.arange(10) if not np.any(each % step)) for each in both]
    return bool(np.any(np.abs(both[0] - both[1]) >= max(rounding)))


def _seconds(clock: Column, reading: Reading, origin: Any) -> tuple[Array, str]:
    label = clock.name_and_unit[0]
    if not (clock.is_number or clock.is_dated) and clock.values.size:
        raise FileError(_no_stamps(clock))
    stated = reading.units.get(label, "") or reading.units.get("time", "")
    try:
        if stated:
            check_unit(stated)
        return clock.seconds(stated, origin)
    except UnitError as error:
        raise FileError(
            f"time column '{clock.heading}': {error}; say its unit with {option('unit', f'{label}=s')}, or "
            "name the column "
            f"of the time with {option('time', 'NAME')}"
        ) from None


def _refuse_contradiction(clock: Column, time_s: Array, columns: Sequence[Column], reading: Reading) -> None:
    """Refuse a time of another unit than the stamps beside it show, unless its user says the unit or the column.

    Raises:
        FileError: how long the two say that it took, and what settles it.
    """
    label = clock.name_and_unit[0]
    if not len(time_s) or clock.is_dated or reading.time or label in reading.units or "time" in reading.units:
        return
    for beside in columns:
        if not beside.is_dated or len(beside.values) != len(time_s):
            continue
        own_s = (beside.values - beside.values[:1]) / np.timedelta64(1, "s")
        steps_s = np.diff(own_s)
        coarse_s = float(np.min(steps_s, where=steps_s > 0.0, initial=np.inf))
        least_s, most_s, span_s = own_s[-1] - coarse_s, own_s[-1] + coarse_s, float(time_s[-1] - time_s[0])
        if span_s > _SAME_UNIT * most_s or least_s > _SAME_UNIT * span_s > 0.0:
            raise FileError(
                f"'{clock.heading}' says that it took {span_s:g} s, the stamps of '{beside.heading}' beside it "
                f"say {own_s[-1]:g} s; {option('time', f'{beside.heading}')} takes the stamps, "
                f"{option('unit', f'{label}=UNIT')} says the unit"
            )


def _refuse_ticks(clock: Column, reading: Reading) -> None:
    """Refuse a time without a unit that counts the ticks of a device, as 112540000, 112544003 µs since its start.

    Raises:
        FileError: the steps, and what settles it.
    """
    label, unit = clock.name_and_unit
    if unit or time_unit(label) or clock.is_dated or {label, "time"} & {*reading.units} or len(clock.values) < 3:
        return
    steps = np.diff(clock.values.astype(np.float64))
    usual = float(np.median(steps))
    if usual >= _TICKS and np.any(steps % 60) and unit_of_stamps(clock.values) == ("s", "seconds"):
        raise FileError(
            f"'{clock.heading}' has no unit, and its samples lie about {usual:.4g} apart; "
            f"{option('unit', f'{label}=us')} says the unit, also ms, ns or s"
        )


def _without_blanks(timed: Sequence[_Timed], place: Place, gaps: bool) -> tuple[list[_Taken], list[str]]:
    taken, notes, empty = [], [], []
    for one in timed:
        for column in one.signals:
            values = np.ascontiguousarray(column.values, dtype=np.float64)
            missing, words = missing_values(column, values, one.time_s, place, gaps)
            kept = ~missing
            if not kept.any():
                empty.append(column.heading)
                continue
            notes += words
            own_s, own = (one.time_s[kept], values[kept]) if missing.any() else (one.time_s, values)
            taken.append(_Taken(one.table, column, own_s, own))
    single = [t.column.heading for t in taken if len(t.time_s) < 2]
    if single and len(single) < len(taken):
        notes.append(Note("left out, a single sample: {channels}", channels=tuple(single)))
        taken = [t for t in taken if len(t.time_s) > 1]
    if named_empty := [heading for heading in empty if heading.strip()]:
        notes.append(Note("left out, without a sample: {channels}", channels=tuple(named_empty)))
    if not taken:
        raise FileError("no channel has a sample")
    return taken, notes


def _without_brief(base: _Taken, taken: Sequence[_Taken]) -> tuple[list[_Taken], list[Note]]:
    """The channels without those of the base's table that fill fewer than half of its rows, all in one piece.

    Such a column is a short list beside the recording; the time that all channels cover would shrink to it.
    """

    def is_brief(one: _Taken) -> bool:
        count = len(one.time_s)
        first = int(np.searchsorted(base.time_s, one.time_s[0]))
        in_one_piece = np.array_equal(one.time_s, base.time_s[first : first + count])
        return one.table == base.table and 2 * count < len(base.time_s) and in_one_piece and is_even(one.time_s)

    brief = [one for one in taken if is_brief(one)]
    notes = [
        Note("left out, {count} samples beside {most} of {base}: {channel}", count=len(one.time_s),
             most=len(base.time_s), base=base.column.name_and_unit[0], channel=one.column.heading)
        for one in brief
    ]  # fmt: skip
    return [one for one in taken if one not in brief], notes


def _interval_s(time_s: Array) -> float:
    return float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0


def _common(base: _Taken, taken: Sequence[_Taken]) -> tuple[Array, list[Note]]:
    """The stamps of the base within the time that all channels cover: one sampled on change holds on to the end."""
    bases = {id(one.time_s): one.time_s for one in taken}.values()
    if len(bases) == 1:
        return base.time_s, []
    starts = {float(one.time_s[0]) for one in taken}
    stops = [float(own_s[-1]) + (_interval_s(own_s) if is_even(own_s) else np.inf) for own_s in bases]
    time_s, slack = base.time_s, SAME_STAMP * _interval_s(base.time_s)
    stop = min(stops)
    if len(starts) == 1 and stop >= time_s[-1] - slack:
        return time_s, []
    common = time_s[(time_s >= max(starts) - slack) & (time_s < max(stop, time_s[0]) - slack)]
    if len(common) < 2:
        names = ", ".join(dict.fromkeys(one.table for one in taken))
        raise FileError(f"its time bases have no time in common: {names}")
    notes = []
    for start in sorted(starts)[1:]:
        late = tuple(one.column.name_and_unit[0] for one in taken if one.time_s[0] == start)
        if start - min(starts) > slack:
            notes.append(Note(
                "{channels} begins {late_s:.6g} s after the first channel, as the file says; a command is known before "
                "that too",
                channels=late, late_s=start - min(starts),
            ))  # fmt: skip
    if time_s[-1] - common[-1] > max(_interval_s(own_s) for own_s in bases) + slack:
        first = next(one for one in taken if float(one.time_s[-1]) <= stop)
        notes.append(Note("{channel} ends {early_s:.6g} s before the last channel; nothing after that is taken",
                          channel=first.column.name_and_unit[0], early_s=time_s[-1] - common[-1]))  # fmt: skip
    return common, notes


def _values_at(time_s: Array, one: _Taken, base: _Taken) -> tuple[Array, Samples | None]:
    """The values at these times, and the samples as they were taken where that was at other times."""
    if len(time_s) == len(one.time_s) and (one.time_s is base.time_s or np.array_equal(one.time_s, base.time_s)):
        return one.values, None
    slack = SAME_STAMP * _interval_s(base.time_s)
    at = np.clip(np.searchsorted(one.time_s, time_s - slack), 0, len(one.time_s) - 1)
    taken = Samples(one.time_s, one.values)
    within = (one.time_s >= time_s[0] - slack) & (one.time_s <= time_s[-1] + slack)
    if np.count_nonzero(within) == len(time_s) and np.all(np.abs(one.time_s[at] - time_s) <= slack):
        return one.values[at], taken if one.time_s[0] < time_s[0] - slack else None
    return taken.held_at(time_s), taken


def _sampled_apart(label: str, one: _Taken, base: _Taken) -> Note:
    if is_even(one.time_s):
        rate = Note(
            "every {every_s:.6g} s from {first_s:.6g} s on", every_s=_interval_s(one.time_s), first_s=one.time_s[0]
        )
    else:
        rate = Note("at times of its own")
    apart = Note(
        "{count} samples {rate}, beside {most} of {base}. As a command its last value holds until the next; as a "
        "response it is compared at its own times",
        count=len(one.time_s), rate=rate, most=len(base.time_s), base=base.column.name_and_unit[0],
    )  # fmt: skip
    return apart.of(label)


def _free_name(wanted: str, table: str, taken: Mapping[str, Any]) -> str:
    wanted = wanted or "channel"
    candidates = (wanted, f"{wanted} ({table})", *(f"{wanted} ({table}, {i})" for i in range(2, len(taken) + 3)))
    return next(name for name in candidates if name not in taken and name != "time")
