"""The list of checks, and how a driver does in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from hil.daq.conformance import inputs, outputs, spoiled, tasks, watchdog, what_it_says, witness
from hil.daq.conformance.subject import Broken, LeftOut, Subject, agree, expect
from hil.errors import DeviceLostError, HardwareError, HilError

Check = Callable[[Subject], str | None]
"""Raises `Broken` with what was found and what was to be expected, or returns what is to be said of passing."""
CHECKS: dict[str, Check] = {
    function.__name__: function
    for function in (
        what_it_says.says_what_it_is,
        what_it_says.says_soon_that_nobody_is_there,
        what_it_says.leaves_outputs_where_they_are,
        outputs.drives_as_commanded,
        outputs.obeys_every_command,
        outputs.reaches_its_limits,
        outputs.goes_to_its_safe_value_on_command,
        outputs.stands_while_the_link_is_opened_again,
        witness.an_input_sees_what_it_drives,
        inputs.reads_what_is_there,
        tasks.tells_where_outputs_stand,
        tasks.one_reading_for_each_sample,
        tasks.keeps_the_rate,
        tasks.says_how_late_its_readings_are,
        tasks.refuses_a_range_before_the_first_sample,
        tasks.goes_safe_immediately_and_again,
        tasks.closes_safe_and_twice,
        spoiled.says_that_no_answer_came,
        spoiled.never_takes_a_late_answer_for_the_next,
        spoiled.does_not_believe_half_an_answer,
        spoiled.survives_garbled_answers,
        spoiled.notices_that_the_device_restarted,
        watchdog.has_the_watchdog_that_it_promises,
    )
}
CheckVerdict = Literal["passed", "broken", "left out"]


@dataclass(frozen=True, slots=True)
class Result:
    """How a driver did in one check."""

    check: str
    meaning: str
    verdict: CheckVerdict
    text: str = ""


def examine(subject: Subject) -> Iterator[Result]:
    """Every check, one after the other; a driver that breaks one is still asked the others."""
    for name, function in CHECKS.items():
        meaning = (function.__doc__ or "").strip().split("\n", 1)[0]
        verdict, text = verdict_of(function, subject)
        yield Result(name, meaning, verdict, text)


def verdict_of(function: Check, subject: Subject) -> tuple[CheckVerdict, str]:
    """How a driver does in one check. An error that is none of ours is a fault of the driver."""
    try:
        return "passed", function(subject) or ""
    except LeftOut as reason:
        return "left out", str(reason)
    except Broken as reason:
        return "broken", str(reason)
    except HilError as error:
        return "broken", f"raised {type(error).__name__}: {error}"
    except (Exception, SystemExit) as error:
        return "broken", f"raised {type(error).__name__}, which is no error of `hil.errors`: {error}"
    finally:
        if subject.spoil is not None:
            subject.spoil()


def left_safe(subject: Subject) -> str:
    """Put every output at its safe value over a link opened anew, ask the device, and say what it says.

    Raises:
        HardwareError: an output cannot be reached, or does not stand at its safe value.
    """
    if not subject.wiring.outputs:
        return ""
    try:
        if hasattr(subject.module, "open_link"):
            with subject.asking() as link:
                subject.drive(link, subject.safe())
                subject.stand_there(link, subject.safe())
        else:
            with subject.daq():
                pass  # it is made safe when it is let go of
            _check_safe(subject)
    except LeftOut as reason:
        return f"outputs were driven to their safe values, but {reason}"
    except Broken as reason:
        raise DeviceLostError(f"outputs are not safe: {reason}; use the emergency stop") from None
    except HardwareError as error:
        raise DeviceLostError(f"outputs could not be made safe: {error}; use the emergency stop") from error
    return "outputs stand at their safe values, read back"


def _check_safe(subject: Subject) -> None:
    found = subject.asked_anew()
    for channel in subject.outputs:
        at = found[channel.terminal]
        expect(agree(channel, at, channel.safe), f"'{channel.name}' stands at {at:.4g} {channel.unit}")
