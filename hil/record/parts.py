"""The parts of a run: which samples belong to which step of the procedure.

On disk a part is two events with one number in `part`: `part started` with its details, and `part stopped`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from hil.arrays import Array

STARTED, STOPPED = "part started", "part stopped"
PLACE = ("first", "count", "start_s", "stop_s", "unfinished")


def parts_of(events: Sequence[Mapping[str, Any]], time_s: Array) -> list[dict[str, Any]]:
    """The parts that events delimit: their details, and where their samples lie.

    `first` and `count` index the samples, `start_s` and `stop_s` are the stamps of the first and the last of
    them. `unfinished` is True for a part that was cut short. Parts without samples are left out.
    """
    stops = {event["part"]: event for event in events if event["event"] == STOPPED and "part" in event}
    found = []
    for event in events:
        if event["event"] == STARTED and "part" in event:
            place = _place(event["row"], stops.get(event["part"]), time_s)
            found.append({**event["details"], **place} if place else {})
    return [part for part in found if part]


def _place(row: int, stop: Mapping[str, Any] | None, time_s: Array) -> dict[str, Any]:
    first, end = max(row, 0), min(stop["row"] if stop else len(time_s), len(time_s))
    if end <= first:
        return {}
    place = {"first": first, "count": end - first, "start_s": float(time_s[first]), "stop_s": float(time_s[end - 1])}
    whole = first == row and stop is not None and stop["row"] == end and "unfinished" not in stop["details"]
    return place if whole else {**place, "unfinished": True}


def as_events(parts: Iterable[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """The events that delimit parts; the other way of `parts_of`."""
    for number, part in enumerate(parts):
        first, end = part["first"], part["first"] + part["count"]
        details = {name: value for name, value in part.items() if name not in PLACE}
        cut = {"unfinished": True} if part.get("unfinished") else {}
        yield {"event": STARTED, "row": first, "part": number, "details": details}
        yield {"event": STOPPED, "row": end, "time_s": part["stop_s"], "part": number, "details": cut}


def moved(meta: Mapping[str, Any], row_of: Callable[[int], int], time_s: Array) -> dict[str, Any]:
    """What `meta` says when row k is row `row_of(k)` of samples with the stamps `time_s`: its parts and events.

    Events of no such row are left out. A part that reaches over an end is cut there and marked unfinished.
    """

    def at_their_rows(events: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
        return [{**event, "row": row_of(event["row"])} for event in events]

    kept = dict(meta)
    if "events" in meta:
        kept["events"] = [event for event in at_their_rows(meta["events"]) if 0 <= event["row"] <= len(time_s)]
    if "parts" in meta:
        kept["parts"] = parts_of(at_their_rows(as_events(meta["parts"])), time_s)
    return kept
