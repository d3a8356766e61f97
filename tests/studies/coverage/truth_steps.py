"""What steps must find: the response without noise, read by the written definitions."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import numpy as np

from hil.record.recording import Array, Recording
from tests.studies.coverage.situations import Situation
from tests.studies.coverage.truth_static import Truths

_TAIL, _REST = 0.15, 0.25


def read_step(time_s: Array, response: Array, before: Array, band: float) -> Truths:
    """Figures of one step: times in ms from the command's jump at 0, overshoot in % of the change."""
    start = float(np.mean(before[-max(1, round(_REST * len(before))) :]))
    final = float(np.mean(response[-max(1, round(_TAIL * len(response))) :]))
    share = (response - start) / (final - start)

    def until(level: float) -> float:
        i = int(np.argmax(share >= level))
        part = (level - share[i - 1]) / (share[i] - share[i - 1])
        return 1e3 * float(time_s[i - 1] + part * (time_s[i] - time_s[i - 1]))

    outside = int(np.flatnonzero(np.abs(share - 1.0) > band)[-1])
    edge = 1.0 + np.copysign(band, share[outside] - 1.0)
    part = (edge - share[outside]) / (share[outside + 1] - share[outside])
    return {
        "onset": until(0.02), "rise": until(0.9) - until(0.1), "response": until(0.9),
        "settling": 1e3 * float(time_s[outside] + part * (time_s[outside + 1] - time_s[outside])),
        "band_entry": until(1.0 - band), "overshoot": 100.0 * max(float(share.max()) - 1.0, 0.0),
        "change": final - start, "final": final,
    }  # fmt: skip


def of_step_response(clean: Recording, _bench: str, _situation: Situation) -> Truths:
    """Every step of the sequence."""
    roles = clean.meta["roles"]
    response, unit = clean.values(roles["response"]), clean.channel(roles["command"]).unit
    band = float(clean.meta["settings"]["band"]) / 100.0
    found: Truths = {}
    parts = [part for part in clean.meta["parts"] if part["kind"] == "level"]
    for before, after in pairwise(parts):
        rows = slice(after["first"], after["first"] + after["count"])
        rest = response[before["first"] : before["first"] + before["count"]]
        figures = read_step(clean.time_s[rows] - clean.time_s[rows.start], response[rows], rest, band)
        figures.pop("final")
        label = f"{after['from']:.4g} → {after['to']:.4g} {unit}"
        found |= {f"{name}, {label}": value for name, value in figures.items()}
    return found


def of_fail_safe(clean: Recording, _bench: str, _situation: Situation) -> Truths:
    """The step to neutral from every level, and where it ends beside neutral; the mean over the repeats."""
    response = clean.values(clean.meta["roles"]["response"])
    band = float(clean.meta["settings"]["band"]) / 100.0
    (rest,) = [part for part in clean.meta["parts"] if part["kind"] == "neutral"]
    neutral = float(response[rest["first"] + rest["count"] // 2 : rest["first"] + rest["count"]].mean())
    found = defaultdict(list)
    for part in (part for part in clean.meta["parts"] if part["kind"] == "fail-safe"):
        lost, stop = part["first"] + part["held"], part["first"] + part["count"]
        step = read_step(
            clean.time_s[lost:stop] - clean.time_s[lost], response[lost:stop], response[part["first"] : lost], band
        )
        found[f"closing_time, {part['label']}"].append(step["settling"])
        found[f"left_open, {part['label']}"].append(float(response[(lost + stop) // 2 : stop].mean()) - neutral)
    return {name: float(np.mean(values)) for name, values in found.items()}


def of_efc_steps(clean: Recording, _bench: str, _situation: Situation) -> Truths:
    """The step up of every part, the mean over the repeats."""
    roles = clean.meta["roles"]
    found = defaultdict(list)
    for part in clean.meta["parts"]:
        if part["kind"] != "efc-step":
            continue
        rows = slice(part["first"], part["first"] + part["count"])
        command, response = clean.values(roles["command"])[rows], clean.values(roles["response"])[rows]
        first, stop = (int(np.argmax(sign * np.diff(command) > 0.0)) + 1 for sign in (1.0, -1.0))
        time_s = clean.time_s[rows][first:stop] - clean.time_s[rows][first]
        figures = read_step(time_s, response[first:stop], response[:first], 0.05)
        for name in ("final", "rise", "onset", "settling", "overshoot"):
            quantity = "step_pressure" if name == "final" else name
            found[f"{quantity}, {part['current']:g} A"].append(figures[name])
    return {name: float(np.mean(np.asarray(values, dtype=np.float64))) for name, values in found.items()}
