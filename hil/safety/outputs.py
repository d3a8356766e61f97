"""What is known of the outputs of a bench: a value that only an answer of the device makes better.

What a run says at its end about its outputs, its exit status, what it writes down and whether its watchdog may go home
all follow from this value, and from nothing else: not from the kind of error, nor from what was sent. It is data
(`Output.as_dict`); sentences are made of it where somebody reads them (`sentence`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from hil.clock import Clock, RealClock
from hil.daq.channel import OutputChannel
from hil.daq.contract import CANNOT_BE_ASKED, Daq, ReadBack, Waveform
from hil.errors import HilError, NotSafeError, UnansweredError, marked, reason
from hil.language.words import ENGLISH, _, speaking
from hil.record.measurement import without_kind
from hil.safety.interrupt import status_of, uninterrupted
from hil.safety.witness import Look, Testimony, Witnesses, stands_at
from hil.system import system
from hil.units import behind_a_number

_PATIENCE_S = 0.5  # for a device that obeys, and says so a little later
AGAIN_S, _AGAIN_LATE_S = 0.02, 0.1
_MOST = 3.0  # answers that are lost again and again make it wait so many times as long, no longer


class State(StrEnum):
    """What is known of an output."""

    SAFE = "safe"
    DRIVEN = "driven"
    UNCONFIRMED = "unconfirmed"
    UNKNOWN = "unknown"


def _now_utc() -> str:
    return system.utc().isoformat(timespec="milliseconds")


@dataclass(frozen=True, slots=True)
class Output:
    """What is known of one output, and from what.

    Attributes:
        state: `safe`: the device said so; `driven`: it was driven, or the device says that it stands elsewhere;
            `unconfirmed`: commanded safe without an error, and not read back; `unknown`: the device did not answer.
        unit: of `at`.
        at: where the device said that it stands; while it is driven, where it was driven to last.
        can: whether the device can be asked.
        why: why it did not say.
        rescue: what makes it safe when nobody reaches it.
        confirmed_in_s: it was read back at its safe value, or told to be there where nobody can ask, and an earlier
            command that was not answered may arrive for so long: until then it is unconfirmed.
        witness: what an input that answers to it has against it; None: nothing.
        at_utc: since when this is known, ISO 8601.
    """

    state: State
    unit: str
    at: float | None = None
    can: bool = True
    why: str = ""
    rescue: str = ""
    confirmed_in_s: float = 0.0
    witness: Testimony | None = None
    at_utc: str = field(default_factory=_now_utc, compare=False)

    @property
    def settled(self) -> bool:
        """Whether nothing is left to do: read back safe, or commanded safe where nobody can ask."""
        return self.state is State.SAFE or (self.is_commanded and not self.is_denied)

    @property
    def is_commanded(self) -> bool:
        """Whether no command can do more: it is settled, or nothing but its witness disagrees."""
        if self.state is State.SAFE:
            return True
        return self.state is State.UNCONFIRMED and not self.confirmed_in_s and (self.is_denied or not self.can)

    @property
    def is_denied(self) -> bool:
        """Whether its device has nothing against calling it safe, and the witness that the bench file names has."""
        return self.witness is not None and self.witness.is_named

    def as_dict(self) -> dict[str, Any]:
        """As it is kept with a run, handed to other processes and printed for programs."""
        return {
            "state": str(self.state), "read_back": self.can, "at_utc": self.at_utc, "at": self.at, "unit": self.unit,
        } | {name: value for name, value in (
            ("why", self.why), ("rescue", self.rescue), ("confirmed_in_s", round(self.confirmed_in_s, 3)),
            ("witness", self.witness and self.witness.as_dict())) if value
        }  # fmt: skip

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> Output:
        """What a record says; one of an earlier version lacks the time.

        Raises:
            KeyError, ValueError: it is no record of an output.
        """
        return cls(
            State(record["state"]), record["unit"], record["at"], record["read_back"], record.get("why", ""),
            record.get("rescue", ""), record.get("confirmed_in_s", 0.0),
            Testimony.of(record["witness"]) if "witness" in record else None, record.get("at_utc", ""),
        )  # fmt: skip

    def described(self, name: str) -> str:
        """In words, for an output that is not settled."""
        if self.is_denied and not self.confirmed_in_s:
            return _("'{name}' was set to its safe value, and is NOT CONFIRMED by {witness}").format(
                name=name, witness=_reading(self.witness)
            )
        at = "" if self.at is None else f"{self.at:.4g}{behind_a_number(self.unit)}"
        texts = {
            State.DRIVEN: _("'{name}' stands at {at}") if at else _("'{name}' is driven"),
            State.UNCONFIRMED: _("'{name}' was commanded safe, and could not be read back") if not self.confirmed_in_s
            else _("'{name}' was made safe, and an earlier command may still arrive"),
            State.UNKNOWN: _("nobody knows where '{name}' stands, driven to {at} last") if at
            else _("nobody knows where '{name}' stands"),
        }  # fmt: skip
        return texts[self.state].format(name=name, at=at) + (f" ({self.why})" if self.why else "")


def _reading(witness: Testimony | None) -> str:
    """A witness with what it reads now and read at rest: `flow (41 l/min now, 0.12 l/min at rest)`."""
    if witness is None:
        return ""
    unit = behind_a_number(witness.unit)
    reads, at_rest = (_("no reading") if x is None else f"{x:.3g}{unit}" for x in (witness.reads, witness.at_rest))
    return _("{channel} ({reads} now, {at_rest} at rest)").format(channel=witness.channel, reads=reads, at_rest=at_rest)


def note_of(outputs: Mapping[str, Output]) -> str:
    """What inputs have against outputs that the bench file does not name them as witnesses of; empty: nothing."""
    notes = [_reading(o.witness) for o in outputs.values() if o.witness is not None and not o.is_denied]
    return _("not back at rest: {readings}").format(readings=", ".join(notes)) if notes else ""


def waits_s(outputs: Mapping[str, Output]) -> float:
    """How long only time is missing to call outputs safe; 0 where more is missing, or nothing."""
    times_s = [output.confirmed_in_s for output in outputs.values() if not output.is_commanded]
    return max(times_s, default=0.0) if all(times_s) else 0.0


def announcement(outputs: Mapping[str, Output]) -> str:
    """What may be said of outputs of which only time is missing, in the language that is spoken; empty where more is.

    Args:
        outputs: what is known of each, by name.
    """
    if not (time_s := waits_s(outputs)):
        return ""
    if all(output.can or output.is_commanded for output in outputs.values()):
        return _("outputs: safe, read back; confirmed in {time} s").format(time=f"{time_s:.2g}")
    return _("outputs: commanded safe; repeated for {time} s").format(time=f"{time_s:.2g}")


def sentence(outputs: Mapping[str, Output], *, moved: bool = True) -> str:
    """What may be said of outputs, in the language that is spoken.

    Args:
        outputs: what is known of each, by name.
        moved: whether any was ever sent away from its safe value.
    """
    if left := {name: output for name, output in outputs.items() if not output.settled}:
        remedy = _("use the emergency stop")
        remedies = [f"{output.described(name)}: {output.rescue or remedy}" for name, output in left.items()]
        return _("NOT SAFE: {outputs}").format(outputs="; ".join(remedies))
    if not moved:
        return _("nothing was driven")
    unasked = ", ".join(f"'{name}'" for name, output in outputs.items() if output.state is not State.SAFE)
    if unasked:
        return _("outputs were commanded safe; {names} cannot be read back").format(names=unasked)
    note = note_of(outputs)
    return _("outputs are safe (read back)") + (f"; {note}" if note else "")


def ending_words(outcome: str, record: Mapping[str, Any]) -> str:
    """How a run ended, what it says of its outputs in the language that is spoken, without the kind of its error.

    Args:
        outcome: as a run folder has it, `TrippedError: interlock …; outputs are safe (read back)`.
        record: of its outputs, by name; empty where a version kept none.
    """
    text = without_kind(outcome)
    try:
        outputs = outputs_in(record)
    except (KeyError, ValueError, TypeError, AttributeError):
        return text
    with speaking(ENGLISH):
        english = sentence(outputs)
    return text.replace(english, sentence(outputs)) if outputs else text


class Outputs:
    """The outputs of a bench, from before it is opened until after it is let go of.

    Attributes:
        moved: whether any was ever sent away from its safe value.
        asked: whether they were commanded safe and asked about it since they were driven last.
        witnesses: inputs that answer to them, heard before they are called safe (see `hear_witnesses`).
        announce: told once when they were read back safe and only time is missing (see `announcement`).
    """

    def __init__(self) -> None:
        self.announce: Callable[[str], object] = lambda _text: None
        self.moved = self.asked = False
        self.witnesses = Witnesses()
        self._channels: Mapping[str, OutputChannel] = {}
        self._known: dict[str, Output] = {}

    def opened(self, channels: Mapping[str, OutputChannel]) -> None:
        """The bench is open: from now on its outputs are ours, and nobody knows where they stand."""
        self._channels = channels
        self._known = {name: Output(State.UNKNOWN, channel.unit) for name, channel in channels.items()}

    @property
    def by_name(self) -> Mapping[str, Output]:
        """What is known of each; empty until the bench is open."""
        return dict(self._known)

    @property
    def settled(self) -> bool:
        """Whether nothing is left to do for any of them."""
        return all(output.settled for output in self._known.values())

    @property
    def are_commanded(self) -> bool:
        """Whether no command can do more for any of them (see `Output.is_commanded`)."""
        return all(output.is_commanded for output in self._known.values())

    @property
    def are_safe(self) -> bool:
        """Whether each was read back at its safe value."""
        return all(output.state is State.SAFE for output in self._known.values())

    @property
    def text(self) -> str:
        """What may be said of them, in a sentence (see `sentence`)."""
        return sentence(self._known, moved=self.moved)

    def record(self) -> dict[str, dict[str, Any]]:
        """As it is kept with a run, by output (see `Output.as_dict`)."""
        return record_of(self._known)

    def driving(self, waveform: Waveform) -> None:
        """They are sent along a waveform now. Said before its first sample: what comes of it, only an answer tells."""
        self.asked = False
        for name, values in waveform.outputs.items():
            away = bool(np.any(values != self._channels[name].safe))
            self.moved = self.moved or away
            if away:
                self.witnesses.driven(name)
            state = State.DRIVEN if away else State.UNCONFIRMED
            self._known[name] = replace(
                self._known[name], state=state, at=float(values[-1]), why="", confirmed_in_s=0.0, witness=None,
                at_utc=_now_utc(),
            )  # fmt: skip

    @property
    def wait_s(self) -> float:
        """How long only time is missing to call them safe (see `waits_s`)."""
        return waits_s(self._known)

    def make_safe(
        self,
        daq: Daq,
        alive: Callable[[], None] = lambda: None,
        clock: Clock | None = None,
        *,
        late_s: float | None = None,
    ) -> None:
        """Have a backend make them safe, and ask it whether they are. Never raises: what came of it is the value.

        One that a named witness answers to is unconfirmed until that is heard (see `hear_witnesses`).

        After a lost answer they are asked until nothing late can come any more.

        Args:
            daq: the backend.
            alive: called between the steps: each may take its time-outs.
            clock: by which a device that is slow to obey is waited for.
            late_s: so long what somebody else sent may still arrive; whoever says it asks again, it is not waited here.
        """
        self.asked = True
        waiting = clock or RealClock()
        until_s, longest_s = waiting.now_s + _PATIENCE_S, 0.0
        self._tell_and_ask(daq, alive, late_s or 0.0)
        while not self.are_commanded:
            now_s = waiting.now_s
            if wait_s := self.wait_s:
                if late_s is not None:
                    break
                if not longest_s:
                    longest_s = now_s + _MOST * wait_s
                    self._announce(announcement(self._known))
                until_s = min(now_s + wait_s + _PATIENCE_S, longest_s)
            if now_s >= until_s:
                break
            waiting.sleep_until(now_s + (_AGAIN_LATE_S if wait_s else AGAIN_S))
            self._tell_and_ask(daq, alive, late_s or 0.0)

    def hear_witnesses(self, look: Look, alive: Callable[[], None], clock: Clock) -> None:
        """Look at what answers to the outputs until it is back at rest, but no longer than it takes to settle.

        Never raises. Only outputs that no command can do more for are looked at.

        Args:
            look: reads one of them, in engineering units.
            alive: called between the looks.
            clock: by which it is waited.
        """
        due = {name: witness for name, output in self._known.items()
               if output.is_commanded and (witness := self.witnesses.due(name)) is not None}  # fmt: skip
        until_s = clock.now_s + max((witness.settles_s for witness in due.values()), default=0.0)
        left, is_over = list(due), not due
        while left and not is_over:
            is_over = clock.now_s >= until_s  # the last look comes no earlier
            left = [name for name in left if self._is_away(name, look)]
            alive()
            if left and not is_over:
                clock.sleep_until(clock.now_s + AGAIN_S)
        if any(not due[name].is_named for name in left):
            self._announce(note_of(self._known))

    def _is_away(self, name: str, look: Look) -> bool:
        """Hear the witness of an output once; whether it is away from rest."""
        known, witness = self._known[name], self.witnesses.heard(name, look)
        is_safe = known.can and (witness is None or not witness.is_named)
        state = State.SAFE if is_safe else State.UNCONFIRMED
        self._known[name] = replace(known, state=state, witness=witness, at_utc=_now_utc())
        return witness is not None

    def _announce(self, text: str) -> None:
        with suppress(Exception):  # nobody reads it: that keeps nothing from becoming safe
            self.announce(text)

    def status(self, error: BaseException | None, status: int) -> int:
        """The exit status of an end, given what it would be by itself (see `exit_status`)."""
        if not self.settled:
            return NotSafeError.exit_status
        if isinstance(error, KeyboardInterrupt):
            return status_of(error)
        return NotSafeError.exit_status if self.moved and status == HilError.exit_status else status

    def mark(self, error: BaseException) -> None:
        """Give an error that ends a run its exit status, and the sentence that is true of the outputs."""
        own = getattr(error, "exit_status", HilError.exit_status)
        marked(error, self.status(error, own), self.text if self.moved or not self.settled else "")

    def check(self) -> None:
        """Raise `NotSafeError` unless all are settled."""
        if not self.settled:
            raise NotSafeError("outputs could not be made safe, or did not say so")

    @uninterrupted()  # a signal would be taken for a failure of the device, and be forgotten
    def _tell_and_ask(self, daq: Daq, alive: Callable[[], None], late_s: float) -> None:
        """Tell them once, and ask once."""
        failure, was_commanded = "", True
        try:
            daq.make_safe()
        except BaseException as error:
            failure, was_commanded = reason(error), isinstance(error, UnansweredError)
        alive()
        try:
            answers = daq.read_back()
        except BaseException as error:
            answers = dict.fromkeys(self._known, ReadBack(why=reason(error)))
        alive()
        for name in self._known:
            answer = answers.get(name, CANNOT_BE_ASKED)
            answer = replace(answer, late_s=max(answer.late_s, late_s))
            self._known[name] = self._after(name, answer, failure, None if was_commanded else daq.levels)

    def _after(self, name: str, answer: ReadBack, failure: str, levels: Mapping[str, float] | None) -> Output:
        """What is known after an answer; `levels`: where outputs stood last, when telling them to be safe failed."""
        before, channel, witness = self._known[name], self._channels[name], self.witnesses.pending(name)
        witness = witness if witness is not None and witness.is_named else None
        known = replace(
            before, can=answer.can, why=answer.why or failure, rescue=answer.rescue, confirmed_in_s=0.0,
            witness=None, at_utc=_now_utc(),
        )  # fmt: skip
        if answer.at is not None:
            if not stands_at(channel.safe, answer.at, channel):
                return replace(known, state=State.DRIVEN, at=answer.at, why=failure)
            state = State.UNCONFIRMED if answer.late_s or witness else State.SAFE
            return replace(
                known, state=state, at=answer.at, why="", confirmed_in_s=answer.late_s, witness=witness,
                rescue="" if witness else answer.rescue,
            )  # fmt: skip
        if levels is not None:  # a way to the safe values that was planned is no place where it was driven to
            return replace(known, state=State.UNKNOWN, at=levels.get(name, known.at))
        if failure and not answer.can:  # told, and silent: an answer would have been all that there is
            return replace(known, state=State.UNKNOWN)
        if not answer.can:
            return replace(known, state=State.UNCONFIRMED, at=None, confirmed_in_s=answer.late_s, witness=witness)
        return replace(known, state=State.UNCONFIRMED, at=None)


def record_of(outputs: Mapping[str, Output]) -> dict[str, dict[str, Any]]:
    """What is known of outputs as it is written down, by name."""
    return {name: output.as_dict() for name, output in outputs.items()}


def outputs_in(record: Mapping[str, Mapping[str, Any]]) -> dict[str, Output]:
    """What a record says of each output (see `record_of`)."""
    return {name: Output.of(value) for name, value in record.items()}
