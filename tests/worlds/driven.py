"""What was driven, handed back and said to be the cause, against what was asked for and what happened (see `judge`)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from hil.bench.ending import LEAVES_S
from hil.errors import DeviceLostError, HilError, LinkError
from tests.worlds.can_bus import Valve
from tests.worlds.devices import FULL
from tests.worlds.left import end_of, kinds, recording_of
from tests.worlds.schedule import ARRIVES_LATE, BLOCK_S, CALM, NO_DISK, Fault
from tests.worlds.world import NEAR, OUTPUTS, PILOT, RAMP_PER_S, RATE_HZ, Array, Ran, World

_ON = {"enable": 50.0, PILOT: 50.0}  # % of full scale
_ON_VALVE = 40.0
_STEP = 0.01  # % of full scale: what a converter rounds
_HEARD_S = {"int": 0.15, "term": 0.15, "hup": 0.15, "stop": 0.3, "over": 0.8, "pressed": 0.8}
LEAST_S = {"over": 0.3, "pressed": 0.3}
_CAUSES = (
    ("over-pressure", {"over"}), ("pressed at", {"pressed"}), ("low-pressure", {"low", "swap"}),
    ("slept for", {"sleep", "pause", "wd pause"}), ("No space left", {"disk full"}), ("stop was pressed", {"stop"}),
)  # fmt: skip
_SIGNALLED = {130: "int", 143: "term", 129: "hup", 138: "stop"}
_OWN = (HilError, OSError, KeyboardInterrupt, SystemExit, GeneratorExit)
_PYTHON = ("cannot access local variable", "is not defined", "has no attribute", "positional argument", "NoneType")
_LOOKS_S = 0.1
_IN_TIME_S = 0.005
TELLS_LATE_S = 0.5  # on plain CAN nobody says that he restarted; one who obeys again sooner may only have told it late
_FALLS_S = 0.3  # so long one that hears nothing holds its output there
_NOTICED_S = 1.0  # so soon a device that restarted is noticed, once it is back
_HOLDS_S = 2.5  # so long after a person asked for it a run is held: it ends what it plays
_CLOCKS = {"sleep", "pause", "disk slow"}
_CALLS_PER_S = 8000.0  # of the seam; some 3000 of them are usual
_BEGUN_S = 0.02  # so soon a reading that was begun has arrived


def drives_s(world: World) -> tuple[float, float]:
    """From when to when the procedure drives."""
    begun_s = world.begun_s.get("driving", float("inf"))
    return begun_s, min(world.begun_s.get("making safe", float("inf")), world.run.ended_s)


def drives_what_is_asked(world: World, ran: Ran) -> Iterator[str]:
    """While it is driven an output stands where the procedure has asked for, in this order, or at its safe value."""
    begun_s, end_s = drives_s(world)
    asked = np.concatenate([np.zeros(0), *ran.asked])
    in_order = not kinds(ran) & ARRIVES_LATE
    at = 0
    for name in OUTPUTS | ({PILOT: "third"} if world.third else {}):
        device = world.outputs[name]
        on = _ON_VALVE if ran.schedule.third == "valve" and name == PILOT else _ON.get(name)
        for (before_s, before), (at_s, percent) in pairwise(ran.changes[name]):
            if not 0.0 < at_s < end_s or abs(percent) <= NEAR or at_s in ran.pokes[device]:
                continue
            if on is not None:
                comes_on = name == PILOT and 0.0 < percent < on and (at_s < begun_s or not in_order)
                if abs(percent - on) > NEAR and not comes_on:
                    yield f"{name} goes to {percent:.2f} % at {at_s:.3f} s, and is switched on at {on:g} %"
                continue
            if ran.schedule.ramped and (abs(percent) < abs(before) or before_s in ran.pokes[device]):
                continue  # on the way down its ramp (`left.ramps_down`)
            left = np.flatnonzero(np.abs(asked[at:] - percent) <= _STEP)
            if not left.size or at_s < begun_s:
                yield f"{name} goes to {percent:.2f} % at {at_s:.3f} s, and nobody has asked for that then"
                break
            at += int(left[0]) if in_order else 0


def is_driven(world: World, ran: Ran) -> Iterator[str]:
    """With nothing in the way an output came to where the procedure was told that it was."""
    if kinds(ran) - CALM or not ran.handed:
        return
    stood = {name: np.array([percent for _, percent in changes]) for name, changes in ran.changes.items()}
    on = {
        name: _ON_VALVE if ran.schedule.third == "valve" and name == PILOT else _ON[name] for name in stood.keys() & _ON
    }
    for name, level in (*on.items(), *(("command", command[-1]) for command, _ in ran.handed)):
        if np.min(np.abs(stood[name] - level)) > NEAR:
            yield f"{name} never stood at {level:.2f} %, and the procedure was told so"
            return


def nobody_spins(world: World, ran: Ran) -> Iterator[str]:
    """Who waits for something does not ask for it again and again."""
    if ran.calls > _CALLS_PER_S * max(1.0, ran.ended_s):
        yield f"{ran.calls} calls of the seam in {ran.ended_s:.1f} s"


def begins_safe(world: World, ran: Ran) -> Iterator[str]:
    """A procedure begins when its command stands at the safe value."""
    begun_s, _ = drives_s(world)
    if "io" in world.strangers:
        return  # another device is driven
    before = [(at_s, percent) for at_s, percent in ran.changes["command"] if at_s <= begun_s]
    if begun_s < float("inf") and abs(before[-1][1]) > NEAR and before[-1][0] not in ran.pokes["io"]:
        yield f"the procedure begins at {begun_s:.3f} s, and the command stands at {before[-1][1]:.1f} %"


def errors_are_not_ours(world: World, ran: Ran) -> Iterator[str]:
    """What ends a program is told in its own words: no fault of the code itself."""
    for kind, text in ran.errors:
        if not issubclass(kind, _OWN) and (kind, text) != (ValueError, "a fault of the procedure"):
            yield f"{kind.__name__}: {text}"
    kept = [path.read_text(encoding="utf-8") for path in world.folder.glob("run/*.json")]
    for text in (*(text for _, _, text in ran.said), *kept):
        if any(words in text for words in _PYTHON):
            yield f"a fault of the code is told: {text:.300}"


def connections_are_given_up(world: World, ran: Ran) -> Iterator[str]:
    """Where an answer did not come in time, what is sent next is sent on another connection."""
    for name, device in (*world.couplers.items(), *world.strangers.items()):
        if device.reused:
            yield f"at {device.reused[0]:.3f} s {name} is asked again on a connection that had given no answer"


def hands_back_what_is_recorded(world: World, ran: Ran) -> Iterator[str]:
    """What a procedure is handed back stands in the record, in this order, with the commands that it has asked for."""
    recording = recording_of(world)
    if recording is None:
        return
    at, kept = 0, [recording.channels[name].values for name in ("command", "flow")]
    for number, handed in enumerate(ran.handed):
        place = _place(kept, handed, at)
        if place is None and "power" in kinds(ran):
            return  # see `folder_is_read_up_to_its_tear`
        if place is None:
            yield f"what was handed back as number {number} is not recorded after sample {at}"
            return
        at = place + len(handed[0])
    held = {"low", "hold run"} & kinds(ran)
    if not held and ran.schedule.procedure != "swallows":
        for number, ((command, _), asked) in enumerate(zip(ran.handed, ran.asked, strict=False)):
            if len(command) != len(asked) or np.max(np.abs(command - asked)) > _STEP:
                yield f"command {number} was asked for, and another one is handed back"
                return


def _place(kept: list[Array], handed: tuple[Array, Array], at: int) -> int | None:
    """Where in a record it stands as a piece, not before `at`."""
    n = len(handed[0])
    for first in range(at, len(kept[0]) - n + 1):
        if all(np.array_equal(all_of[first : first + n], part, equal_nan=True)
               for all_of, part in zip(kept, handed, strict=True)):  # fmt: skip
            return first
    return None


def samples_are_in_time(world: World, ran: Ran) -> Iterator[str]:
    """With its delay, the stamp of a sample is the instant at which its device measured it."""
    recording = recording_of(world)
    if recording is None or any(fault.device == "io" or fault.kind in _CLOCKS | {"switch"} for fault, _ in ran.took):
        return
    measured = np.array(sorted(world.couplers["io"].measured))
    pairs = [np.round(recording.channels[name].values / 100.0 * FULL) for name in ("command", "flow")]
    at_s = recording.time_s + recording.channels["delay of io"].values
    waiting = iter(measured)
    met = [next((one[0] for one in waiting if (one[1:] == pair).all()), None) for pair in np.transpose(pairs)]
    if None in met or len(met) < RATE_HZ:
        return  # another law tells; of a few samples at rest nobody knows which they are
    at_s += float(np.median(np.array(met) - at_s))
    nearest = measured[np.argmin(np.abs(measured[:, :1] - at_s), axis=0)]
    off_s = np.where((nearest[:, 1:] == np.transpose(pairs)).all(axis=1), np.abs(nearest[:, 0] - at_s), np.inf)
    if np.max(off_s) > _IN_TIME_S:
        yield f"sample {int(np.argmax(off_s))} was not measured when it is said to be, but {np.max(off_s):.3f} s off"


def own_watchdogs_rest(world: World, ran: Ran) -> Iterator[str]:
    """While the run is there it keeps the watchdogs of its devices from expiring."""
    begun_s, end_s = drives_s(world)
    if kinds(ran) - CALM:
        return
    for name, device in world.devices.items():
        early = [at_s for at_s in device.expired_s if begun_s < at_s < end_s]
        if early:
            yield f"the watchdog of {name} expired at {early[0]:.3f} s, while it was driven"


def own_watchdogs_are_armed(world: World, ran: Ran) -> Iterator[str]:
    """While it is driven a device has its own watchdog, where the bench file says so."""
    begun_s, end_s = drives_s(world)
    if not ran.schedule.armed or kinds(ran) - CALM - {"slow", "sticks", "poke"}:
        return
    for name, device in world.devices.items():
        bare = [at_s for at_s in device.unwatched_s if begun_s < at_s < end_s]
        if bare and not (name == "third" and ran.schedule.third in ("source", "controller")):
            yield f"{name} was driven at {bare[0]:.3f} s, and its watchdog was not armed"


def claims_are_waited_for(world: World, ran: Ran) -> Iterator[str]:
    """Who has claimed an address on J1939 commands nothing before another one could have defended it."""
    if isinstance(world.third, Valve) and world.third.line.rushed_s:
        yield f"the valve was commanded at {world.third.line.rushed_s[0]:.3f} s, just after a claim"


def causes_happened(world: World, ran: Ran) -> Iterator[str]:
    """What is told as the cause of an end has happened."""
    status = world.run.status
    said = " ".join([text for _, by, text in ran.said if by == "run"] + [end_of(world).get("outcome", "")])
    for text, of in _CAUSES:
        if text in said and not of & kinds(ran):
            yield f"'{text}' is told, and nothing of {sorted(of)} happened: {said:.200}"
    if status in _SIGNALLED and _SIGNALLED[status] not in kinds(ran):
        yield f"exit status {status}, and nobody sent {_SIGNALLED[status]}"


def is_heard(world: World, ran: Ran) -> Iterator[str]:
    """Who is told to end, or trips, makes outputs safe soon, whatever else goes on."""
    begun_s, end_s = drives_s(world)
    blocks = ran.schedule.procedure == "blocks"
    for (fault, phase), at_s in zip(ran.took, ran.took_s, strict=True):
        if phase != "driving" or fault.kind not in _HEARD_S or fault.lasts_s < LEAST_S.get(fault.kind, 0.0):
            continue
        is_judged = fault.kind in LEAST_S  # when a block is over, which ends by the clock where a device is slow
        calm = CALM - ({"wd pause"} if fault.kind == "stop" else set()) | ({"slow"} if is_judged else set())
        others = [other for other, _ in ran.took if other.kind not in calm]  # a stop is heard by the watchdog
        if is_judged and (others or blocks or "low" in kinds(ran)):
            continue
        patience_s = _HEARD_S[fault.kind] + sum(other.lasts_s + 1.0 for other in others)
        patience_s += 70.0 / RAMP_PER_S if ran.schedule.ramped else 0.0
        if fault.kind == "stop" and blocks:
            continue
        if end_s > at_s + patience_s and begun_s < at_s:
            yield f"{fault.kind} came at {at_s:.3f} s, and it was driven until {end_s:.3f} s"


def is_no_restart(ran: Ran, fault: Fault) -> bool:
    """Whether nobody can tell it from a device that tells its state late."""
    on_plain_can = fault.device == "third" and ran.schedule.third == "driver"
    late_s = {"restart": TELLS_LATE_S, "deaf": TELLS_LATE_S + _FALLS_S}.get(fault.kind, 0.0)
    return on_plain_can and fault.lasts_s < late_s


def who_stays_is_left(world: World, ran: Ran) -> Iterator[str]:
    """A procedure that swallows the end and does not return keeps the process no longer than is said."""
    if ran.schedule.procedure != "stays" or not world.swallowed_s or kinds(ran) & {*_CLOCKS, *NO_DISK}:
        return
    if world.run.ended_s > world.swallowed_s + LEAVES_S + 0.5:
        yield f"the end was swallowed at {world.swallowed_s:.3f} s, and the run ended at {world.run.ended_s:.3f} s"


def restart_is_noticed(world: World, ran: Ran) -> Iterator[str]:
    """A device that restarts while it drives ends the run, also where it obeys again before anybody misses it."""
    _, end_s = drives_s(world)
    for (fault, phase), at_s in zip(ran.took, ran.took_s, strict=True):
        if fault.kind != "restart" or phase != "driving" or is_no_restart(ran, fault):
            continue
        others = [other for (other, _), at in zip(ran.took, ran.took_s, strict=True)
                  if other is not fault and other.kind not in CALM and at + other.lasts_s + 1.0 > at_s]  # fmt: skip
        patience_s = _NOTICED_S + fault.lasts_s + sum(other.lasts_s + 1.0 for other in others)
        for output in (name for name, device in world.outputs.items() if device == fault.device):
            stood = [percent for changed_s, percent in ran.changes[output] if changed_s < at_s][-1]
            if abs(stood) > NEAR and at_s + patience_s < end_s:
                yield f"{fault.device} restarted at {at_s:.3f} s, and it was driven until {end_s:.3f} s"


def faults_end_a_run(world: World, ran: Ran) -> Iterator[str]:
    """A device that reports a fault while it is driven ends the run, also where it holds its demand."""
    begun_s, end_s = drives_s(world)
    if kinds(ran) - CALM - {"fails"} or kinds(ran) & {"wd pause", "low", "hold run"}:
        return
    for (fault, phase), at_s in zip(ran.took, ran.took_s, strict=True):
        stood = [percent for changed_s, percent in ran.changes.get(PILOT, [(0.0, 0.0)]) if changed_s < at_s]
        is_long = fault.lasts_s > _NOTICED_S + ran.schedule.block_s
        if fault.kind != "fails" or phase != "driving" or not is_long or abs(stood[-1]) <= NEAR:
            continue
        if begun_s < at_s and at_s + _NOTICED_S + ran.schedule.block_s < end_s:
            yield f"third reports a fault from {at_s:.3f} s on, and it was driven until {end_s:.3f} s"


def contact_is_asked(world: World, ran: Ran) -> Iterator[str]:
    """Where a link fails while it drives, the contact of the emergency stop says whether somebody pressed."""
    begun_s, _ = drives_s(world)
    if not ran.errors or world.run.status != 3 or any(
        at_s < begun_s or fault.device not in ("io", "third") or fault.kind in ARRIVES_LATE
        for (fault, _), at_s in zip(ran.took, ran.took_s, strict=True)
    ):  # fmt: skip
        return
    kind, text = ran.errors[0]
    said = " ".join(text for _, by, text in ran.said if by == "run")
    if kind in (LinkError, DeviceLostError) and "emergency stop" not in said:
        yield f"a link failed, and nobody asked whether the emergency stop was pressed: {text:.200}"


def safe_comes_before_readings(world: World, ran: Ran) -> Iterator[str]:
    """A safe value waits for no reading that nobody has begun yet."""
    begun_s = world.begun_s.get("making safe")
    if begun_s is None or kinds(ran) - CALM - {"slow", "lies", "poke", "sticks", *NO_DISK}:
        return
    for name, device in world.couplers.items():
        safe_s = next((at_s for at_s in device.commanded_s if at_s > begun_s), 0.0)
        early = [at_s for at_s in device.asked_s if begun_s + _BEGUN_S < at_s < safe_s]
        if early:
            yield f"made safe from {begun_s:.3f} s on, and {name} was read at {early[0]:.3f} s before it was told"


def pauses_are_kept(world: World, ran: Ran) -> Iterator[str]:
    """A device that needs a pause after its answer is left alone for so long by one who has had the answer."""
    rushed = getattr(world.third, "rushed", ())
    if rushed and not kinds(ran) - CALM - {"poke"}:
        yield f"third was asked at {rushed[0]:.4f} s, in the pause after its answer"


def holds_are_events(world: World, ran: Ran) -> Iterator[str]:
    """A hold stands among the events, and no other; one that ended while it was driven with its end."""
    _, end_s = drives_s(world)
    recording = recording_of(world)
    if recording is None or kinds(ran) - CALM or ran.schedule.procedure == "blocks":
        return
    events = [(event["event"], event["details"].get("interlock", event["details"].get("by", "")))
              for event in recording.meta["events"]]  # fmt: skip
    for kind, by in (("low", "low-pressure"), ("hold run", "operator")):
        if kind not in kinds(ran) and ("hold", by) in events:
            yield f"nobody held the run, and events say that {by} did"
    if "low" in kinds(ran) and kinds(ran) & {"hold run", "over"}:
        return  # the other held it already, or ended the low pressure
    for (fault, phase), at_s in zip(ran.took, ran.took_s, strict=True):
        if phase != "driving" or fault.kind not in ("low", "hold run"):
            continue
        by, least_s = {"low": ("low-pressure", 0.5), "hold run": ("operator", _HOLDS_S)}[fault.kind]
        least_s += ran.schedule.block_s - BLOCK_S
        if fault.lasts_s < least_s or at_s + least_s > end_s:
            continue
        if by == "operator" and ran.schedule.procedure == "leaves early":
            continue  # it streams: what it plays ends later
        if ("hold", by) not in events:
            yield f"{fault.kind} at {at_s:.3f} s held the run, and no event says so: {events}"
        if by == "operator" and at_s + fault.lasts_s + 1.0 < end_s and ("resume", by) not in events:
            yield f"{fault.kind} at {at_s:.3f} s was over, and no event says so: {events}"


def witness_is_heard(world: World, ran: Ran) -> Iterator[str]:
    """An output whose valve sticks away from rest is not called safe by the run that drove it there."""
    begun_s = world.begun_s.get("making safe", float("inf"))
    word = next((one for one in ran.words if one.by == "run" and one.states), None)
    sticks = [(at_s, fault.lasts_s) for (fault, phase), at_s in zip(ran.took, ran.took_s, strict=True)
              if fault.kind == "sticks" and phase == "driving"]  # fmt: skip
    if word is None or not world.moved:
        return
    says_not = "NOT CONFIRMED" in word.text
    if says_not and not kinds(ran) - CALM:
        yield f"nothing sticks, and the run says: {word.text}"
    is_one = sum(fault.kind == "sticks" for fault, _ in ran.took) == 1  # a second one lets go where that one stands
    if not (sticks and is_one) or kinds(ran) - CALM - {"sticks"} or begun_s > word.at_s:
        return
    at_s, lasts_s = sticks[0]
    stuck = [percent for changed_s, percent in ran.changes["command"] if changed_s <= at_s][-1]
    is_away = abs(stuck) > 2.0 * NEAR and at_s < begun_s and word.at_s < at_s + lasts_s
    if is_away and word.states.get("command") == "safe":
        yield f"the valve sticks at {stuck:.1f} %, and the run says: {word.text}"
    if at_s + lasts_s + _LOOKS_S < begun_s and says_not:
        yield f"the valve sticks no more from {at_s + lasts_s:.3f} s on, and the run says: {word.text}"


LAWS = (
    begins_safe, errors_are_not_ours, connections_are_given_up, drives_what_is_asked, hands_back_what_is_recorded,
    samples_are_in_time, own_watchdogs_rest, causes_happened, is_heard, restart_is_noticed, pauses_are_kept,
    own_watchdogs_are_armed, claims_are_waited_for, safe_comes_before_readings, contact_is_asked, holds_are_events,
    witness_is_heard, is_driven, nobody_spins, who_stays_is_left, faults_end_a_run,
)  # fmt: skip
