"""ISO 10770-1 in one run: flow curve, steps, frequency response, threshold and fail-safe of a valve; a certificate.

Where the bench adjusts what they need, also pressure gain, internal leakage, flow over pressure drop, limiting power,
null shift and load step.

One rehearsal, one time, one page. A run that was broken off goes on with the test that it had not completed. All six
frequency responses are measured by few stepped sines, each for a short time; `multisine_response` is there by name.
What of the standard is in it, and what is not: docs/explanation/standard.md.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import ModuleType
from typing import Any, Literal

from hil.errors import SettingError
from hil.language.note import Note
from hil.record.measurement import Findings
from hil.record.recording import Recording
from hil.rig import ConditionRole, Rig
from hil.signals.stepped_sine import reference_and_band
from procedures import (
    fail_safe,
    flow_curve,
    flow_over_pressure_drop,
    frequency_response,
    internal_leakage,
    limiting_power,
    load_step,
    multisine_response,
    null_shift,
    pressure_gain,
    step_response,
    threshold,
)
from procedures._conditions import LOAD, OIL, SUPPLY, TANK
from procedures._sequence import SequencedTest, both_sides, drive, evaluated
from procedures._settings import NotNegative, Percent, Positive, PositivePercent

CERTIFICATE, RESUMABLE = True, True
_TESTS: Mapping[str, tuple[ModuleType, Note, tuple[str, ...]]] = {
    "flow_curve": (flow_curve, Note("flow curve"), ("cycle_s",)),
    "step_response": (step_response, Note("steps"), ("levels",)),
    "frequency_response": (
        frequency_response,
        Note("frequency response"),
        ("amplitudes", "biases", "frequencies", "measure_periods", "measure_s"),
    ),
    "multisine_response": (
        multisine_response,
        Note("frequency response by multisine"),
        ("amplitudes", "biases", "high_hz"),
    ),
    "threshold": (threshold, Note("threshold"), ("biases",)),
    "fail_safe": (fail_safe, Note("fail-safe"), ()),
    "pressure_gain": (pressure_gain, Note("pressure gain"), ()),
    "internal_leakage": (internal_leakage, Note("internal leakage"), ()),
    "flow_over_pressure_drop": (flow_over_pressure_drop, Note("flow over pressure drop"), ()),
    "limiting_power": (limiting_power, Note("limiting power"), ()),
    "null_shift": (null_shift, Note("null shift"), ()),
    "load_step": (load_step, Note("load step"), ()),
}
_ADJUSTING: Mapping[str, frozenset[ConditionRole]] = {
    "pressure_gain": frozenset({LOAD}),
    "internal_leakage": frozenset({LOAD}),
    "flow_over_pressure_drop": frozenset({SUPPLY}),
    "limiting_power": frozenset({SUPPLY}),
    "null_shift": frozenset({SUPPLY, TANK, OIL}),
    "load_step": frozenset({LOAD}),
}
_BY_NAME = frozenset({"multisine_response"})  # only where somebody asks for it
MEASUREMENTS = tuple({one.name: one for test, _, _ in _TESTS.values() for one in test.MEASUREMENTS}.values())

_TOP_HZ, _SAMPLES = 4.9, 20.0  # of the HPV41 paper; the least samples of a period of the top frequency
_SHORT: Mapping[str, Any] = {"measure_periods": 2, "measure_s": 2.0}  # six responses in five minutes

_Name = Literal[
    "flow_curve",
    "step_response",
    "frequency_response",
    "multisine_response",
    "threshold",
    "fail_safe",
    "pressure_gain",
    "internal_leakage",
    "flow_over_pressure_drop",
    "limiting_power",
    "null_shift",
    "load_step",
]


def run(
    rig: Rig,
    *,
    tests: tuple[_Name, ...] | None = None,
    steps: tuple[PositivePercent, ...] = (5.0, 25.0, 90.0),
    amplitudes: tuple[PositivePercent, ...] = (5.0, 10.0, 20.0),
    biases: tuple[Percent, ...] | None = None,
    high_hz: Positive | None = None,
    cycle_s: Positive = 60.0,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Drive the tests, in the order that they are named.

    Args:
        rig: the bench.
        tests: which of them, each once; when not given all but the multisine of which the bench adjusts what they need.
        steps: sizes of the steps from neutral and back, in % of full command; to both sides where it has two.
        amplitudes: of the sines, or peaks of the multisines, in % of full command.
        biases: about which sines swing and thresholds are sought, in % of full command from neutral. When not
            given: the bench's operating point, else ±50, or the middle of a one-way command.
        high_hz: highest frequency of the responses, in Hz; 4.9, or a twentieth of a lower sample rate, when not given.
        cycle_s: time of one sweep of the flow curve up and down, in s.
        warm_up_s: time at the first level of the first test before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    if tests is not None and len(set(tests)) != max(len(tests), 1):
        raise SettingError(f"setting tests: {', '.join(tests) or 'none'}; at least one is needed, and each once")
    rate_hz = rig.actual_rate_hz(rate_hz)
    top_hz = high_hz or min(_TOP_HZ, rate_hz / _SAMPLES)
    asked = {
        "tests": _named(tests, rig.adjustable), "amplitudes": amplitudes, "biases": biases,
        "high_hz": top_hz, "frequencies": reference_and_band(top_hz), **_SHORT,
        "cycle_s": cycle_s, "warm_up_s": warm_up_s, "full_command": full_command, "rate_hz": rate_hz,
        "levels": both_sides(rig, "steps", steps, full_command),
    }  # fmt: skip
    drive(rig, _asked(asked))


def evaluate(recording: Recording) -> Findings:
    """Findings of all tests together; what was not done is said, and what has a limit there cannot be told."""
    settings = recording.meta["settings"]
    driven = {part.get("test") for part in recording.meta.get("parts", ())}
    tests = _named(settings["tests"], recording.meta.get("roles", {}), driven)
    return evaluated(recording, _asked({**settings, **_SHORT, "tests": tests, "levels": (), "frequencies": ()}))


def _named(tests: Sequence[str] | None, roles: Collection[str], driven: Collection[str | None] = ()) -> list[str]:
    """The tests that are asked for; all that a bench with these roles can do when nobody has said.

    `driven`: those that were; runs of earlier versions have multisines that nobody named, in place of sines.
    """
    if tests is not None:
        return [*tests]
    left_out = {"frequency_response"} if _BY_NAME & set(driven) else _BY_NAME
    return [name for name in _TESTS if name not in left_out and _ADJUSTING.get(name, frozenset()) <= set(roles)]


def _asked(settings: Mapping[str, Any]) -> list[SequencedTest]:
    """The tests with what is asked of each; the first one warms up."""
    found: list[SequencedTest] = []
    for name in settings["tests"]:
        procedure, title, takes = _TESTS[name]
        warm_up = ("warm_up_s",) if not found else ()
        given = {one: settings[one] for one in ("full_command", "rate_hz", *warm_up, *takes)}
        found.append(SequencedTest(procedure, title, given))
    return found
