"""What is said of outputs, by what is known of them, whatever ended the run."""

from __future__ import annotations

import json
import signal
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import product

import numpy as np
import pytest
from wire import Wire

from hil.clock import VirtualClock
from hil.daq.contract import CANNOT_BE_ASKED, ReadBack, Waveform
from hil.errors import DeviceLostError, HilError, LinkError, NotSafeError, RangeError, exit_status_of, with_notes
from hil.language.words import languages, speaking
from hil.safety.interrupt import Terminated
from hil.safety.outputs import Output, Outputs, State, ending_words, outputs_in, record_of, sentence


class Device(Wire):
    """Outputs whose device answers what it is told to answer, and may refuse to be made safe."""

    def __init__(self, answers: Mapping[str, ReadBack], failure: BaseException | None = None) -> None:
        super().__init__(levels={"a": 5.0})
        self._answers, self._failure = answers, failure

    def make_safe(self) -> None:
        if self._failure is not None:
            raise self._failure
        super().make_safe()

    def read_back(self) -> Mapping[str, ReadBack]:
        return {**super().read_back(), **self._answers}


def after(answer: ReadBack | None, failure: BaseException | None = None, level: float = 5.0) -> Outputs:
    """What is known when `a` was driven, made safe and asked, and answered so."""
    device = Device({} if answer is None else {"a": answer}, failure)
    known = Outputs()
    known.opened(device.outputs)
    known.driving(Waveform(100.0, {"a": np.array([0.0, level])}))
    known.make_safe(device, clock=VirtualClock())
    return known


SAFE, ELSEWHERE, SILENT = ReadBack(0.01), ReadBack(4.0), ReadBack(why="no answer")
ENDS: list[tuple[BaseException | None, int]] = [
    (None, 0), (KeyboardInterrupt(), 130), (Terminated(signal.SIGTERM), 143), (Terminated(signal.SIGHUP), 129),
    (Terminated(signal.SIGQUIT), 131), (LinkError("lost"), 3), (RangeError("too far"), 3),
    (TypeError("of a program"), 3),
]  # fmt: skip


@pytest.mark.parametrize(("error", "status"), ENDS)
@pytest.mark.parametrize(
    ("answer", "failure", "state", "settled", "says"),
    [
        (SAFE, None, "safe", True, "outputs are safe (read back)"),
        (SAFE, LinkError("no answer"), "safe", True, "outputs are safe (read back)"),
        (CANNOT_BE_ASKED, None, "unconfirmed", True, "outputs were commanded safe; 'a' cannot be read back"),
        (SILENT, None, "unconfirmed", False, "'a' was commanded safe, and could not be read back (no answer)"),
        (ELSEWHERE, None, "driven", False, "'a' stands at 4 V: use the emergency stop"),
        (SILENT, DeviceLostError("gone"), "unknown", False, "nobody knows where 'a' stands, driven to 5 V last"),
        (CANNOT_BE_ASKED, OSError("gone"), "unknown", False, "nobody knows where 'a' stands"),
        (replace(SILENT, rescue="it acts by itself after 1 s"), None, "unconfirmed", False, ": it acts by itself"),
    ],
)  # fmt: skip
def test_message_and_status_follow_from_what_is_known(
    answer, failure, state, settled, says,
    error, status,
):  # fmt: skip
    known = after(answer, failure)
    assert (known.by_name["a"].state, known.settled) == (state, settled)
    assert says in known.text and ("NOT SAFE" in known.text) == (not settled)
    own = getattr(type(error), "exit_status", HilError.exit_status) if error else 0
    assert known.status(error, own) == (status if settled else 3)


def test_nothing_was_driven_is_the_only_end_with_status_2():
    known = Outputs()
    assert (known.status(RangeError("x"), 2), known.text) == (2, "nothing was driven")
    device = Device({})
    known.opened(device.outputs)
    assert known.status(RangeError("x"), 2) == 3 and "nobody knows" in known.text
    known.make_safe(device)
    known.driving(Waveform(100.0, {"a": np.zeros(3)}))
    known.make_safe(device)
    assert (known.status(RangeError("x"), 2), known.text) == (2, "nothing was driven")
    known.driving(Waveform(100.0, {"a": np.array([0.0, 1.0, 0.0])}))
    assert known.status(RangeError("x"), 2) == 3
    known.make_safe(device)
    assert known.status(RangeError("x"), 2) == 3 and known.text == "outputs are safe (read back)"


