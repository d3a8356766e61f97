"""Answers that do not come, come late, break off or are garbled; only a twin can be made to give them."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from hil.daq.conformance.inputs import age_s, reads_the_truth
from hil.daq.conformance.subject import Behind, Broken, LeftOut, Subject, agree, expect
from hil.daq.conformance.tasks import far, rate_of
from hil.daq.conformance.what_it_says import LONGEST_S
from hil.daq.contract import Waveform
from hil.errors import HardwareError
from hil.system import system

_MOVED = 0.05  # of an input's range
_FLIPS = 8  # bits, one at a time: of a short answer at least every other one changes what is read or the checksum


def says_that_no_answer_came(subject: Subject) -> None:
    """An answer that does not come is a `HardwareError`, soon, and the next one is right."""
    _spoiled(subject, silent=True)


def never_takes_a_late_answer_for_the_next(subject: Subject) -> str | None:
    """An answer that comes too late is an error, and is not given to the next question.

    Where the driver says that answers have a number, one to an earlier question is not believed either.
    """
    _spoiled(subject, late_s=1.5 * _timeout_s(subject))
    if getattr(subject.module, "has_numbers", lambda _settings: False)(subject.settings):
        return _comes_once_more(subject)
    return None


def does_not_believe_half_an_answer(subject: Subject) -> None:
    """An answer that breaks off is an error, and the next one is right."""
    _spoiled(subject, cut=True)


def survives_garbled_answers(subject: Subject) -> None:
    """Flipped bits raise nothing but errors of `hil.errors`, and afterwards it reads what is there.

    Where the driver says that answers have a checksum, every flipped bit is an error.
    """
    side, spoil = subject.twin()
    has_checksum = getattr(subject.module, "has_checksum", lambda _settings: False)(subject.settings)
    if not subject.wiring.inputs:
        raise LeftOut("no input in use")
    with subject.link() as link:
        for _ in range(_FLIPS if has_checksum else 3):
            spoil(garbled=True, answers=1)
            with suppress(HardwareError):
                link.read()
                expect(not has_checksum, "an answer whose checksum cannot fit was believed")
        spoil()
        _recovered(subject, link, side, {})


def notices_that_the_device_restarted(subject: Subject) -> None:
    """A device that restarts, its outputs elsewhere than they were driven, is an error within two seconds."""
    side, spoil = subject.twin()
    channel = subject.outputs[0]
    with subject.daq() as daq:
        rate_hz = rate_of(daq)
        driven = far(subject, daq, round(2.0 * rate_hz))
        blocks = daq.play(Waveform(rate_hz, driven), 1)
        next(blocks)
        spoil(reboot=True, answers=1)
        try:
            for _ in blocks:
                pass
        except HardwareError:
            return
        stands = side.standing(channel.terminal)
        expect(
            agree(channel, driven[channel.name][-1], stands),
            f"'{channel.name}' stands at {stands:g}, and nothing was said",
        )


def _spoiled(subject: Subject, **quirk: Any) -> None:
    """One answer is spoiled: an error, soon; then the truth again."""
    side, spoil = subject.twin()
    if not subject.wiring.inputs:
        raise LeftOut("no input in use")
    with subject.link() as link:
        if commanded := subject.levels(0.5):
            link.drive(commanded)
            reads_the_truth(subject, link, side, commanded)
        spoil(**quirk)
        begun_s = system.now_s()
        patience_s = 0.0 if age_s(link) == 0.0 else 3.0 * _timeout_s(subject)
        try:
            link.read()
            while system.now_s() - begun_s < patience_s:  # what the device told before may still be good
                link.read()
                system.sleep(0.01)
        except HardwareError:
            taken_s = system.now_s() - begun_s
            expect(taken_s < LONGEST_S, f"it took {taken_s:.1f} s to say so")
        else:
            raise Broken("the answer was spoiled, and a reading came nevertheless")
        spoil()
        if commanded := subject.levels(0.1):  # as after any error: a watchdog of the device may have struck meanwhile
            link.drive(subject.safe())
            link.drive(commanded)
        _recovered(subject, link, side, commanded)


def _comes_once_more(subject: Subject) -> str | None:
    """The answer before comes ahead of the right one, when what is read has changed since; says where nothing did."""
    side, spoil = subject.twin()
    with subject.link() as link:
        link.drive(subject.safe())
        system.sleep(subject.settling_s)
        link.read()  # also where outputs stand, so that the next one asks for inputs alone
        link.drive(subject.levels(0.5))
        before, until_s = link.read(), system.now_s() + subject.settling_s
        while not any(
            abs(side.read()[c.terminal] - before[c.terminal]) > _MOVED * (c.high - c.low)
            for c in subject.wiring.inputs.values()
        ):
            if system.now_s() >= until_s:
                return "no input follows the outputs: whether numbers of answers are looked at was not tried"
            system.sleep(0.01)
        spoil(again=True, answers=1)
        with suppress(HardwareError):
            reads_the_truth(subject, link, side, {})
    return None


def _recovered(subject: Subject, link: Any, side: Behind, commanded: Mapping[str, float]) -> None:
    try:
        reads_the_truth(subject, link, side, commanded)
    except HardwareError as error:
        raise Broken(f"one spoiled answer, and the next reading fails too: {error}") from None


def _timeout_s(subject: Subject) -> float:
    return float(getattr(subject.settings, "timeout_s", 0.2))
