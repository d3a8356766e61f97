"""Whether a device makes its outputs safe by itself, as its driver says."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

from hil.daq.conformance.subject import Broken, LeftOut, Subject
from hil.daq.conformance.what_it_says import LONGEST_S
from hil.daq.conformance.witness import measured_at
from hil.errors import HardwareError


def has_the_watchdog_that_it_promises(subject: Subject) -> None:
    """Left alone for longer than its watchdog, not sooner, outputs go to their safe values, and the driver says so."""
    _ = subject.outputs
    try:
        with subject.asking() as link:
            _left_alone(subject, link)
        measured_at(subject, lambda channel: channel.safe, _silent(link))
    finally:
        with suppress(HardwareError), subject.link():
            pass  # it is driven safe when the link is let go of


def _left_alone(subject: Subject, link: Any) -> None:
    if link.watchdog_s is None:
        raise LeftOut("it promises none")
    if link.watchdog_s > LONGEST_S:
        raise LeftOut(f"{link.watchdog_s:g} s are too long to wait for")
    told = subject.levels(0.5)
    subject.drive(link, told)
    time.sleep(0.4 * link.watchdog_s)
    subject.stand_there(link, told)
    subject.drive(link, told)
    time.sleep(1.5 * link.watchdog_s + 0.05)
    said = _said(link)
    _went_safe(subject, link)
    if not said:
        raise Broken("the device made its outputs safe, and the next reading says nothing about it")


def _said(link: Any) -> bool:
    try:
        link.read()
    except HardwareError:
        return True
    return False


def _went_safe(subject: Subject, link: Any) -> None:
    try:
        subject.stand_there(link, subject.safe(), 0.0)
    except Broken:
        seen = subject.seen(link)
        stands = ", ".join(
            f"'{c.name}' at {seen[c.terminal]:.4g} {c.unit}, safe is {c.safe:.4g}" for c in subject.outputs
        )
        raise Broken(f"{_silent(link)}, outputs stand elsewhere than safe: {stands}") from None
    except LeftOut:
        if not subject.witnesses:
            raise


def _silent(link: Any) -> str:
    return f"left alone for 1.5 times its watchdog of {link.watchdog_s:g} s"
