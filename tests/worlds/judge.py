"""What stood at the devices against every word that was said of them, and whether everybody came to an end."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError
from hil.record.folder import read
from tests.worlds.devices import FULL
from tests.worlds.driven import LAWS as DRIVEN
from tests.worlds.driven import is_no_restart
from tests.worlds.facts import LAWS as FACTS
from tests.worlds.kept import LAWS as KEPT
from tests.worlds.left import LAWS as LEFT
from tests.worlds.left import kinds as _kinds
from tests.worlds.schedule import BLOCK_S, CALM, NO_DISK
from tests.worlds.system import instant_s
from tests.worlds.world import NEAR, Ran, Word, World

_SAYS_ALL = ("outputs are safe (read back)", "outputs made safe in")
_NOT_SAFE = 3


def judge(world: World, ran: Ran) -> None:
    """Enter every contradiction into `ran.broken`."""
    ran.words += [*_kept(world.folder / "run" / "end.json", "end.json", world.run.ended_s),
                  *_kept(world.folder / "run" / "watchdog.json", "watchdog.json", world.watchdog_ended_s)]  # fmt: skip
    for said_s, by, text in ran.said:
        if any(all_of_them in text for all_of_them in _SAYS_ALL):
            ran.words.append(Word(by, said_s, dict.fromkeys(world.outputs, said_s), text))
    own = (_words, _agree, _status, _ends, _killed, _rescued, _latched, _recorded, _strangers, _as_expected)
    for law in (*own, *LEFT, *DRIVEN, *KEPT, *FACTS):
        broken = [*law(world, ran)]
        ran.broken += broken
        ran.laws |= {law.__name__} if broken else set()
    ran.broken += [f"{task.name} fell: {error!r}" for task, error in world.hub.fallen]


def _kept(path: Path, name: str, ended_s: float) -> Iterator[Word]:
    """What stands in a file: true since the instant of each output, and said when its process ended at the latest."""
    with suppress(OSError, ValueError, KeyError):
        outputs: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["outputs"]
        safe = {
            output: instant_s(one["at_utc"])
            for output, one in outputs.items() if one["state"] == "safe"
        }  # fmt: skip
        yield Word(name, min(ended_s, max(safe.values(), default=ended_s)), safe)


def _away(world: World, ran: Ran, output: str) -> list[tuple[float, float]]:
    """The intervals in which an output was away from its safe value by what this computer sent."""
    device = world.outputs[output]
    changes, ends_s = ran.changes[output], world.hub.now_s
    ends = [*[at_s for at_s, _ in changes[1:]], ends_s]
    away = [(at_s, end_s) for (at_s, at), end_s in zip(changes, ends, strict=True)
            if abs(at) > NEAR and at_s not in ran.pokes[device]]  # fmt: skip
    others_s = [one.taken_s for one in world.system.processes if one.name == "second"]  # another program has the bench
    return [(at_s, end_s) for at_s, end_s in away if not any(at_s > taken_s for taken_s in others_s)]


def _words(world: World, ran: Ran) -> Iterator[str]:
    exchanged = [fault.device for fault, phase in ran.took if fault.kind == "swap" and phase == "opening"]
    for word in ran.words:
        for output, since_s in word.safe.items():
            if world.outputs[output] in exchanged:  # before anybody knew it: it is said of the other one
                continue
            for begins_s, ends_s in _away(world, ran, output):
                if ends_s > since_s + 1e-3:
                    yield (
                        f"{word.by} said at {word.at_s:.3f} s that {output} is safe since {since_s:.3f} s; it was away "
                        f"from {begins_s:.3f} to {ends_s:.3f} s"
                    )
                    break


def _status(world: World, ran: Ran) -> Iterator[str]:
    status, ended_s = world.run.status, world.run.ended_s
    if status is None or status < 0 or status == _NOT_SAFE:
        return
    for output in world.outputs:
        if any(begins_s and ends_s > ended_s for begins_s, ends_s in _away(world, ran, output)):
            yield f"exit status {status} at {ended_s:.3f} s, and {output} was away after it"


def _ends(world: World, ran: Ran) -> Iterator[str]:
    for process in world.system.processes:
        if process.status is None:
            yield f"{process.name} never ended"
    ended_by_itself = world.run.status is not None and world.run.status >= 0 and (world.folder / "run").exists()
    if ended_by_itself and not (world.folder / "run" / "end.json").exists() and not NO_DISK & _kinds(ran):
        yield "the run ended by itself, and there is no end.json"


def _rescued(world: World, ran: Ran) -> Iterator[str]:
    """With the run or the watchdog left, and the devices within reach again, outputs are safe in the end."""
    watchdog = world.watchdog
    nobody = world.run.status in (-9, _NOT_SAFE) and (watchdog is None or watchdog.status == -9)
    for output, device in world.outputs.items():
        begun_s, percent = ran.changes[output][-1]
        if begun_s and abs(percent) > NEAR and not nobody and not ran.pokes[device] and device not in world.strangers:
            left = f"run {world.run.status}, watchdog {watchdog and watchdog.status}"
            yield f"{output} stands at {percent:.1f} % in the end ({left})"


_MAY_HANG = {"kill", "pause", "sleep", "disk slow", "slow line", "hold", "slow", "lose", "power"}


def _killed(world: World, ran: Ran) -> Iterator[str]:
    """A program that gives signs of life is not taken for one that hangs."""
    if world.run.status == -9 and not _kinds(ran) & _MAY_HANG and ran.schedule.procedure != "blocks":
        yield "the watchdog killed a run that was at work"


def _latched(world: World, ran: Ran) -> Iterator[str]:
    """What has tripped keeps the next program from driving."""
    if world.after is None:
        return
    moved = any(at_s > world.after.taken_s for output in world.outputs for at_s, _ in _away(world, ran, output))
    if world.after.status != _NOT_SAFE or moved:
        yield f"an interlock had tripped, and the next run ends with {world.after.status}{', and drove' * moved}"


def _recorded(world: World, ran: Ran) -> Iterator[str]:
    """The record can be read; all that was handed back is in it, and every flow is one that the device measured."""
    if not (world.folder / "run" / "run.json").exists():
        return
    try:
        recording = read(world.folder / "run")
    except FileError as error:
        if "at least 2 are needed" not in str(error):
            yield f"the record cannot be read: {error}"
        return
    if len(recording.time_s) < 2 * ran.blocks and "power" not in _kinds(ran):
        yield f"{len(recording.time_s)} samples are recorded, and {2 * ran.blocks} were handed back"
    if not ran.schedule.faults and abs(np.median(np.diff(recording.time_s)) - 0.05) > 0.005:
        yield "nothing happened, and samples are not at their times"
    flow = recording.channels["flow"].values
    counts = {round(value) for value in flow[np.isfinite(flow)] / 100.0 * FULL}
    measured = {count for one in (world.couplers["io"], *world.strangers.values()) for _, _, count in one.measured}
    if strange := counts - measured:
        yield f"{len(strange)} recorded flows were never measured, such as {min(strange)} counts"


_ASK_FIRST = CALM - {"second", "wd pause"} | {"swap", "kill", "sticks"}
"""Faults beside which who comes to an address says what it is before anything is written there."""
_MEETS_S = 0.1  # so soon a device has said what it is on a new connection
_ANSWERS_S = 0.002  # so soon one that asks for a connection hears that it has it, from who was there then


def _strangers(world: World, ran: Ran) -> Iterator[str]:
    """One that comes before the run has met its devices is the one that it meets."""
    for device, stranger in world.strangers.items():
        came_early = any(fault.kind == "swap" and phase == "opening" for fault, phase in ran.took)
        if not came_early and any(abs(at) > NEAR for _, at in stranger.changes):
            yield f"another device that has the address of {device} was driven"
        came_s = [at_s for (fault, _), at_s in zip(ran.took, ran.took_s, strict=True)
                  if fault.kind == "swap" and fault.device == device][-1]  # fmt: skip
        met = any(
            came_s - _MEETS_S < at_s <= came_s + _ANSWERS_S
            for one in world.system.processes
            for at_s in one.connected_s
        )
        if not stranger.identity:
            continue  # it may be the same one, asked at a bad moment: a safe value is written to it all the same
        if not (came_early or met or _kinds(ran) - _ASK_FIRST or world.after) and stranger.written:
            yield f"another device that has the address of {device} was written to at {stranger.written[0]:.3f} s"


def _agree(world: World, ran: Ran) -> Iterator[str]:
    """The sentence of a run, its data and its exit status say the same."""
    for word in ran.words:
        if word.by != "run" or not word.states:
            continue
        says_not, says_safe = "NOT SAFE" in word.text, _SAYS_ALL[0] in word.text
        all_safe = all(state == "safe" for state in word.states.values())
        if (says_safe and not all_safe) or (says_not and all_safe) or (world.moved and says_safe == says_not):
            yield f"'{word.text}' is said of {word.states}"
        if world.run.status is not None and world.run.status >= 0 and not all_safe and world.run.status != _NOT_SAFE:
            yield f"exit status {world.run.status} with {word.states}"


_OWN = {"raises": 3, "exits": 3, "blocks": -9}  # one that blocks is killed by the watchdog
_ENDINGS: dict[str, tuple[int, float, str]] = {
    "int": (130, 0.3, ""), "term": (143, 0.3, "SIGTERM"), "hup": (129, 0.3, "SIGHUP"), "kill": (-9, 0.5, ""),
    "stop": (138, 0.3, "stop was pressed"), "wd kill": (3, 0.5, "watchdog process ended"),
    "over": (3, 0.4, "over-pressure"), "pressed": (3, 0.4, "pressed at"), "disk full": (3, 0.4, "No space left"),
    "disk gone": (3, 0.4, "Input/output error"),
    "wd pause": (3, 2.5, "watchdog process gave no answer"), "pause": (-9, 2.0, ""), "sleep": (3, 1.5, "slept for"),
    "reset": (3, 1.0, "connection is lost"), "restart": (3, 1.0, ""), "out": (3, 2.5, ""), "switch": (3, 2.5, ""),
    "deaf": (3, 2.5, ""), "mute": (3, 2.5, "no valid answer"),
}  # fmt: skip
_LEAST_S = {"wd pause": 2.5, "pause": 2.0, "sleep": 0.5, "over": 0.2, "pressed": 0.2, "out": 0.5, "switch": 0.5,
            "deaf": 0.5, "mute": 0.5, "disk full": 0.2, "disk gone": 0.2, "reset": 0.2}  # fmt: skip
_NEVER_MATTERS = {"wd term", "fork", "second", "clock", "sector"}
_CHANGE_NOTHING = _NEVER_MATTERS | {"crowd", "disk slow", "double", "hold run", "low"}
_WAITS = {
    "sleep",
    "restart",
    "out",
    "switch",
    "deaf",
    "reset",
}  # what cannot be reached for so long cannot be made safe


def _as_expected(world: World, ran: Ran) -> Iterator[str]:
    """One fault alone, while outputs are driven: how it must end, and how soon outputs are safe."""
    own = _OWN.get(ran.schedule.procedure, 0)
    if not ran.took:
        if ran.status != own:
            yield f"nothing happened, and the exit status is {ran.status}"
        return
    both = [*zip(ran.took, ran.took_s, strict=True)]
    if len(both) > 1:  # what never matters to a run does not matter beside another fault either
        both = [one for one in both if one[0][0].kind not in _NEVER_MATTERS] or both[:1]
    if len(both) > 1 or both[0][0][1] != "driving":
        return
    (((fault, _), begun_s),) = both
    said = " ".join(text for _, _, text in ran.said)
    changes_nothing = fault.kind in _CHANGE_NOTHING or (fault.kind == "slow" and ran.schedule.long)
    if changes_nothing and fault.device != "third" and ran.status != own:
        yield f"{fault.kind} alone changes nothing, and the exit status is {ran.status}: {said:.200}"
    if fault.kind == "second" and any(one.name == "second" and one.status == 0 for one in world.system.processes):
        yield "a second program had the bench while it was driven"
    if fault.kind in ("low", "hold run"):
        yield from _held(ran, begun_s, fault.lasts_s)
    writes_s = (ran.schedule.block_s - BLOCK_S) * (fault.kind in NO_DISK)
    is_short = fault.lasts_s < _LEAST_S.get(fault.kind, 0.0) + writes_s
    if fault.kind not in _ENDINGS or is_short or is_no_restart(ran, fault):
        return
    status, within_s, text = _ENDINGS[fault.kind]
    if fault.kind == "wd pause" and ran.status == own and ran.changes["command"][-1][0] < begun_s + within_s:
        return  # at its end before anybody could miss an answer
    statuses = {3, -9} if fault.kind == "sleep" else {status}
    if ran.status not in statuses:
        yield f"{fault.kind} alone ends with {ran.status}: {said:.200}"
    elif fault.device != "third" and text not in said and ran.status != -9:
        yield f"{fault.kind} alone is not told: {said:.200}"
    within_s += (fault.lasts_s if fault.kind in _WAITS else 0.0) + (0.7 if ran.schedule.ramped else 0.0)
    within_s += ran.schedule.block_s - BLOCK_S
    for output in world.outputs:
        late = [ends_s for _, ends_s in _away(world, ran, output) if ends_s > begun_s + within_s]
        if late:
            yield f"{fault.kind} alone at {begun_s:.3f} s, and {output} is away until {late[-1]:.3f} s"


def _held(ran: Ran, begun_s: float, lasts_s: float) -> Iterator[str]:
    """Nothing moves between the border at which a hold begins and its end."""
    moved = [
        at_s for at_s, _ in ran.changes["command"] if begun_s + 2.1 + ran.schedule.block_s < at_s < begun_s + lasts_s
    ]
    if moved:
        yield f"held from {begun_s:.3f} s for {lasts_s:g} s, and the command moved at {moved[0]:.3f} s"
