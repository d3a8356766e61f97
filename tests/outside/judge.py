"""What stood at the device against every word that was said of it: data, sentence, and exit status."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from tests.outside.coupler import LAG_S, NEAR, Coupler
from tests.outside.running import Program

LATE_S = 0.15  # between a word and its stamp, on a computer that does other things besides
RISE_MS = 1000.0 * LAG_S * math.log(9.0)
TRUTHS = {"rise, 0 → 50 %": RISE_MS, "rise, 50 → 0 %": RISE_MS, "change, 0 → 50 %": 50.0, "change, 50 → 0 %": -50.0}
MOST_STD = 4.0
STATUSES = {0, 1, 2, 3, 129, 130, 131, 138, 143}
SAID_SAFE = ("outputs are safe (read back", "outputs made safe", "outputs are made safe")
SAID_NOT = ("NOT SAFE", "nobody knows", "not confirmed", "unconfirmed", "emergency stop")


@dataclass
class Seen:
    """One row: what was done, what stood at the device, and what was said of it.

    Attributes:
        ended_s: when the process was gone; time of day, as all here.
        away_s: when the output was away from its safe value last, after what was done.
        why: its watchdog process acted, in watchdog.json: of a terminal that is stopped nobody reads it.
        wrong: every contradiction.
        not_run: why there is nothing to judge.
        is_ours: it is a command of ours; a script of somebody else has tracebacks and an exit status of its own.
    """

    name: str
    is_ours: bool = True
    status: int | None = None
    begun_s: float = 0.0
    ended_s: float = 0.0
    away_s: float | None = None
    stands: float = 0.0
    said: str = ""
    why: str = ""
    words: dict[str, Any] = field(default_factory=dict)
    killed: set[str] = field(default_factory=set)
    wrong: list[str] = field(default_factory=list)
    not_run: str = ""


def judged(seen: Seen, coupler: Coupler, program: Program, measures: bool = False) -> Seen:
    """The row with its contradictions; `measures`: figures of its steps among them."""
    seen.status, seen.said, seen.stands = program.process.poll(), program.said, coupler.percent
    seen.away_s = coupler.away_s(seen.begun_s)
    files = {name: program.told(name) for name in ("end.json", "watchdog.json")}
    words = {name: told for name, told in {**files, "--json": program.printed}.items() if told is not None}
    seen.words = {name: told.get("outputs") for name, told in words.items()}
    seen.why = str((files["watchdog.json"] or {}).get("why", ""))
    seen.wrong += [*_data(seen, program), *_sentence(seen), *_status(seen)]
    seen.wrong += _figures(program.printed or {}) if measures and seen.status == 0 else []
    return seen


def _data(seen: Seen, program: Program) -> Iterator[str]:
    for source, outputs in seen.words.items():
        if not isinstance(outputs, Mapping):
            if source != "--json" or seen.status not in (2, None):
                yield f"{source} has no outputs"
            continue
        yield from _outputs(source, outputs, seen)
    for answered_s, answer in program.answers:
        yield from _outputs("the answer to the stop", answer.get("outputs") or {}, seen)
        if answer.get("state") == "confirmed" and (late := _away_after(seen, answered_s)):
            yield f"a stop was called confirmed, and the output was away {late:.2f} s later"
    ours, printed = seen.words.get("end.json"), seen.words.get("--json")
    if ours is not None and printed is not None and _states(ours) != _states(printed):
        yield f"end.json says {_states(ours)}, --json says {_states(printed)}"


def _outputs(source: str, outputs: Mapping[str, Any], seen: Seen) -> Iterator[str]:
    for name, output in outputs.items():
        state = output.get("state")
        if state not in ("safe", "unconfirmed", "driven", "unknown") or "read_back" not in output:
            yield f"{source}: '{name}' has no word of its own: {output}"
            continue
        at_s = datetime.fromisoformat(output["at_utc"]).timestamp() if output.get("at_utc") else seen.ended_s
        if state == "safe" and (late := _away_after(seen, at_s)):
            yield f"{source} calls '{name}' safe, and it was away {late:.2f} s later"


def _figures(printed: Mapping[str, Any]) -> list[str]:
    """Figures that are given, and whose interval does not hold what the device did."""
    wrong = []
    for value in printed.get("values", []):
        truth = TRUTHS.get(str(value["name"]))
        if truth is not None and value["value"] is not None and abs(value["value"] - truth) > MOST_STD * value["std"]:
            wrong.append(
                f"{value['name']} = {value['value']:.4g} ± {value['std']:.2g} {value['unit']}, and is {truth:.4g}"
            )
    return wrong


def _sentence(seen: Seen) -> Iterator[str]:
    if "Traceback" in seen.said and seen.is_ours:
        yield "a traceback"
    of_the_run = seen.said.partition("watchdog process")[0]
    if SAID_SAFE[0] in of_the_run and (late := _away_after(seen, seen.ended_s)):
        yield f"said read back safe, and was away {late:.2f} s after the run had ended"
    stands_away = abs(seen.stands) > NEAR
    if stands_away and any(text in seen.said for text in SAID_SAFE):
        yield f"said safe, and stands at {seen.stands:.0f} %"
    if stands_away and not any(text in seen.said for text in SAID_NOT) and seen.killed != {"run", "watchdog"}:
        yield f"stands at {seen.stands:.0f} %, and nobody says so"
    states = set(_states(seen.words.get("end.json") or {}).values())
    if states == {"safe"} and "NOT SAFE" in of_the_run and not seen.words.get("watchdog.json"):
        yield "the record says safe, the sentence NOT SAFE"
    if states - {"safe"} and SAID_SAFE[0] in of_the_run:
        yield f"the record says {sorted(states)}, the sentence safe"


def _status(seen: Seen) -> Iterator[str]:
    if seen.status is None:
        yield "it does not end"
    if seen.status is None or not seen.is_ours:
        return
    was_killed = seen.status == -9 and (
        "run" in seen.killed or "was killed" in seen.said + seen.why
    )  # by its watchdog process
    if seen.status not in STATUSES and not was_killed:
        yield f"exit status {seen.status}"
    if seen.status >= 0 and seen.status != 3:
        if late := _away_after(seen, seen.ended_s):
            yield f"exit status {seen.status}, and the output was away {late:.2f} s later"
        states = set(_states(seen.words.get("end.json") or {}).values())
        if states - {"safe"}:
            yield f"exit status {seen.status}, and the record says {sorted(states)}"


def _away_after(seen: Seen, at_s: float) -> float | None:
    """How long after a moment the output was still or again away; None where it was not."""
    late_s = 0.0 if seen.away_s is None else seen.away_s - at_s
    return late_s if late_s > LATE_S else None


def _states(outputs: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(output.get("state")) for name, output in outputs.items() if isinstance(output, Mapping)}
