"""The real code of run, guard, watchdog and drivers in virtual time: what is said of outputs is so."""

from __future__ import annotations

import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from drivers import _can_frames, j1939_valve
from drivers._modbus_line import ModbusLine
from drivers._modbus_ready import Readiness
from drivers.j1939_valve import J1939ValveLink
from hil.bench import fail_safe_shutdown, heartbeat, watchdog
from hil.bench.ending import Ending, LastWord
from hil.daq.channel import Wiring
from hil.daq.contract import Waveform
from hil.daq.device_link import DeviceLink
from hil.daq.link import Late
from hil.daq.pin import Pin
from hil.daq.polled import PolledDaq
from hil.daq.polling import Pace, Taken
from hil.record.durable import Syncer
from hil.record.run_folder import run_writer, samples
from hil.record.run_folder.run_writer import RunWriter
from hil.record.run_folder.samples import last_mark
from hil.safety import outputs
from hil.safety.guard import Guard
from hil.safety.interlock import Watches
from hil.safety.latch import Latch
from hil.safety.operator import Operator
from hil.safety.outputs import Output, Outputs, State
from hil.safety.witness import Witnesses
from hil.system import tcp
from tests.worlds.judge import judge
from tests.worlds.kernel import in_world, on_linux, parent_in_world, parent_on_linux, parent_script, script
from tests.worlds.kernel_of_terminals import (
    port_in_world,
    port_on_linux,
    port_script,
    signal_script,
    signals_in_world,
    signals_on_linux,
)
from tests.worlds.mutants import kept
from tests.worlds.processes import ParentEnd
from tests.worlds.schedule import PROCEDURES, THIRDS, Schedule, drawn
from tests.worlds.shrink import shrunk
from tests.worlds.system import BEGAN, WorldSystem
from tests.worlds.world import Ran, one


def of(code: str) -> Ran:
    return one(Schedule.of(code), judge)


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_without_a_fault_a_run_ends_as_its_procedure_does(procedure):
    ran = one(Schedule(1, procedure=procedure, ramped=True, away=True), judge)
    assert not ran.broken and ran.blocks >= 50
    assert [word.by for word in ran.words if set(word.safe) == {"command", "enable"}]


@pytest.mark.parametrize("third", THIRDS.values())
def test_a_device_on_a_serial_line_or_on_can_is_driven_beside_the_couplers(third):
    ran = one(Schedule(1, armed=True, third=third), judge)
    assert not ran.broken and ran.status == 0
    assert max(percent for _, percent in ran.changes["pilot"]) >= 40.0 and ran.changes["pilot"][-1][1] == 0.0


def test_one_schedule_is_one_course():
    first, again = one(drawn(8), judge), one(drawn(8), judge)
    assert (first.changes, first.said, first.calls) == (again.changes, again.said, again.calls)
    assert Schedule.of(first.schedule.code) == first.schedule


def test_outputs_of_a_dead_run_are_made_safe_when_who_took_the_bench_could_not():
    code = "702308,0.2,blocks,-|out:making safe:0.0526:10:aux|second:making safe:0:0.05:"
    ran = of(code)
    assert not ran.broken and ran.changes["enable"][-1][1] == 0.0


def test_after_a_sample_that_failed_no_sign_of_life_drives_again_what_stood_before():
    """A module that fell silent held up the first step of a ramp, and meanwhile all outputs went up again."""
    assert not of("181748677043,0.2,leaves early,wrm|deaf:driving:2.8788:5:third").broken


def test_a_ramp_after_a_lost_answer_begins_with_the_question_where_the_output_stands():
    """Its first command would drive one that has restarted away from its safe value."""
    assert not of("46,0.01,plain,r|hold:driving:4:0.05:io").broken
    assert not of("31991298,0.01,plain,r|out:driving:1.2:0.05:io|term:driving:1.3:0:").broken  # which covered it


