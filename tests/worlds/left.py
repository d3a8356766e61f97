"""What a run wrote down, told and left behind, against what happened (see `judge`)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from hil.bench.heartbeat import GIVE_UP_S
from hil.bench.stop.control import CONTROL_FILE
from hil.errors import FileError
from hil.record.folder import read
from hil.record.recording import Recording
from tests.worlds.devices import FULL
from tests.worlds.schedule import ARRIVES_LATE, CALM, NO_DISK
from tests.worlds.system import instant_s
from tests.worlds.world import FULL_SCALE, NEAR, OUTPUTS, RAMP_PER_S, Ran, World

_SAFE_S = 5.0  # so soon outputs are safe once whoever makes them safe reaches every device
_LEAVES_S = 12.0  # so soon a watchdog is gone that has nothing to do
_ON_ITS_WAY_S = 0.005  # so soon a command arrives that another thread has just sent
_TRIES_S = 80.0  # so long one tries at most
_LASTING = {"claims", "swap"}  # what is never over
_ANSWERS_S, _ON_A_LINE_S = 0.5, 0.5  # so soon after it came to its safe value a device has said so; more on a line
_STAMP_S = 1e-3  # digits of an instant
_STANDS_STILL = {"pause", "wd pause", "sleep", "disk slow"}  # between an answer and who notes it
SIGNALLED = {"int", "term", "hup", "stop"}


def faults_end_s(ran: Ran) -> float:
    """When everything that happened is over."""
    return max((at_s + fault.lasts_s for (fault, _), at_s in zip(ran.took, ran.took_s, strict=True)), default=0.0)


def kinds(ran: Ran) -> set[str]:
    """What happened."""
    return {fault.kind for fault, _ in ran.took}


def end_of(world: World) -> dict[str, Any]:
    """What stands in end.json; nothing where there is none."""
    return _in_file(world, "end.json")


def report_of(world: World) -> dict[str, Any]:
    """What stands in watchdog.json; nothing where there is none."""
    return _in_file(world, "watchdog.json")


def _in_file(world: World, name: str) -> dict[str, Any]:
    with suppress(OSError, ValueError):
        found: dict[str, Any] = json.loads((world.folder / "run" / name).read_text(encoding="utf-8"))
        return found
    return {}


@lru_cache(maxsize=1)  # of one world after the other: most laws ask for it
def recording_of(world: World) -> Recording | None:
    """The record, where there is one with samples."""
    with suppress(FileError):
        return read(world.folder / "run")
    return None


def end_is_true(world: World, ran: Ran) -> Iterator[str]:
    """What is written of the end is what was said of it, and what every output was known to be."""
    end, word = end_of(world), next((one for one in ran.words if one.by == "run"), None)
    if not end or word is None or world.run.status is None or world.run.status < 0:
        return
    states = {name: output["state"] for name, output in end["outputs"].items()}
    if states != word.states and "NOT SAFE" not in word.text:
        yield f"end.json has {states}, and the run said {word.states}"
    late = any(
        fault.kind in SIGNALLED and phase != "driving" for fault, phase in ran.took
    )  # told to end when it was over
    if (end["outcome"] == "completed") != (world.run.status == 0) and not late:
        yield f"the outcome is {end['outcome']!r}, and the exit status {world.run.status}"
    cause = end["outcome"].partition(": ")[2].split(";")[0]
    if cause not in " ".join(text for _, by, text in ran.said if by == "run"):
        yield f"the outcome is {end['outcome']!r}, and something else was said"
    for name, output in end["outputs"].items():
        since_s = instant_s(output["at_utc"])
        if output["unit"] != world.units[name]:
            yield f"{name} is in {output['unit']}, not in {world.units[name]}"
        if not -1e-3 <= since_s <= world.run.ended_s + 1e-3:
            yield f"{name} is known since {since_s:.3f} s, and the run ended at {world.run.ended_s:.3f} s"
        if output["state"] == "safe" and not (output["read_back"] and abs(output["at"]) <= NEAR):
            yield f"{name} is safe: {output}"
    recording = recording_of(world)
    if recording is not None and len(recording.time_s) != end["rows"]:
        yield f"{end['rows']} rows are counted, and {len(recording.time_s)} are there"


def told(world: World, ran: Ran) -> Iterator[str]:
    """Who ends otherwise than in order says why, and nobody dies of a fault of his own."""
    ignored = {
        by for _, by, text in ran.said if "Exception ignored in" in text
    }  # a generator that nobody reads any more
    for at_s, by, text in ran.said:
        if "died of" in text or ("Traceback" in text and by not in ignored):
            yield f"{by} at {at_s:.3f} s: {text}"
    texts = [text for _, by, text in ran.said if by == "run"]
    status = world.run.status
    if status is None or status < 0:
        return
    if not texts or (status == 3 and not any(_why(text) for text in texts)):
        yield f"exit status {status}, and nobody says why: {texts}"
    if status in (0, 3, 5) and any(fault.kind in SIGNALLED and phase == "driving" for fault, phase in ran.took):
        came = [at_s for (fault, phase), at_s in zip(ran.took, ran.took_s, strict=True)
                if fault.kind in SIGNALLED and phase == "driving"]  # fmt: skip
        if status == 0 and came:
            yield f"told to end at {came[0]:.3f} s, and the exit status is 0"


def _why(text: str) -> str:
    """What is said beside the outputs."""
    return "; ".join(
        part for part in text.split("; ") if not part.startswith(("outputs are safe", "nothing was driven"))
    )


def nothing_is_left(world: World, ran: Ran) -> Iterator[str]:
    """Who ended in order holds nothing: no lease, connection or thread; and no file says that somebody is at work."""
    for process in world.system.processes:
        if process.status is None or not process.has_returned or process is world.watchdog:
            continue  # a try of the watchdog that became needless ends with it
        # a signal may end the program between a connection and who would close it: the kernel does
        left = [what for what in process.left if what != "a connection" or not kinds(ran) & SIGNALLED]
        if left:
            yield f"{process.name} ended with {', '.join(left)}"
    held = {path for path, holder in world.system.locks.items() if holder.has_returned}
    if held:
        yield f"nobody holds the bench, and its lease was not let go of: {', '.join(sorted(held))}"
    watchdog = world.watchdog
    if watchdog is not None and watchdog.status == 0 and not NO_DISK & kinds(ran):
        left = [path.name for path in world.folder.rglob("*so-far*") if path.is_file()]
        left += [str(path.relative_to(world.folder)) for path in world.folder.glob("state/*so-far*/*")]
        if (world.folder / "run" / CONTROL_FILE).exists():
            left.append(CONTROL_FILE)
        if left:
            yield f"everybody has gone, and {', '.join(left)} is there"


def in_time(world: World, ran: Ran) -> Iterator[str]:
    """Once everybody is reached again: outputs are safe soon, and everybody ends soon."""
    run, watchdog = world.run, world.watchdog
    if kinds(ran) & _LASTING:
        return
    is_over_s = min(run.ended_s, world.begun_s.get("making safe", run.ended_s))
    reached_s = max(is_over_s, faults_end_s(ran))
    somebody = run.status not in (-9, None) or (watchdog is not None and watchdog.status not in (-9, None))
    for output, device in world.outputs.items():
        changes = ran.changes[output]
        ends = [*[at_s for at_s, _ in changes[1:]], world.hub.now_s]
        late = [end_s for (at_s, at), end_s in zip(changes, ends, strict=True)
                if at_s and abs(at) > NEAR and end_s > reached_s + _SAFE_S and at_s not in ran.pokes[device]
                and world.after is None]  # fmt: skip
        if late and somebody and run.status != 3:
            yield (
                f"over at {is_over_s:.3f} s, everything reached from {reached_s:.3f} s on, and {output} is away until "
                f"{late[0]:.3f} s"
            )
    if run.status is not None and run.status >= 0 and run.ended_s > reached_s + _TRIES_S:
        yield f"over at {is_over_s:.3f} s, and the run ended at {run.ended_s:.3f} s"
    if watchdog is not None and watchdog.status is not None and watchdog.ended_s < float("inf"):
        patience_s = _LEAVES_S if run.status == 0 else _TRIES_S
        if watchdog.ended_s > max(run.ended_s, faults_end_s(ran)) + patience_s:
            yield f"the run ended at {run.ended_s:.3f} s, and its watchdog at {watchdog.ended_s:.3f} s"


def doubts_end(world: World, ran: Ran) -> Iterator[str]:
    """Where nothing has happened for a while, outputs are called safe."""
    word = next((one for one in ran.words if one.by == "run" and one.states), None)
    if word is None or kinds(ran) & _LASTING or not word.states:
        return
    if any(fault.kind == "sticks" and phase == "opening" for fault, phase in ran.took):
        return  # what its witness read then was taken for rest
    if faults_end_s(ran) + 2 * _SAFE_S < word.at_s and any(state != "safe" for state in word.states.values()):
        yield f"all is well from {faults_end_s(ran):.3f} s on, and at {word.at_s:.3f} s the run says: {word.text}"


def watchdog_keeps_off(world: World, ran: Ran) -> Iterator[str]:
    """While the run drives, nobody else connects to its devices."""
    begun_s, until_s = world.begun_s.get("driving"), world.begun_s.get("making safe", world.run.ended_s)
    if begun_s is None:
        return
    until_s = min(until_s, world.run.ended_s)
    for process in world.system.processes:
        early = [at_s for at_s in process.connected_s if begun_s < at_s < until_s and process is not world.run]
        if early:
            yield f"{process.name} connected to a device at {early[0]:.3f} s, while the run drove it"


def reads_first(world: World, ran: Ran) -> Iterator[str]:
    """After a gap the first command is the safe value, or the output was read back before."""
    for name, device in world.couplers.items():
        if device.unasked:
            yield f"{name} was driven away at {device.unasked[0]:.3f} s on a new connection, or after its watchdog"


def samples_are_those(world: World, ran: Ran) -> Iterator[str]:
    """Each sample is what the device was told and then measured, in this order."""
    recording = recording_of(world)
    if recording is None:
        return
    measured = sorted(one for device in (world.couplers["io"], *world.strangers.values()) for one in device.measured)
    at = iter((told_to, count) for _, told_to, count in measured)
    told_to = np.round(recording.channels["command"].values / 100.0 * FULL)
    flow = np.round(recording.channels["flow"].values / 100.0 * FULL)
    for i, pair in enumerate(zip(told_to, flow, strict=True)):
        if np.isfinite(pair).all() and not any(pair == one for one in at):
            yield f"sample {i} ({recording.time_s[i]:.3f} s): command and flow {pair} were never told and measured"
            return


def end_has_the_last_answer(world: World, ran: Ran) -> Iterator[str]:
    """What is written of an output at the end is what its device answered last, and no older.

    Until the last word of the run: what comes later is its watchdog's, while the process still waits for its threads.
    """
    end = end_of(world)
    if not end or world.run.status in (None, -9) or kinds(ran) - CALM - {"lies", "sticks"}:
        return
    until_s = max((at_s for at_s, who, _ in ran.said if who == "run"), default=world.run.ended_s)
    for name, device in ((name, world.couplers[device]) for name, device in OUTPUTS.items()):
        answers = [(at_s, count) for at_s, count in device.read_back if at_s < until_s]
        output = end["outputs"].get(name)
        if not answers or output is None or "driving" not in world.begun_s:
            continue
        answered_s, count = answers[-1]
        at = count / FULL * FULL_SCALE[name]
        known_s = instant_s(output["at_utc"])
        if output["at"] is None or abs(output["at"] - at) > 0.01 or known_s < answered_s - _ANSWERS_S / 2:
            yield f"{name} stood at {at:.2f} as it answered at {answered_s:.3f} s, and at the end it is {output}"


def what_stands_was_answered(world: World, ran: Ran) -> Iterator[str]:
    """Where an output is said to stand its device has answered that it stands, just before: no other, and no older."""
    if kinds(ran) & _STANDS_STILL:
        return
    for file, kept in (("end.json", end_of(world)), ("watchdog.json", report_of(world))):
        for name, device in OUTPUTS.items():
            output = kept.get("outputs", {}).get(name, {"state": ""})
            if output["state"] not in ("safe", "driven") or output["at"] is None:
                continue
            known_s = instant_s(output["at_utc"])
            told = [count / FULL * FULL_SCALE[name]
                    for one in (world.couplers[device], world.strangers.get(device)) if one is not None
                    for at_s, count in one.read_back if known_s - _SAFE_S < at_s <= known_s + _STAMP_S]  # fmt: skip
            if not any(abs(at - output["at"]) <= 0.01 for at in told):
                yield f"{file} has {name} at {output['at']} since {known_s:.3f} s, and it answered {told[-3:]}"


def ramps_down(world: World, ran: Ran) -> Iterator[str]:
    """A run that ends in order goes down its ramp, where it has one."""
    begun_s, calm = (
        world.begun_s.get("making safe"),
        {"int", "term", "hup", "fork", "second", "double", "low", "wd term"},
    )
    doubled = any(fault.kind == "double" and fault.device == "third" for fault, _ in ran.took)  # on a serial line
    if not ran.schedule.ramped or begun_s is None or kinds(ran) - calm or doubled or ran.schedule.procedure == "blocks":
        return
    late = [at for at_s, at in ran.changes["command"] if at_s >= begun_s - 0.1]
    steps = [abs(after - before) for before, after in pairwise(late)]
    if steps and max(steps) > 2.0 * RAMP_PER_S * 0.05:
        yield f"the command fell by {max(steps):.1f} % at once, and has a ramp of {RAMP_PER_S:g} %/s"


def stays_safe(world: World, ran: Ran) -> Iterator[str]:
    """Once the run makes its outputs safe it drives none of them away again."""
    begun_s = world.begun_s.get("making safe")
    if begun_s is None or kinds(ran) & (ARRIVES_LATE - {"garble", "echo", "slow"}):
        return
    late = {fault.device for fault, _ in ran.took if fault.kind in ("slow", "deaf", "fails")}  # it obeys, but later
    for output, device in world.outputs.items():
        if device in late:
            continue
        for (before_s, before), (at_s, after) in pairwise(ran.changes[output]):
            was_safe = before_s > begun_s and abs(before) <= NEAR and not kinds(ran) & {"restart", "poke"}
            if (
                begun_s + _ON_ITS_WAY_S * (not was_safe) < at_s < world.run.ended_s
                and abs(after) > abs(before) + NEAR
                and at_s not in ran.pokes[device]
            ):
                yield f"made safe from {begun_s:.3f} s on, and {output} goes to {after:.1f} % at {at_s:.3f} s"
                break


def events_tell(world: World, ran: Ran) -> Iterator[str]:
    """What an interlock or a person did stands among the events."""
    recording = recording_of(world)
    said = " ".join(text for _, by, text in ran.said if by == "run")
    if recording is None or NO_DISK & kinds(ran) or world.run.status in (None, -9):
        return
    events = {(event["event"], event["details"].get("interlock", "")) for event in recording.meta["events"]}
    names = {event for event, _ in events}
    for text, interlock in (("over-pressure", "over-pressure"), ("pressed at", "emergency stop")):
        if text in said and "then reset it" in said and ("trip", interlock) not in events:
            yield f"'{interlock}' has tripped, and no event says so: {sorted(events)}"
    if world.run.status == 138 and "stop" not in names:
        yield f"stop was pressed, and no event says so: {sorted(names)}"


def opens(world: World, ran: Ran) -> Iterator[str]:
    """A bench on which nothing has happened yet is opened and driven."""
    early = any(phase == "opening" for _, phase in ran.took)
    if not early and "driving" not in world.begun_s:
        yield f"nothing had happened, and it was not driven: {' '.join(text for _, _, text in ran.said)}"


def rescue_is_told(world: World, ran: Ran) -> Iterator[str]:
    """A watchdog that has made a dead run's outputs safe says so, and writes down why."""
    watchdog = world.watchdog
    if world.run.status != -9 or watchdog is None or watchdog.status != 0 or "driving" not in world.begun_s:
        return
    if any(fault.kind == "kill" and phase == "closing" for fault, phase in ran.took):
        return  # it may have let its watchdog go home already
    if "power" in kinds(ran) and watchdog.ended_s < world.run.ended_s:
        return  # it had
    said = " ".join(text for _, by, text in ran.said if by == watchdog.name)
    if not any(word in said for word in ("outputs made safe in", "outputs commanded safe in", "NOT SAFE", "in use by")):
        yield f"the run is dead, and its watchdog says: {said}"
    try:
        report = json.loads((world.folder / "run" / "watchdog.json").read_text(encoding="utf-8"))
        if "left_alone" in report and watchdog.ended_s < world.run.ended_s + GIVE_UP_S:
            yield f"the watchdog gave up at {watchdog.ended_s:.3f} s: {report['left_alone']}"
    except (OSError, ValueError) as error:
        if kinds(ran) & (NO_DISK | {"second"}):
            return
        yield f"the run is dead, and its watchdog wrote down nothing: {error}"
        return
    if kinds(ran) & (NO_DISK | {"second"}):
        return
    if report["why"] not in said or set(report["outputs"]) != set(world.outputs):
        yield f"the watchdog says '{said}', and wrote down {report}"
    units = {name: output["unit"] for name, output in report["outputs"].items()}
    if units != world.units:
        yield f"the watchdog wrote down outputs in {units}"
    if "safe_after_s" in report and report["safe_after_s"] > watchdog.ended_s - world.run.ended_s + 0.1:
        yield f"safe after {report['safe_after_s']:g} s, and the watchdog was gone sooner"
    begun_s = next((at_s for at_s in watchdog.connected_s if at_s > world.run.ended_s), world.run.ended_s)
    moves_s = [at_s for name in world.outputs for at_s, _ in ran.changes[name] if at_s < watchdog.ended_s]
    safe_s, after_s = max(*moves_s, begun_s), report.get("safe_after_s", 0.0)
    alone = kinds(ran) <= {"kill", "int", "term", "hup", "fork", "low", "over", "pressed"}
    if alone and "not_safe" in report:
        yield f"every device could be reached, and the watchdog says {report['not_safe']}"
    patience_s = _ANSWERS_S + _ON_A_LINE_S * (world.third is not None)
    if alone and after_s > safe_s - world.run.ended_s + patience_s:
        yield f"safe after {after_s:g} s, and outputs moved last {safe_s - world.run.ended_s:.3f} s after the end"


def word_comes_first(world: World, ran: Ran) -> Iterator[str]:
    """When a procedure hears that the run has ended, its last word was said."""
    said_s = [word.at_s for word in ran.words if word.by == "run"]
    if world.run.status in (None, -9) or not world.swallowed_s:
        return
    if not said_s or min(said_s) > world.swallowed_s:
        yield f"the procedure heard of the end at {world.swallowed_s:.3f} s, and the run spoke at {said_s} s"


LAWS = (
    word_comes_first, end_is_true, told, nothing_is_left, in_time, doubts_end, watchdog_keeps_off, reads_first,
    samples_are_those, end_has_the_last_answer, what_stands_was_answered, ramps_down, stays_safe, events_tell, opens,
    rescue_is_told,
)  # fmt: skip
