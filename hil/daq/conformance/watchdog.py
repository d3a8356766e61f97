"""Whether a device makes its outputs safe by itself, as its driver says."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

from hil.daq.conformance.subject import Broken, LeftOut, Subject, agree
from hil.daq.conformance.what_it_says import LONGEST_S
from hil.daq.conformance.witness import measured_at
from hil.errors import HardwareError
from hil.system import system

_BY_ITSELF = "its twin does so without being armed: the driver arms nothing, so set it at the device itself"


def has_the_watchdog_that_it_promises(subject: Subject) -> str | None:
    """Left alone for longer than its watchdog, not sooner, outputs go to their safe values, and the driver says so."""
    _ = subject.outputs
    try:
        for _ in range(2):  # a watchdog that has acted must be armed again by whoever opens the device
            with subject.asking() as link:
                _left_alone(subject, link)
        measured_at(subject, lambda channel: channel.safe, _silent(link))
    finally:
        with suppress(HardwareError), subject.link():
            pass  # it is driven safe when the link is let go of
    optional = subject.side is not None and _may_be_without(subject.settings)
    return _BY_ITSELF if optional and _armed_by_itself(subject, link.watchdog_s) else None


def _may_be_without(settings: Any) -> bool:
    """Whether the driver can be told of no watchdog; some protocols have one in any case."""
    fields = getattr(type(settings), "model_fields", {})
    return "watchdog_s" in fields and fields["watchdog_s"].default is None


def _left_alone(subject: Subject, link: Any) -> None:
    if link.watchdog_s is None:
        raise LeftOut("it promises none")
    if link.watchdog_s > LONGEST_S:
        raise LeftOut(f"{link.watchdog_s:g} s are too long to wait for")
    commanded = subject.levels(0.5)
    subject.drive(link, commanded)
    system.sleep(0.4 * link.watchdog_s)
    subject.stand_there(link, commanded)
    subject.drive(link, commanded)
    system.sleep(1.5 * link.watchdog_s + 0.05)
    reported = _reports_expiry(link)
    _went_safe(subject, link)
    if not reported:
        raise Broken("the device made its outputs safe, and the next reading says nothing about it")


def _armed_by_itself(subject: Subject, watchdog_s: float) -> bool:
    """Whether a twin goes safe too when it has just been switched on and its driver is told of no watchdog."""
    side, spoil = subject.twin()
    unarmed = replace(subject, settings=subject.settings.model_copy(update={"watchdog_s": None}))
    with suppress(HardwareError):
        spoil(reboot=True, answers=1)
        with unarmed.asking() as link:
            link.standing()
    spoil()
    with unarmed.asking() as link:
        subject.drive(link, subject.levels(0.5))
        subject.stand_there(link, subject.levels(0.5))
        system.sleep(1.5 * watchdog_s + 0.05)
        by_itself = all(agree(c, c.safe, side.standing(c.terminal)) for c in subject.outputs)
        with suppress(HardwareError):
            subject.drive(link, subject.safe())
        return by_itself


def _reports_expiry(link: Any) -> bool:
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