def test_a_computer_that_sleeps_while_one_device_is_driven_drives_no_other_afterwards():
    """Its own watchdog had made that one safe meanwhile."""
    assert not of("212367646046,0.01,plain,w|sleep:driving:2.9357:1:").broken


def test_a_sample_that_lost_its_reading_is_driven_again_by_no_sign_of_life():
    """It would begin a new connection with a command away from the safe value."""
    assert not of("5990665,0.2,leaves early,wv|hold:driving:0.6651:0.2:aux").broken


def test_a_signal_while_outputs_are_made_safe_at_the_opening_ends_the_run():
    """It was taken for a failure of the device, and the next one was not heard either."""
    assert of("5991776,0.01,plain,p|hup:opening:1.23:0:|int:opening:2:0:").status == 129


def test_watchdog_that_did_not_hear_what_a_device_is_learns_it_from_the_run():
    """Else it calls another device, which has come to that address, safe."""
    assert not of("77992380,0.01,plain,-|deaf:opening:0.5:0.5:io|swap:driving:3:0:io").broken


def test_who_is_told_to_be_safe_in_a_silence_may_answer_before_the_next_question():
    """The silence ended with the answer before; that to the safe value came a few ms later."""
    slow = "crowd:making safe:0.0032:2:io|slow:making safe:0.0087:5:aux|slow line:driving:1.1768:1:third"
    assert not of(f"6000016,0.05,raises,p|{slow}|lose:making safe:0.0982:0.5:third").broken
    assert not of("6000148,0.2,exits,ap|echo:making safe:0.0011:2:third").broken


def test_a_ramp_is_gone_down_beside_a_device_that_tells_no_level():
    """It says that it is not at its safe value: no lost answer."""
    assert not of("616000517,0.01,plain,rv|int:driving:1:0:").broken


def test_a_silence_that_the_sign_of_life_met_first_ends_the_run():
    """The next sample drove on, after the devices' own watchdogs had made them safe."""
    assert not of("61610057127,0.01,steps,w|pause:driving:1.9185:1:").broken


def test_a_device_that_hung_up_at_rest_is_told_its_safe_value_before_it_is_driven():
    """It may have restarted, and stand elsewhere."""
    assert not of("202000088,0.01,plain,s|reset:opening:0.6979:0:aux").broken


def test_a_command_that_is_on_its_way_may_arrive_after_the_safe_value_is_asked_for():
    assert not of("46100073,0.01,plain,-|over:driving:0.9237:0.05:aux|slow:driving:0.3:1:aux").broken


def test_beside_a_valve_that_says_only_that_it_is_open_a_command_goes_down_its_ramp():
    assert not of("46200890,0.01,plain,rv|term:driving:1:0:").broken


def test_a_witness_that_was_away_when_its_rest_was_read_is_doubted_and_no_fault():
    ran = of("46500092,0.01,leaves early,a|sticks:opening:0:1:aux")
    assert not ran.broken and ran.status == 3


def test_a_valve_that_never_said_who_it_is_has_restarted_where_it_claims_its_address():
    """That it was asked at the opening, and did not hear that, explains no claim of later."""
    ran = of("8,0.01,plain,v|lose:opening:0.068:2:third|restart:driving:3.155:0.05:third")
    assert not ran.broken and ran.status == 3


def test_a_trip_on_the_way_down_a_ramp_is_told_and_a_slow_disk_does_not_hang():
    ran = of("7,0.05,plain,r|disk slow:driving:2:10:|int:driving:2:0:|over:driving:2.05:5:aux")
    assert not ran.broken and ran.status == 130
    assert [text for _, by, text in ran.said if by == "run" and "over-pressure" in text and "are safe" in text]


def test_a_trip_is_told_and_noted_when_stop_is_pressed_while_it_makes_safe():
    """The next run was refused for a trip that neither the run nor its events had told of."""
    ran = of("510193,0.01,plain,-|over:driving:1:0.2:io|stop:making safe:0:0:")
    assert not ran.broken and ran.status == 138
    assert [text for _, by, text in ran.said if by == "run" and "over-pressure" in text]


