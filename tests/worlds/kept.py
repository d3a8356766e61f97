"""What is on the disk after a power cut, a torn write or a wrong sector, against what was written (see `judge`)."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Iterator

import numpy as np

from hil.errors import FileError
from hil.record.durable import SYNC_INTERVAL_S
from hil.record.folder import read
from hil.record.recording import Recording
from hil.record.run_folder.events import EVENTS_FILE
from hil.record.run_folder.header import HEADER_FILE
from hil.record.run_folder.samples import JOURNAL_FILE, LINE_BYTES, ROWS_FILE, VALUE_BYTES, marks
from tests.worlds.disk import spoil
from tests.worlds.left import kinds, recording_of
from tests.worlds.schedule import NO_DISK
from tests.worlds.system import instant_s
from tests.worlds.world import Ran, World

_SYNCED_S = SYNC_INTERVAL_S + 0.2  # a sample waits for the disk no longer
_STANDS_STILL = {"pause", "sleep", "disk slow", *NO_DISK}
_SAYS_SHORT = ("only the first", "are lost")
_APPENDED = {EVENTS_FILE, ROWS_FILE, JOURNAL_FILE}


def samples_reach_the_disk(world: World, ran: Ran) -> Iterator[str]:
    """A power cut takes a second of a run, and no sample that was brought to the disk."""
    disk, folder = world.system.disk, world.folder / "run"
    if disk.cut_s is None or not (folder / HEADER_FILE).exists():
        return
    if disk.waited_s > _SYNCED_S and not kinds(ran) & _STANDS_STILL:
        yield f"the power was cut at {disk.cut_s:.3f} s, and some had waited {disk.waited_s:.3f} s for the disk"
    recording = recording_of(world)
    if recording is None:
        return  # `judge` tells whether that is because of its length
    rows = disk.synced(folder / ROWS_FILE) // (VALUE_BYTES * (1 + len(recording.channels)))
    lines = disk.synced(folder / JOURNAL_FILE) // LINE_BYTES
    there = [mark.rows for mark, _ in zip(marks(folder), range(lines), strict=False) if mark.rows <= rows]
    if there and len(recording.time_s) < there[-1]:
        yield f"{there[-1]} samples were on the disk for good, and {len(recording.time_s)} are read"


def is_read_up_to_its_tear(world: World, ran: Ran) -> Iterator[str]:
    """Where a sector reads wrong, what was written before it is read, and nothing else; what is missing is said."""
    whole, copy = recording_of(world), world.folder / "reads wrong"
    if not world.reads_wrong or whole is None:
        return
    shutil.copytree(world.folder / "run", copy)
    name = spoil(copy, random.Random(ran.schedule.seed))
    is_open = "outcome" not in whole.meta
    try:
        found = read(copy)
    except FileError as error:
        if is_open and name in _APPENDED and "at least 2 are needed" not in str(error):
            yield f"{name} reads wrong, and the run, which was not closed, is not read: {error}"
        return
    if name and not is_open and name != JOURNAL_FILE:  # of a closed run its end says how far the samples go
        yield f"{name} reads wrong, the run was closed, and nothing is said"
    yield from _is_begin(found, whole, name)


def _is_begin(found: Recording, whole: Recording, name: str) -> Iterator[str]:
    n, all_of_them = len(found.time_s), len(whole.time_s)
    pairs = [(found.time_s, whole.time_s)]
    pairs += [(found.channels[one].values, channel.values) for one, channel in whole.channels.items()]
    if n > all_of_them or not all(np.array_equal(part, full[:n], equal_nan=True) for part, full in pairs):
        yield f"{name} reads wrong, and samples are read that were not written"
    if found.meta["events"] != whole.meta["events"][: len(found.meta["events"])]:
        yield f"{name} reads wrong, and events are read that were not written"
    if n < all_of_them and not any(text in found.meta.get("incomplete", "") for text in _SAYS_SHORT):
        yield f"{name} reads wrong, {n} of {all_of_them} samples are read, and nothing is said"


def events_have_their_time(world: World, ran: Ran) -> Iterator[str]:
    """An event is stamped when it was written down, just after its sample, and those of a run one after the other."""
    recording = recording_of(world)
    if recording is None:
        return
    written_s = [instant_s(event["utc"]) for event in recording.meta["events"]]
    if any(np.diff(written_s) < 0.0) or any(not 0.0 <= at_s <= world.run.ended_s for at_s in written_s):
        yield f"events were written down at {written_s}, and the run ended at {world.run.ended_s:.3f} s"
    begun_s, stopped = instant_s(recording.meta["started_utc"]), recording.meta.get("stopped_utc")
    if not 0.0 <= begun_s <= world.begun_s.get("driving", np.inf):
        yield f"the run is said to have begun at {begun_s:.3f} s"
    if stopped and not max([begun_s, *written_s]) <= instant_s(stopped) <= world.run.ended_s:
        yield f"the run is said to have ended at {instant_s(stopped):.3f} s, and did at {world.run.ended_s:.3f} s"


def trips_are_told_and_kept(world: World, ran: Ran) -> Iterator[str]:
    """What has tripped is told by the run, stands among its events, and is kept for the next one."""
    recording = recording_of(world)
    if world.run.status in (None, -9) or kinds(ran) & {*NO_DISK, "sector", "power"} or recording is None:
        return
    said = " ".join(text for _, by, text in ran.said if by == "run")
    kept = "".join(path.read_text(encoding="utf-8") for path in world.folder.glob("state/trips/*.json"))
    noted = {event["details"].get("text", "") for event in recording.meta["events"] if event["event"] == "trip"}
    for name, why in (json.loads(kept) if kept else {}).items():
        if why not in said or why not in noted:
            yield f"'{name}' has tripped, and the run says: {said:.200}; its events: {noted}"
    if "then reset it with" in said and not kept:
        yield f"nothing is kept of what has tripped: {said:.200}"


LAWS = (trips_are_told_and_kept, samples_reach_the_disk, is_read_up_to_its_tear, events_have_their_time)
