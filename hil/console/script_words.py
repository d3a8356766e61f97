"""What scripts of pages say, marked for the catalogues: a page hands them over in the reader's language."""

from __future__ import annotations

from hil.language.words import marked

SCRIPT_MESSAGES = (
    marked("No connection to the console. What this page shows is old."),
    marked("starting"), marked("running"), marked("evaluating"), marked("ended"), marked("lost"), marked("done"),
    marked("refused"), marked("waiting"),
    marked("ok"), marked("driven"), marked("not driven by a run"), marked("kept"), marked("broken"),
    marked("not known"), marked("judged by the run"), marked("tripped"), marked("answers"), marked("silent"),
    marked("not asked"), marked("stale"), marked("no measurement"), marked("not being read"),
    marked("last recorded"),
    marked("The process of this run is gone. Look at the valve, then at its outputs."),
    marked("Take over as the operator?"), marked("Yes"), marked("No"),
    marked("Reset"), marked("Really reset the trip of {name}?"), marked("Refused"), marked("rehearsed"),
    marked("Rehearsing …"), marked("within all limits"), marked("Starting …"), marked("holding"),
    marked("A hold was asked for; it begins between two parts."),
    marked("STOP"), marked("ends {run}"), marked("ends {run} before it drives"), marked("a run is starting"),
    marked("is stopped through the console, while that answers"), marked("the console does not answer"),
    marked("Stop is pressed ({by}): no run can start."), marked("Release"), marked("stopped before it drove"),
    marked("What else is under way is not known: use the emergency stop."),
    marked("Stop is pressed ({by}): {run} ends before it drives."), marked("console"),
    marked("Not known whether a run is under way: use the emergency stop."),
    marked("no run is under way here"), marked("stop requested …"),
    marked("stop confirmed, outputs read back safe after {time}"), marked("UNCONFIRMED: use the emergency stop"),
    marked("safe, read back; confirmed in {time}"),
    marked("no answer within a second"), marked("its listener does not answer"), marked("no listener"),
    marked("had ended before: {outcome}"), marked("completed"), marked("Sound off"), marked("F12 stops too"),
    marked("F12 does not reach this page: click here"), marked("(no watchdog: the run itself listens)"),
    marked("cannot be stopped from here; end it where it was started, or use the emergency stop"),
    marked("safe"), marked("unconfirmed"), marked("unknown"),
    marked("trip"), marked("stop"), marked("hold"), marked("indicate"), marked("resume"), marked("limits tightened"),
    marked("resumed"), marked("the device makes another sample rate"), marked("no stop from a console"),
)  # fmt: skip
