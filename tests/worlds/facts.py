"""Figures that a run wrote down or told, and when it said what, against what devices measured (see `judge`)."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from hil.errors import InUseError
from hil.record.recording import Array
from tests.worlds.devices import FULL
from tests.worlds.driven import LEAST_S, drives_s
from tests.worlds.left import end_of, kinds, recording_of, report_of
from tests.worlds.schedule import CALM
from tests.worlds.serial_line import OnALine
from tests.worlds.system import instant_s
from tests.worlds.world import NEAR, RATE_HZ, THIRD, THIRD_READS, Ran, World

_COUNTS = {"supply pressure": ("aux", 1, 250.0), "emergency stop": ("aux", 2, 10.0)}
"""Inputs beside the flow (see `left.samples_are_those`): of which coupler, which of its inputs, and full scale."""
_NO_CHECKSUM = {"source", "controller"}
_HIGH, _OPEN = round(140.0 / 250.0 * FULL), round(0.2 * FULL)  # counts of pressure and contact beyond which it trips
_PERSON = "a person"
_SPOILS = {"double", "lose", "garble"}
_IN_TIME_S = 0.005
_TRIES_S = 0.45  # so long it is tried at least before an output is called anything but safe
_STANDS = re.compile(r"'command' stands at (-?[\d.]+(?:e-?\d+)?) %")
_HELD = re.compile(r"held the run for ([\d.]+) s")
_SLEPT = re.compile(r"slept for ([\d.]+) s")
_PATIENCE_S = 20.0
_HEARS_S = 0.3  # so soon one process knows what another one does
_LATE_ROWS = 3.0  # times the interval of the samples


def inputs_are_those(world: World, ran: Ran) -> Iterator[str]:
    """Every recorded input is what its device told, in this order."""
    recording = recording_of(world)
    if recording is None:
        return
    for name, (device, which, full) in _COUNTS.items():
        couplers = [one for one in (world.couplers[device], world.strangers.get(device)) if one is not None]
        told = sorted((at_s, float(counts[which])) for one in couplers for at_s, counts in one.inputs_told)
        yield from _in_order(name, np.round(recording.channels[name].values / full * FULL), told)
    spoiled = ran.schedule.third in _NO_CHECKSUM and kinds(ran) & _SPOILS
    if world.third is not None and ran.schedule.third in THIRD_READS and not spoiled:
        yield from _in_order("pilot reads", recording.channels["pilot reads"].values, world.third.told)


def _in_order(name: str, values: Array, told: list[tuple[float, float]]) -> Iterator[str]:
    at = 0
    for i, value in enumerate(values.tolist()):
        while np.isfinite(value) and at < len(told) and abs(told[at][1] - value) > 1e-6:
            at += 1
        if at == len(told) and np.isfinite(value):
            yield f"sample {i} of '{name}', {value:g}, was never told, or not then"
            return


def delays_agree(world: World, ran: Ran) -> Iterator[str]:
    """Between the readings of two devices lies the time by which their delays differ."""
    recording = recording_of(world)
    if recording is None or kinds(ran) - CALM or len(recording.time_s) < RATE_HZ:
        return
    told = {name: np.array([at_s for at_s, _ in world.couplers[name].inputs_told]) for name in ("io", "aux")}
    between_s = recording.channels["delay of aux"].values - recording.channels["delay of io"].values
    first = np.searchsorted(told["aux"], told["io"])
    apart_s = np.append(told["aux"], np.inf)[first] - told["io"]
    if abs(np.median(between_s) - np.median(apart_s)) > _IN_TIME_S:
        yield f"aux is read {np.median(apart_s):.4f} s after io, and said to be {np.median(between_s):.4f} s"
    if np.min(recording.channels["delay of io"].values) < 0.0 or np.max(between_s) > 0.1:
        yield f"readings are said to be up to {np.max(between_s):.4f} s apart, and nothing is slow"


def is_sampled_in_time(world: World, ran: Ran) -> Iterator[str]:
    """While a block is played its samples come at their rate, where nothing is in the way."""
    recording = recording_of(world)
    if recording is None or kinds(ran) - CALM - {"over", "pressed", "low", "hold run"} or kinds(ran) & {"wd pause"}:
        return
    begun_s, end_s = drives_s(world)
    asked = sorted({at_s for at_s in world.couplers["io"].asked_s if begun_s < at_s < end_s})
    least = 0.6 * (end_s - begun_s) * RATE_HZ - 10.0
    if ran.schedule.procedure in ("plain", "steps", "raises", "exits") and len(asked) < least < np.inf:
        yield f"driven for {end_s - begun_s:.2f} s, and read {len(asked)} times"


def tries_before_it_says_so(world: World, ran: Ran) -> Iterator[str]:
    """An output is called something else than safe only after it was tried for a while."""
    begun_s = world.begun_s.get("making safe")
    word = next((one for one in ran.words if one.by == "run" and one.states), None)
    if word is None or begun_s is None or not world.moved or kinds(ran) & {"sticks", "sleep", "pause"}:
        return
    if any(state != "safe" for state in word.states.values()) and word.at_s < begun_s + _TRIES_S:
        yield f"made safe from {begun_s:.3f} s on, and at {word.at_s:.3f} s the run says already: {word.text}"


def figures_are_true(world: World, ran: Ran) -> Iterator[str]:
    """Where a sentence says that an output stands, its device has answered; times in it have passed."""
    answers = [100.0 * count / FULL for one in (world.couplers["io"], world.strangers.get("io")) if one is not None
               for _, count in one.read_back]  # fmt: skip
    for at_s, by, text in ran.said:
        for number in _STANDS.findall(text):
            if not any(abs(float(number) - at) < 0.02 for at in answers):
                yield f"{by} says at {at_s:.3f} s: {text:.200}; it never answered that"
        for number in _HELD.findall(text):
            if abs(float(number) - _PATIENCE_S) > ran.schedule.block_s + 0.01:
                yield f"{by} says at {at_s:.3f} s: {text:.200}; patience is {_PATIENCE_S:g} s"
        for number in _SLEPT.findall(text):
            lasts_s = [fault.lasts_s for fault, _ in ran.took if fault.kind in ("sleep", "pause")]
            if float(number) > sum(lasts_s) + 1.0:
                yield f"{by} says at {at_s:.3f} s: {text:.200}; it was for {lasts_s} s"


def meets_first(world: World, ran: Ran) -> Iterator[str]:
    """A device is driven away only on a connection on which it was asked what it is."""
    for name, device in (*world.couplers.items(), *world.strangers.items()):
        if device.unmet_s:
            yield f"{name} was driven away at {device.unmet_s[0]:.3f} s, and not asked before what it is"


def late_answers_pass(world: World, ran: Ran) -> Iterator[str]:
    """While an answer may still come late nothing but a safe value goes out on a serial line."""
    third = world.third
    if not isinstance(third, OnALine) or kinds(ran) & {"pause", "wd pause", "sleep"}:
        return
    for at_s, data in third.line.hasty:
        if not data.startswith(third.safe):
            yield f"{data!r} was sent at {at_s:.3f} s, while an earlier answer might still come"
            return


def stop_is_answered(world: World, ran: Ran) -> Iterator[str]:
    """Who presses stop while it is driven hears that outputs are safe, of whom, and after which time."""
    begun_s, end_s = drives_s(world)
    for asked_s, answered_s, is_done, answer in ran.stops:
        safe = {name for name, output in answer["outputs"].items() if output["state"] == "safe"}
        if (answer["state"] == "confirmed") != (len(safe) == len(world.outputs)):
            yield f"stop of {asked_s:.3f} s is answered: {answer}"
        if not 0.0 <= answer["seconds"] <= answered_s - asked_s + 1e-3 and is_done:
            yield f"stop of {asked_s:.3f} s was answered at {answered_s:.3f} s: {answer}"
        was_dead = world.run.status == -9 and asked_s > world.run.ended_s
        is_fresh = answer["by"] == "watchdog" and answer["seconds"] > 0.0
        if was_dead and answer["state"] == "confirmed" and not is_fresh:
            yield f"the run was dead when stop was pressed at {asked_s:.3f} s, and the answer is {answer}"
        units = {name: output["unit"] for name, output in answer["outputs"].items()}
        if units and units != world.units:
            yield f"stop of {asked_s:.3f} s is answered with outputs in {units}"
        others = kinds(ran) - {"stop", "fork", "second", "sector", "clock", "int", "hup"}
        if others or ran.schedule.procedure == "blocks" or not begun_s < asked_s < end_s:
            continue
        if not is_done or answer["state"] != "confirmed" or answer["by"] != "run":
            yield f"stop of {asked_s:.3f} s, and at {answered_s:.3f} s the answer is {answer}"


def hold_is_shown(world: World, ran: Ran) -> Iterator[str]:
    """Who asked for a hold reads whether the run holds."""
    recording = recording_of(world)
    _, end_s = drives_s(world)
    if recording is None or kinds(ran) - CALM - {"slow"} or kinds(ran) & {"low", "wd pause"}:
        return
    begins_s, ends_s = ([instant_s(event["utc"]) for event in recording.meta["events"]
                         if event["event"] == kind and event["details"].get("by") == "operator"]
                        for kind in ("hold", "resume"))  # fmt: skip
    if sum(fault.kind == "hold run" for fault, _ in ran.took) != 1 or "clock" in kinds(ran):
        return
    for asked_s, released_s, state in ran.holds:
        holds = any(asked_s < at_s < released_s - _HEARS_S for at_s in begins_s) and released_s < end_s
        may_hold = any(at_s < released_s for at_s in begins_s)
        if (holds and state != "holding") or (state == "holding" and not may_hold):
            yield f"held at {begins_s} until {ends_s} s, asked from {asked_s:.3f} to {released_s:.3f} s: {state}"


def header_is_true(world: World, ran: Ran) -> Iterator[str]:
    """What a run folder says of its channels and of their sampling is what the bench file says, and what was seen."""
    recording = recording_of(world)
    if recording is None:
        return
    sampling = recording.meta["sampling"]
    read = {"flow": "io", "supply pressure": "aux", "emergency stop": "aux"}
    read |= {"pilot reads": "third"} if ran.schedule.third in THIRD_READS else {}
    if sampling["delay_channels"] != {name: f"delay of {device}" for name, device in read.items()}:
        yield f"delays are said to stand in {sampling['delay_channels']}"
    if sampling["rate_hz"] != RATE_HZ or sampling["timing"] != "polled" or sampling["simultaneous"]:
        yield f"the sampling is said to be {sampling}"
    if (
        (sampling["watchdog_s"] is not None)
        and not ran.schedule.armed
        and ran.schedule.third not in ("valve", "driver")
    ):
        yield f"no device has a watchdog, and {sampling['watchdog_s']} s are said"
    units = {"command": "%", "enable": "V", "flow": "l/min", "supply pressure": "bar", "emergency stop": "V"}
    units |= {"pilot": str(THIRD[ran.schedule.third][0]["unit"])} if ran.schedule.third else {}
    if ran.schedule.third in THIRD_READS:
        units["pilot reads"] = THIRD_READS[ran.schedule.third][1]
    found = {name: channel.unit for name, channel in recording.channels.items() if not name.startswith("delay of")}
    if found != units:
        yield f"channels are {found}"
    if not kinds(ran) - CALM and ran.schedule.third != "driver":  # who tells by himself is slow to say where he stands
        for name, delay_s in sampling["delay_s"].items():
            seen = np.median(recording.channels[f"delay of {read[name]}"].values)
            if abs(delay_s - seen) > _IN_TIME_S:
                yield f"the delay of '{name}' is said to be {delay_s:.4f} s, and is {seen:.4f} s"


def events_have_their_row(world: World, ran: Ran) -> Iterator[str]:
    """An event stands at a row that is there, with the time of that row, and rows of events only grow."""
    recording = recording_of(world)
    if recording is None or kinds(ran) & {"power", "sector"}:
        return
    rows = [event["row"] for event in recording.meta["events"]]
    if rows != sorted(rows) or any(not 0 <= row <= len(recording.time_s) for row in rows):
        yield f"events stand at rows {rows} of {len(recording.time_s)}"
        return
    for event in recording.meta["events"]:
        near = recording.time_s[max(event["row"] - 1, 0) : event["row"] + 1]
        if event["time_s"] is not None and len(near) and np.min(np.abs(near - event["time_s"])) > 1e-6:
            yield f"{event} is at the time of another row: {near}"


def causes_of_the_watchdog(world: World, ran: Ran) -> Iterator[str]:
    """Why a watchdog acted is what happened."""
    said = " ".join(text for _, by, text in ran.said if by == "hil.bench.watchdog")
    hangs = {"pause", "sleep", "disk slow", "slow line", "hold", "slow", "lose", "wd pause"}
    if "gave no sign of life" in said and not (hangs & kinds(ran) or ran.schedule.procedure == "blocks"):
        yield f"nobody hung, and the watchdog says: {said:.200}"
    if "was told to stop" in said and "stop" not in kinds(ran):
        yield f"nobody pressed stop, and the watchdog says: {said:.200}"
    if "in use by" in said and not (world.after or "second" in kinds(ran)):
        yield f"nobody else had the bench, and the watchdog says: {said:.200}"


_OF_ALL = {"switch", "pause", "sleep", "power", "second", "disk slow", "wd kill", "wd pause"}
"""Faults beside which an output may come later to its safe value, to whatever device they happen."""
_TIME_OUT_S, _RAMP_S, _OPENS_S = 0.3, 0.7, 0.4
"""Of an exchange with another device that is under way, of the way down, of opening a device on a way of one's own."""