def test_error_carries_status_and_sentence_once():
    error = RangeError("too far")
    known = after(SILENT, DeviceLostError("gone"))
    known.mark(error)
    known.mark(error)
    assert exit_status_of(error) == 3 and with_notes(error).count("NOT SAFE") == 1
    with pytest.raises(NotSafeError):
        known.check()


def test_device_that_obeys_a_little_later_is_waited_for():
    class Slow(Device):
        asked = 0

        def read_back(self):
            self.asked += 1
            return {**super().read_back(), "a": ReadBack(0.0 if self.asked > 5 else 3.0)}

    known, device = Outputs(), Slow({})
    known.opened(device.outputs)
    known.driving(Waveform(100.0, {"a": np.array([5.0])}))
    known.make_safe(device, clock=VirtualClock())
    assert known.are_safe and device.asked == 6


@pytest.mark.parametrize("error", [MemoryError(), SystemExit(1), RuntimeError("can't start new thread")])
def test_whatever_is_thrown_on_the_way_is_what_nobody_knows(error):
    class Broken(Device):
        def read_back(self):
            raise error

    known, device = Outputs(), Broken({}, error)
    known.opened(device.outputs)
    known.make_safe(device, clock=VirtualClock())
    assert known.by_name["a"].state == "unknown" and known.status(KeyboardInterrupt(), 2) == 3


def test_record_says_state_place_and_why():
    record = after(SILENT, DeviceLostError("gone")).record()["a"]
    assert abs(datetime.now(UTC) - datetime.fromisoformat(record.pop("at_utc"))) < timedelta(minutes=1)
    assert record == {"state": "unknown", "read_back": True, "at": 5.0, "unit": "V", "why": "no answer"}


OF_STATES = [
    *(Output(state, "V", at, can) for state in State for at in (None, 0.0, 4.0) for can in (True, False)
      if not (state is State.SAFE and (at is None or not can))),
    Output(State.UNKNOWN, "V", why="no answer", rescue="its own watchdog acts after 1 s"),
]  # fmt: skip
SAYS = {"en": ("outputs are safe", "NOT SAFE"), "de": ("Ausgänge sind sicher", "NICHT SICHER")}


@pytest.mark.parametrize("language", languages())
def test_sentence_and_status_agree_with_the_data_for_every_state(language):
    for outputs in (*((one,) for one in OF_STATES), *product(OF_STATES, repeat=2)):
        check_sentence(outputs, language)


class Known(Outputs):
    """Outputs of which this is known."""

    def __init__(self, known: Mapping[str, Output]) -> None:
        super().__init__()
        self._known = dict(known)


def check_sentence(outputs: tuple[Output, ...], language: str) -> None:
    record = json.loads(json.dumps(record_of({f"out {i}": output for i, output in enumerate(outputs)})))
    with speaking(language):
        said = sentence(outputs_in(record))
    safe, not_safe = SAYS[language]
    states = [one["state"] for one in record.values()]
    bad = [n for n, one in record.items() if one["state"] in ("driven", "unknown") or
           (one["state"] == "unconfirmed" and one["read_back"])]  # fmt: skip
    assert (safe in said) == (set(states) == {"safe"})
    assert (not_safe in said) == bool(bad)
    unconfirmed = [name for name, one in record.items() if one["state"] == "unconfirmed"]
    assert [name for name in record if f"'{name}'" in said] == (bad or unconfirmed)
    assert (Known(outputs_in(record)).status(KeyboardInterrupt(), 2) == 3) == bool(bad)


@pytest.mark.parametrize("language", languages())
def test_ending_says_of_its_outputs_what_the_data_say_in_the_language(language):
    for output in OF_STATES:
        known = {"out": output}
        record = json.loads(json.dumps(record_of(known)))
        outcome = f"TrippedError: interlock 'p': 3 bar; find the cause; {sentence(known)}; disk full"
        with speaking(language):
            expected = f"interlock 'p': 3 bar; find the cause; {sentence(known)}; disk full"
            assert ending_words(outcome, record) == expected
            assert ending_words("Halted: stop was pressed", {}) == "Halted: stop was pressed"
            assert ending_words("LinkError: io: no answer", {"out": {"state": "?"}}) == "io: no answer"


def test_output_that_stands_elsewhere_says_why_it_could_not_be_told():
    known = after(ELSEWHERE, LinkError("Dev1: the specified resource is reserved (-50103)"))
    assert known.by_name["a"].state is State.DRIVEN
    assert "(Dev1: the specified resource is reserved (-50103))" in known.text
