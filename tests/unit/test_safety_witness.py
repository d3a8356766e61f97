"""The last word has a witness: a register that is safe, and a valve that is not."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wire import Wire

from hil.bench.find import benches
from hil.bench.protection import witnesses_of
from hil.bench.read import read_bench
from hil.clock import VirtualClock
from hil.daq.calibration import Calibration
from hil.daq.contract import CANNOT_BE_ASKED, Block, ReadBack, Waveform
from hil.daq.scaled import Scaled
from hil.errors import LinkError, NotSafeError, TrippedError
from hil.language.words import languages, speaking
from hil.safety.guard import Guard
from hil.safety.interlock import Band, Interlock
from hil.safety.outputs import outputs_in, sentence
from hil.safety.protection import Protection
from hil.safety.witness import Witness
from tests.witnesses import words_at_ends

LINES = {name: Calibration("l/min") for name in ("a", "b", "a read", "b read")}


class Valve(Wire):
    """Reads as `a read` what it lets through; after a safe value what it stood at before, for so many readings."""

    promises = replace(Wire.promises, timing="polled")

    def __init__(self, sticks_for: float, *, answers: bool = True, noise: float = 0.0, offset: float = 0.0) -> None:
        super().__init__()
        self.sticks_for, self.answers, self.noise, self.at_rest = sticks_for, answers, noise, offset
        self.is_dead = False
        self._through = 0.0
        self._random = np.random.default_rng(1)

    def make_safe(self) -> None:
        self._through = self._through or self.levels["a"]
        super().make_safe()

    def read_back(self) -> Mapping[str, ReadBack]:
        told = super().read_back()
        return {**told, "a": told["a"] if self.answers else CANNOT_BE_ASKED}

    def look(self, name: str) -> Block:
        if self.is_dead:
            raise LinkError("no answer")
        self.sticks_for -= 1
        value = self.at_rest + (self._through if self.sticks_for >= 0 else 0.0)
        return Block(np.zeros(1), {name: np.array([value + self.noise * self._random.standard_normal()])}, {})

    def _run(self, waveform: Waveform) -> Block:
        block = super()._run(waveform)
        moved = self.at_rest + self.noise * self._random.standard_normal(len(block))
        return Block(block.time_s, {**block.inputs, "a read": block.inputs["a read"] + moved}, block.outputs)


def guard_of(valve: Valve, witness: Witness | None = None, **more: Any) -> Guard:
    by = Witness("a read") if witness is None else witness
    return Guard(
        Scaled(valve, LINES), Protection(rate_hz=100.0, witnesses={"a": by}, **more), clock=VirtualClock()
    )  # fmt: skip


def driven(guard: Guard, level: float = 5.0) -> Guard:
    for _ in guard.play(Waveform(100.0, {"a": np.full(20, level)})):
        pass
    return guard


def test_guard_calls_a_valve_that_sticks_open_not_confirmed():
    valve = Valve(np.inf, offset=0.2)
    guard = driven(guard_of(valve))
    with pytest.raises(NotSafeError):
        guard.make_safe()
    record = guard.output_states.record()["a"]
    assert (record["state"], record["read_back"], record["at"]) == ("unconfirmed", True, 0.0)
    assert record["witness"] == {
        "channel": "a read", "unit": "l/min", "is_named": True, "reads": 5.2, "at_rest": 0.2,
    }  # fmt: skip
    assert guard.output_states.status(None, 0) == guard.output_states.status(KeyboardInterrupt(), 2) == 3
    assert guard.output_states.are_commanded and not guard.output_states.settled  # its watchdog has nothing left to do
    assert valve.levels["a"] == 0.0


SAYS = {
    "en": "NOT SAFE: 'a' was set to its safe value, and is NOT CONFIRMED by a read (5.2 l/min now, 0.2 l/min at rest): "
          "use the emergency stop",
    "de": "NICHT SICHER: 'a' wurde auf den sicheren Wert gesetzt, aber NICHT BESTÄTIGT von a read (5.2 l/min jetzt, "
          "0.2 l/min in Ruhe)",
}  # fmt: skip


@pytest.mark.parametrize("language", languages())
def test_sentence_of_a_witness_is_made_of_the_data(language):
    guard = driven(guard_of(Valve(np.inf, offset=0.2)))
    with pytest.raises(NotSafeError):
        guard.make_safe()
    with speaking(language):
        assert sentence(outputs_in(json.loads(json.dumps(guard.output_states.record())))).startswith(SAYS[language])


@pytest.mark.parametrize("readings", [0, 10, 45])
def test_guard_waits_for_a_witness_as_long_as_it_may_settle(readings):
    guard = driven(guard_of(Valve(readings, noise=0.3)))
    guard.make_safe()
    assert guard.output_states.are_safe and guard.output_states.text == "outputs are safe (read back)"


def test_guard_waits_no_longer_than_the_channel_settles():
    guard = driven(guard_of(Valve(60), Witness("a read", settles_s=0.5)))
    with pytest.raises(NotSafeError):
        guard.make_safe()
    guard = driven(guard_of(Valve(60), Witness("a read", settles_s=2.0)))
    guard.make_safe()


def test_witness_that_gives_no_reading_confirms_nothing():
    valve = Valve(0)
    guard = driven(guard_of(valve))
    valve.is_dead = True
    with pytest.raises(NotSafeError):
        guard.make_safe()
    assert "NOT CONFIRMED by a read (no reading now" in guard.output_states.text
    valve.is_dead = False
    guard.make_safe()
    assert guard.output_states.are_safe


def test_witness_that_nobody_named_makes_a_note():
    heard = []
    guard = driven(guard_of(Valve(np.inf), Witness("a read", is_named=False)))
    guard.output_states.announce = heard.append
    guard.make_safe()
    note = "not back at rest: a read (5 l/min now, 0 l/min at rest)"
    assert heard == [note] and guard.output_states.text == f"outputs are safe (read back); {note}"
    assert guard.output_states.are_safe and guard.output_states.status(None, 0) == 0
    assert guard.output_states.record()["a"]["witness"]["is_named"] is False


def test_output_that_cannot_be_asked_is_denied_by_its_witness_too():
    guard = driven(guard_of(Valve(np.inf, answers=False)))
    with pytest.raises(NotSafeError):
        guard.make_safe()
    assert guard.output_states.record()["a"]["read_back"] is False and guard.output_states.status(None, 0) == 3
    guard = driven(guard_of(Valve(3, answers=False)))
    guard.make_safe()
    assert guard.output_states.text == "outputs were commanded safe; 'a' cannot be read back"


def test_output_that_never_left_its_safe_value_needs_no_witness():
    valve = Valve(np.inf)
    guard = driven(guard_of(valve), level=0.0)
    valve.is_dead = True
    guard.make_safe()
    assert guard.output_states.are_safe


def test_trip_is_kept_before_witnesses_are_heard():
    kept = []

    class Looked(Valve):
        def look(self, name):
            kept.append(guard.latch.trips)
            return super().look(name)

    high = Interlock("high", "trip", Band("a read", high=3.0))
    guard = guard_of(Looked(np.inf), interlocks=[high])
    with pytest.raises(TrippedError):
        driven(guard)
    assert kept and all("high" in trips for trips in kept)
    assert guard.output_states.by_name["a"].is_denied


def test_good_ends_of_shipped_benches_are_confirmed():
    """`python -m tests.witnesses` counts 1 000 ends of each."""
    for name in benches():
        assert words_at_ends(name, ends=2, seed=7) == {"safe": 2}, name


def test_shipped_benches_name_the_witness_of_their_command():
    def unnamed():
        for name, path in benches().items():
            bench = read_bench(path).bench
            command = next(key for key, channel in bench.channels.items() if channel.role == "command")
            if (witness := witnesses_of(bench).get(command)) is None or not witness.is_named:
                yield name

    assert set(unnamed()) == {  # a cylinder returns to no place, and these have no other channel that answers
        "hydraforce-extending", "hydraforce-retracting", "hydraforce-sp08-47c",
    }  # fmt: skip