def others_delay_nothing(world: World, ran: Ran) -> Iterator[str]:
    """An output to whose own device nothing happened is safe soon, whatever the others do: by the run, or after it."""
    begun_s, run = world.begun_s.get("making safe"), world.run
    if run.status is None or kinds(ran) & _OF_ALL or (run.status < 0 and ran.schedule.procedure == "blocks"):
        return
    from_s = run.ended_s if run.status < 0 else begun_s
    struck = {fault.device for fault, _ in ran.took} - {""}
    within_s = 0.1 + _TIME_OUT_S * len(struck) + (_OPENS_S if run.status < 0 else _RAMP_S * ran.schedule.ramped)
    for output, device in world.outputs.items() if from_s is not None else ():
        changes = ran.changes[output]
        stood = [percent for at_s, percent in changes if at_s <= from_s][-1]
        safe_s = next((at_s for at_s, percent in changes if at_s > from_s and abs(percent) <= NEAR), np.inf)
        if device not in struck and abs(stood) > NEAR and safe_s > from_s + within_s:
            yield f"over at {from_s:.3f} s, nothing happened to {device}, and {output} is safe at {safe_s:.3f} s"


def trips_within_a_block(world: World, ran: Ran) -> Iterator[str]:
    """Once a device has told what trips, the safe value goes out when this block is over."""
    begun_s = world.begun_s.get("making safe")
    if begun_s is None or kinds(ran) - CALM or kinds(ran) & {"wd pause", "low", "hold run"}:
        return
    if any(fault.kind in LEAST_S and fault.lasts_s < LEAST_S[fault.kind] for fault, _ in ran.took):
        return  # it may have been over before it was told twice
    drives_from_s, _ = drives_s(world)
    told = world.couplers["aux"].inputs_told
    for kind, beyond in (("over", lambda counts: counts[1] > _HIGH), ("pressed", lambda counts: counts[2] < _OPEN)):
        told_s = [at_s for at_s, counts in told if beyond(counts) and drives_from_s < at_s < begun_s]
        late_s = begun_s - told_s[min(1, len(told_s) - 1)] if told_s else 0.0
        if late_s > ran.schedule.block_s + _IN_TIME_S * 6.0:
            yield f"{kind} was told at {told_s[0]:.3f} s, and it was made safe from {begun_s:.3f} s on"