@pytest.mark.parametrize("part", range(2))
def test_drawn_worlds_hold(part):
    """Others with each commit; one that does not hold is printed as `python -m tests.worlds CODE` takes it."""
    commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False).stdout
    seed = 1000 * int(commit[:7] or "0", 16) + 100 * part
    done = subprocess.run(
        [sys.executable, "-m", "tests.worlds", "-n", "100", "--seed", str(seed), "--jobs", "1"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("seed", range(12))
def test_tcp_of_the_world_is_that_of_linux(seed):
    """All of `python -m tests.worlds.kernel -n 500` but two are equal; these are some of them."""
    steps = script(seed)
    linux, world = on_linux(steps), in_world(steps)
    assert (linux.received, linux.failed) == (world.received, world.failed), steps


def test_what_a_watchdog_hears_is_what_it_hears_on_linux():
    for steps in map(parent_script, range(20)):
        assert parent_on_linux(steps) == parent_in_world(steps), steps


@pytest.mark.parametrize("part", range(4))
def test_signals_and_serial_ports_of_the_world_are_those_of_linux(part):
    for seed in range(10 * part, 10 * part + 10):
        signals, port = signal_script(seed), port_script(seed)
        assert signals_on_linux(signals) == signals_in_world(signals), signals
        assert port_on_linux(port) == port_in_world(port), port


plan = Pace.planned
blocked = j1939_valve.command_frame
Patches = list[tuple[object, str, Any]]
MENDS: dict[str, tuple[Patches, str]] = {
    "what was not acknowledged goes out again": (
        [(tcp, "guard", lambda made, _timeout_s: made), (WorldSystem, "forget", lambda _system, _held: None)],
        "30308,0.2,steps,-|out:driving:2.4864:10:io|fork:driving:2.4759:0.05:",
    ),
    "a late command is not waited for": (
        [(Late, "left_s", lambda _late, _now_s: 0.0)],
        "2,0.05,plain,-|hold:driving:1.5:1:io|hup:driving:2.5:0:",
    ),
    "another device is believed": (
        [(Wiring, "refuse_another", lambda _wiring, _identity: None), (Pin, "doubt", lambda _pin, _identity: "")],
        "30006,0.05,swallows,-|stop:making safe:0.2661:0:|swap:driving:2.6213:0:io",
    ),
    "an end is not final": (
        [(Guard, "end", lambda _guard, _error: None), (Ending, "check", lambda _ending: None),
         (Ending, "signalled", lambda _ending, _error: None), (Ending, "task", lambda _ending: nullcontext())],
        "7,0.05,swallows,-|int:driving:1.3:0:",
    ),
    "a signal ends the watchdog": (
        [(watchdog, "HOLDING_UP", ()), (heartbeat, "HOLDING_UP", ())], "7,0.05,plain,-|wd term:driving:1.3:0:",
    ),
    "a program that hangs is not killed": (
        [(ParentEnd, "kill", lambda _parent, _pid: None)], "7,0.05,plain,-|pause:driving:1.3:5:",
    ),
    "an answer that did not come is one": (
        [(Outputs, "settled", property(lambda _known: True))], "7,0.05,plain,-|deaf:driving:1.3:5:io",
    ),
}  # fmt: skip


def _undefined(*_: object, **__: object) -> None:
    raise NameError("name 'part' is not defined")


def _halves(slices: Any) -> Any:
    return lambda waveform, samples: (
        replace(piece, outputs={name: 0.5 * values for name, values in piece.outputs.items()})
        for piece in slices(waveform, samples)
    )


def _shifts(add: Any) -> Any:
    def shifted(taken: Taken, begun_s: float, time_s: float, *rows: Any) -> None:
        add(taken, begun_s, time_s + 0.012 * (time_s > 0.5) * (len(taken.time_s) % 2), *rows)

    return shifted


def _off(append: Any) -> Any:
    return lambda writer, time_s, values: append(writer, time_s, {**values, "flow": 1.001 * values["flow"]})


def _each_alone(add: Any) -> Any:
    def added(taken: Taken, *sample: Any) -> None:
        add(taken, *sample)
        taken.begun_s = None

    return added


def _looking_first(make_safe: Any) -> Any:
    def made_safe(daq: PolledDaq) -> None:
        for _ in range(20):
            daq.look("flow")
        make_safe(daq)

    return made_safe


def _elsewhere(as_dict: Any) -> Any:
    return lambda output: as_dict(output) | ({"at": 0.5} if output.state is State.DRIVEN else {})


def _when_asked_twice(say: Any) -> Any:
    asked = list[BaseException]()

    def said(word: LastWord, error: BaseException) -> int:
        asked.append(error)
        return int(say(word, error)) if len(asked) > 1 else 3

    return said


FAULTS: dict[str, tuple[Patches, str]] = {
    "word_comes_first": (
        [(LastWord, "say", _when_asked_twice(LastWord.say))], "7,0.05,swallows,-|int:driving:1.3:0:",
    ),
    "_strangers": (
        [(Wiring, "refuse_another", lambda *_: None)], "7,0.05,plain,w|swap:driving:2:0:io|kill:driving:2.3:0:",
    ),
    "begins_safe": ([(outputs, "stands_at", lambda *_: True)], "7,0.05,plain,a|lies:opening:0:10:io"),
    "errors_are_not_ours": ([(Latch, "trip", _undefined)], "7,0.05,plain,-|over:driving:1.3:5:aux"),
    "connections_are_given_up": (
        [(ModbusLine, "drop", lambda _line: None)], "7,0.05,plain,-|mute:driving:1.3:5:io",
    ),
    "drives_what_is_asked": ([(Waveform, "slices", _halves(Waveform.slices))], "7,0.05,plain,-"),
    "hands_back_what_is_recorded": ([(RunWriter, "append", _off(RunWriter.append))], "7,0.05,plain,-"),
    "samples_are_in_time": ([(Taken, "add", _shifts(Taken.add))], "7,0.05,plain,-"),
    "own_watchdogs_rest": (
        [(DeviceLink, "keep_alive_s", property(lambda _link: None, lambda _link, _value: None))], "7,0.05,blocks,w",
    ),
    "causes_happened": ([(Operator, "stop_asked", property(lambda _operator: True))], "7,0.05,plain,-"),
    "is_heard": ([(Watches, "judge", lambda *_: [])], "7,0.05,plain,-|over:driving:1.3:5:aux"),
    "is_heard, on a slow line": (
        [(Taken, "add", _each_alone(Taken.add))], "7,0.05,plain,b|over:driving:2:5:aux|slow:driving:1.3:10:io",
    ),
    "own_watchdogs_are_armed": ([(Readiness, "_do", lambda *_: None)], "7,0.05,plain,w"),
    "claims_are_waited_for": ([(_can_frames, "CLAIM_WAIT_S", 0.0)], "7,0.05,plain,v"),
    "_as_expected": (
        [(Pace, "planned", lambda pace, _block_s, interval_s: plan(pace, 0.0, interval_s))],
        "7,0.05,plain,b|slow:driving:1:5:io",
    ),
    "safe_comes_before_readings": (
        [(PolledDaq, "make_safe", _looking_first(PolledDaq.make_safe))], "7,0.05,plain,-|int:driving:2:0:",
    ),
    "end_has_the_last_answer": (
        [(Output, "as_dict", _elsewhere(Output.as_dict))], "7,0.05,plain,-|lies:driving:2:30:io",
    ),
    "restart_is_noticed": (
        [(J1939ValveLink, "_look", lambda link: link._frames.receive(0.0))],  # noqa: SLF001 - planted inside
        "7,0.05,plain,v|restart:driving:2:0.05:third",
    ),
    "contact_is_asked": ([(Guard, "_ask_witnesses", lambda *_: None)], "7,0.05,plain,-|deaf:driving:1.3:0.5:io"),
    "holds_are_events": ([(RunWriter, "event", lambda *_, **__: None)], "7,0.05,plain,-|low:driving:1.3:1:aux"),
    "holds_are_events, of nobody": ([(Guard, "_wait_for_holds", Guard._wait_for_operator)], "7,0.05,plain,-"),  # noqa: SLF001 - planted inside
    "witness_is_heard": ([(Witnesses, "driven", lambda *_: None)], "7,0.05,plain,-|sticks:driving:2.3:30:io"),
    "rescue_is_told": (
        [(fail_safe_shutdown, "replace", lambda output, **_: output)], "7,0.05,plain,-|kill:driving:1.3:0:",
    ),
    "rescue_is_told, of one it does not reach": (
        [(j1939_valve, "CanFrames", lambda *how, **more: kept("frames", _can_frames.CanFrames(*how, **more)))],
        "7,0.05,plain,v|kill:driving:1.3:0:",
    ),
    "rescue_is_told, at its time": (
        [(watchdog, "GIVE_UP_S", 0.0)],
        "702301,0.2,blocks,-|out:making safe:0.0526:10:aux|second:making safe:0:0.05:",
    ),
    "samples_reach_the_disk": ([(Syncer, "written", lambda _syncer: None)], "7,0.05,plain,-|power:driving:3.3:0:"),
    "is_read_up_to_its_tear": (
        [(samples, "last_mark", lambda path: (last_mark(path)[0], None))],
        "9,0.05,plain,-|sector:driving:1:0:|kill:driving:3:0:",
    ),
    "events_have_their_time": (
        [(run_writer, "system", SimpleNamespace(utc=lambda: BEGAN))], "7,0.05,plain,-|low:driving:1.3:1:aux",
    ),
    "is_driven": (
        [(j1939_valve, "command_frame", lambda _percent, fail_safe: blocked(0.0, fail_safe))], "7,0.05,plain,v",
    ),
    "nobody_spins": (
        [(fail_safe_shutdown, "_wait", lambda *_: None)], "7,0.05,plain,-|out:driving:1.3:5:io|kill:driving:1.4:0:",
    ),
    "errors_are_not_ours, nor told": (
        [(fail_safe_shutdown, "replace", _undefined)], "7,0.05,plain,-|kill:driving:1.3:0:",
    ),
}  # fmt: skip


@pytest.mark.parametrize("law", FAULTS)
def test_a_law_notices_the_fault_that_it_is_for(law, monkeypatch):
    patches, code = FAULTS[law]
    assert not of(code).broken
    for thing, attribute, instead in patches:
        monkeypatch.setattr(thing, attribute, instead, raising=False)  # an attribute of instances
    assert law.partition(",")[0] in of(code).laws


def test_a_schedule_is_shrunk_to_what_breaks_the_law():
    big = Schedule.of(
        "7,0.2,steps,wras|slow:opening:0.1:1:aux|wd term:driving:1.3456:0:|kill:driving:2.1:0:|low:closing:0:5:io"
    )
    small = shrunk(big, lambda other: "wd term" in [fault.kind for fault in other.faults])
    assert small == Schedule.of("7,0.01,plain,-|wd term:driving:1:0:")


@pytest.mark.parametrize("name", MENDS)
def test_a_mend_that_is_taken_back_is_found(name, monkeypatch):
    """By this schedule, or by chance of another seed: a call more or less of the seam shifts what each seed draws."""
    patches, code = MENDS[name]
    schedule = Schedule.of(code)
    assert not one(schedule, judge).broken
    for thing, attribute, instead in patches:
        monkeypatch.setattr(thing, attribute, instead)
    assert any(one(replace(schedule, seed=seed), judge).broken for seed in range(schedule.seed, schedule.seed + 24))
