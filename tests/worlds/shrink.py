"""A schedule that breaks a law made smaller: fewer faults, an easier world, rounder times, as long as it breaks it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from tests.worlds.schedule import THIRD, Schedule

_TRIES = 80
_TIMES_S = (0.0, 0.05, 0.2, 1.0, 5.0)


def shrunk(schedule: Schedule, breaks: Callable[[Schedule], bool], tries: int = _TRIES) -> Schedule:
    """The smallest that was found; `breaks` is asked at most so often.

    Faults are left out first, together and one by one, then marks and the procedure, then times are made rounder.
    """
    left = tries
    for smaller in (_with_fewer_faults, _easier, _rounder):
        goes_on = True
        while goes_on:
            goes_on = False
            for other in smaller(schedule):
                left -= 1
                if left < 0:
                    return schedule
                if breaks(other):
                    schedule, goes_on = other, True
                    break
    return schedule


def _with_fewer_faults(schedule: Schedule) -> Iterator[Schedule]:
    """Half of them, then all but one: with four faults at most, that is all that delta debugging asks."""
    faults, half = schedule.faults, len(schedule.faults) // 2
    if half > 1:
        yield replace(schedule, faults=faults[:half])
        yield replace(schedule, faults=faults[half:])
    for at in range(len(faults)):
        yield replace(schedule, faults=faults[:at] + faults[at + 1 :])


def _easier(schedule: Schedule) -> Iterator[Schedule]:
    for mark in ("armed", "ramped", "away", "long"):
        if getattr(schedule, mark):
            yield replace(schedule, **{mark: False})
    if schedule.third and all(fault.device != THIRD for fault in schedule.faults):
        yield replace(schedule, third="")
    if schedule.procedure != "plain":
        yield replace(schedule, procedure="plain")
    if schedule.hurry > 0.01:
        yield replace(schedule, hurry=0.01)


def _rounder(schedule: Schedule) -> Iterator[Schedule]:
    for at, fault in enumerate(schedule.faults):
        times = [replace(fault, lasts_s=time_s) for time_s in _TIMES_S if time_s < fault.lasts_s]
        times += [replace(fault, after_s=after_s) for digits in (0, 1, 2)
                  if (after_s := round(fault.after_s, digits)) != fault.after_s]  # fmt: skip
        for other in times:
            yield replace(schedule, faults=(*schedule.faults[:at], other, *schedule.faults[at + 1 :]))