def safe_goes_out_at_once(world: World, ran: Ran) -> Iterator[str]:
    """On a serial line a safe value waits for no answer that may come late."""
    begun_s, third = world.begun_s.get("making safe"), world.third
    never = {fault.kind for fault, _ in ran.took if fault.device == "third"} & {"reset", "out", "restart", "fails"}
    if begun_s is None or not isinstance(third, OnALine) or kinds(ran) & _OF_ALL or never or world.run.status != 3:
        return
    stood = [percent for at_s, percent in ran.changes["pilot"] if at_s <= begun_s][-1]
    sent_s = next((at_s for at_s, data in third.line.sent if at_s > begun_s and data.startswith(third.safe)), np.inf)
    others = {fault.device for fault, _ in ran.took} - {"", "third"}
    within_s = 0.25 + _TIME_OUT_S * len(others) + _RAMP_S * ran.schedule.ramped
    if abs(stood) > NEAR and sent_s > begun_s + within_s:
        yield f"made safe from {begun_s:.3f} s on, and third is told so at {sent_s:.3f} s"


def who_it_was_is_told(world: World, ran: Ran) -> Iterator[str]:
    """Who pressed stop is kept with the run and by its watchdog; who has the bench is told to who wants it."""
    recording, watchdog = recording_of(world), report_of(world)
    events = [] if recording is None else [one for one in recording.meta["events"] if one["event"] == "stop"]
    by = {event["details"].get("by", "") for event in events}
    by |= {kept["stopped_by"] for kept in (end_of(world).get("meta", {}), watchdog) if "stopped_by" in kept}
    if by and (by != {_PERSON} or "stop" not in kinds(ran)):
        yield f"stopped by {by}, of {kinds(ran)}"
    if events and end_of(world) and "stopped_by" not in end_of(world)["meta"]:
        yield f"an event says that {by} stopped the run, and its end does not"
    for kind, text in ran.errors:
        if kind is InUseError and not re.search(r"in use by (process 100[012] |another program)", text):
            yield f"who wanted the bench was told: {text}"


LAWS = (
    inputs_are_those, delays_agree, is_sampled_in_time, tries_before_it_says_so, figures_are_true, meets_first,
    others_delay_nothing, trips_within_a_block, safe_goes_out_at_once, late_answers_pass, stop_is_answered,
    hold_is_shown, header_is_true, events_have_their_row, causes_of_the_watchdog, who_it_was_is_told,
)  # fmt: skip
