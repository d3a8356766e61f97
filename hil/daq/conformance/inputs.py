"""Whether readings are what is there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil.daq.conformance.subject import Behind, LeftOut, Subject, expect
from hil.system import system

_AGREES = 0.01  # of an input's range: what a protocol may round, and what goes on between two looks


def reads_what_is_there(subject: Subject) -> None:
    """A reading is what the input carries, now; the mark of one without a measurement is no number."""
    side, spoil = subject.twin()
    if not subject.wiring.inputs:
        raise LeftOut("no input in use")
    with subject.link() as link:
        for share in (0.5, 0.0):
            commanded = subject.levels(share)
            if commanded:
                link.drive(commanded)
            reads_the_truth(subject, link, side, commanded)
        spoil(not_a_number=True)
        for name, value in link.read().items():
            low, high = next((c.low, c.high) for c in subject.wiring.inputs.values() if c.terminal == name)
            is_number, allowed = math.isfinite(value), _AGREES * (high - low)
            expect(
                not is_number or low - allowed <= value <= high + allowed,
                f"'{name}' has no measurement, and reads {value:g}",
            )


def reads_the_truth(subject: Subject, link: Any, side: Behind, commanded: Mapping[str, float]) -> None:
    """What is read lies within what is there at the moment, or was there when a message of that age was sent."""
    system.sleep(0.01)
    for _ in range(1 if age_s(link) else 2):  # the second time finds an answer that is one behind
        there = [side.read()]
        until_s = system.now_s() + 8.0 * age_s(link)
        while system.now_s() < until_s:
            if commanded:
                link.drive(commanded)
            system.sleep(0.02)
            there.append(side.read())
        read = link.read()
        there.append(side.read())
        for channel in subject.wiring.inputs.values():
            place, allowed = channel.terminal, _AGREES * (channel.high - channel.low)
            low, high = (f(values[place] for values in there) for f in (min, max))
            expect(
                max(channel.low, low) - allowed <= read[place] <= min(channel.high, high) + allowed,
                f"'{channel.name}' reads {read[place]:g}, and {there[-1][place]:g} {channel.unit} is there",
            )


def age_s(link: Any) -> float:
    """How old a reading is on average."""
    return float(getattr(link, "reading_age_s", 0.0))
