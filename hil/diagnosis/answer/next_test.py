"""The next experiment: which test of a safe menu would best tell apart what these data cannot.

Every test of the menu is simulated under the explanations that are left. The difference of their outputs, as far as
the base parameters cannot imitate it, in units of the noise, says how well the test separates them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hil.diagnosis.diagnosis import DiagnosisVerdict, NextTest
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted, nothing, output_of
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import TINY
from hil.diagnosis.verdict.choice import OPEN, Choice
from hil.identification.grey_box.estimate import jacobian
from hil.identification.preparation.experiment import Experiment
from hil.identification.uncertainty.noise import whiten
from hil.language.note import Note
from hil.physics.simulate import Drive
from hil.record.recording import Array
from hil.signals.ramps import triangle
from hil.signals.steps import step_sequence

# Two explanations are separable when their outputs differ by so many standard uncertainties.
_SEPARATED = 10.0
_ENOUGH = 30.0
_COMPETITORS = 3
# A test keeps this share of the way to a limit of the bench away from it; a part that integrates may go this share of
# its travel beyond what was recorded.
_MARGIN = 0.1
# The menu's tests last seconds: a plant that is sampled slower than this has no use for them.
_SLOWEST_SAMPLING_S = 0.2


@dataclass(frozen=True, slots=True)
class MenuTest:
    """A test of the menu: a procedure with settings, and the command that it drives, as shares of full command."""

    procedure: str
    settings: Mapping[str, Any]
    shape: Callable[[float], Array]


@dataclass(frozen=True, slots=True)
class Span:
    """How far the command may go: `full` is 100 %, counted from `neutral`."""

    neutral: float
    full: float
    low: float
    high: float


def span_of(problem: Problem) -> Span:
    """The range that the recordings have used; nothing is known of what else the bench allows."""
    commands = np.concatenate([e.on_grid_input() for e in problem.experiments])
    low, high = float(commands.min()), float(commands.max())
    signal = problem.plant.inputs[0]
    full = signal.full_scale if signal.unit != "any" and low < 0.0 < high else max(abs(low), abs(high), TINY)
    return Span(0.0, full, low, high)


def span_within(low: float, high: float, neutral: float) -> Span:
    """A span that keeps a tenth away from the limits of a bench; neutral may be at one of them."""
    full = max(high - neutral, neutral - low)
    return Span(
        neutral, full, neutral - (1.0 - _MARGIN) * (neutral - low), neutral + (1.0 - _MARGIN) * (high - neutral)
    )  # fmt: skip


def menu(span: Span) -> tuple[MenuTest, ...]:
    """Tests that stay within the span, levels in % of full command."""
    low, high = (100.0 * (end - span.neutral) / span.full for end in (span.low, span.high))
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    inner = tuple(round(low + share * (high - low), 3) for share in (0.5, 0.65, 0.35, 0.8, 0.2, 0.95, 0.05, 0.5))
    found = [_steps((low, high), 3.0), _steps(inner, 2.0)]
    found += [_sines((f,), middle, half, cycles) for f, cycles in ((0.1, 2), (0.5, 5), (1.5, 10))]
    found += [_sweep(low, high, 20.0), _sweep(low, high, 60.0)]
    return tuple(found)


def _steps(levels: tuple[float, ...], hold_s: float) -> MenuTest:
    shape = partial(step_sequence, [v / 100.0 for v in levels], hold_s)
    return MenuTest("step_response", {"levels": levels, "hold_s": hold_s}, shape)


def _sines(frequencies: tuple[float, ...], middle: float, half: float, cycles: int) -> MenuTest:
    def shape(rate_hz: float) -> Array:
        time_s = np.arange(round(cycles / frequencies[0] * rate_hz)) / rate_hz
        return (middle + half * np.sin(2.0 * np.pi * frequencies[0] * time_s)) / 100.0

    settings = {"frequencies": frequencies, "amplitude": round(half, 3), "bias": round(middle, 3), "cycles": cycles}
    return MenuTest("large_sine", settings, shape)


def _sweep(low: float, high: float, cycle_s: float) -> MenuTest:
    settings = {"low": round(low, 3), "high": round(high, 3), "cycle_s": cycle_s, "half_speed": False}
    shape = partial(triangle, low / 100.0, high / 100.0, cycle_s, start=low / 100.0)
    return MenuTest("flow_curve", settings, shape)


def next_test(
    problem: Problem,
    verdict: DiagnosisVerdict,
    choice: Choice,
    rivals: Sequence[Sequence[str]],
    unseen: Sequence[str],
    span: Span | None = None,
) -> NextTest | None:
    """The test that tells most for its time; None when there is nothing left to tell, or no test for such a plant.

    `span`: how far the command may go, if that is known.
    """
    if problem.intervals_s[0] > _SLOWEST_SAMPLING_S:
        return None
    span = span or span_of(problem)
    tests = [test for test in menu(span) if _stays(problem, _planned(problem, test, span))]
    if not tests:
        return None
    if verdict == "consistent":
        return _revealing(problem, choice, tests, span, unseen) if unseen else None
    competitors = _competitors(choice, rivals, verdict)
    if len(competitors) < 2:
        return _revealing(problem, choice, tests, span, unseen) if unseen else None
    scored = [(_separation(problem, test, span, competitors), test) for test in tests]
    best = max(scored, key=lambda pair: min(pair[0], _ENOUGH) / math.sqrt(_bench_s(problem, pair[1])))
    if best[0] < _SEPARATED:
        return None
    one, other = map(_label, competitors[:2])
    why = Note(
        "tells {one} from {other}: their outputs would differ by {distance:.0f} standard uncertainties that base "
        "parameters cannot imitate",
        one=one, other=other, distance=best[0],
    )  # fmt: skip
    return _chosen(problem, best[1], span, why)


def _stays(problem: Problem, planned: Experiment) -> bool:
    """Whether a plant that integrates stays where it has been: nobody knows what comes beyond."""
    if not any(slope is not None for slope in problem.start_slopes):
        return True
    rows = planned.respond(problem.plant, problem.model.values, problem.model.active_effects, factor=problem.factor)
    low = min(float(e.output.min()) for e in problem.experiments)
    high = max(float(e.output.max()) for e in problem.experiments)
    margin = _MARGIN * (high - low)
    return bool(rows[0].min() >= low - margin and rows[0].max() <= high + margin)


def _competitors(choice: Choice, rivals: Sequence[Sequence[str]], verdict: DiagnosisVerdict) -> list[Fitted]:
    """The chosen explanation and those to separate from it: rivals, or the next best when none is adequate."""
    names = {name for pair in rivals for name in pair} - set(choice.chosen.names)
    found = [choice.chosen] if choice.chosen.terms else []
    seen = set(_names(choice.chosen))
    for f in choice.candidates:
        wanted = bool(names & set(f.names)) if rivals else verdict in OPEN
        if wanted and not seen & set(_names(f)):
            seen |= set(_names(f))
            found.append(f)
    return found[:_COMPETITORS]


def _names(f: Fitted) -> tuple[str, ...]:
    return f.names or tuple(t.name for t in f.terms)


def _label(f: Fitted) -> Note:
    first, *others = (Note(name.replace("_", " ")) for name in _names(f))
    for other in others:
        first = Note("{first} + {other}", first=first, other=other)
    return first


def _revealing(
    problem: Problem, choice: Choice, tests: Sequence[MenuTest], span: Span, unseen: Sequence[str]
) -> NextTest | None:
    """The test in which most of the effects would show that these data cannot show, at their typical size."""
    terms = [t for t in choice.terms if t.kind == "effect" and t.reported_name in unseen]
    counted = [(_visible(problem, test, span, terms), test) for test in tests]
    best = max(counted, key=lambda pair: (len(pair[0]), -_bench_s(problem, pair[1])))
    if not best[0]:
        return None
    names = tuple(Note(name.replace("_", " ")) for name in sorted(best[0]))
    return _chosen(problem, best[1], span, Note("would show what these recordings cannot: {names}", names=names))


def _visible(problem: Problem, test: MenuTest, span: Span, terms: Sequence[Term]) -> set[str]:
    planned = _planned(problem, test, span)
    plain = _simulated(problem, planned, nothing(problem))
    slopes = _base_slopes(problem, planned, plain)
    found = set()
    for term in terms:
        values = tuple(u.start for u in term.unknowns)
        f = Fitted((term,), (values,), dict(problem.model.values), 0.0, plain)
        if _apart(_simulated(problem, planned, f) - plain, slopes) > _SEPARATED:
            found.add(term.reported_name)
    return found


def _separation(problem: Problem, test: MenuTest, span: Span, competitors: Sequence[Fitted]) -> float:
    """The least distance between any two explanations."""
    planned = _planned(problem, test, span)
    outputs = [_simulated(problem, planned, f) for f in competitors]
    slopes = _base_slopes(problem, planned, outputs[0])
    pairs = [(a, b) for i, a in enumerate(outputs) for b in outputs[i + 1 :]]
    return min(_apart(a - b, slopes) for a, b in pairs)


def _apart(difference: Array, slopes: Array) -> float:
    """Size of a difference after the base parameters have imitated as much of it as they can, within their prior."""
    moves = np.linalg.lstsq(slopes, np.concatenate([difference, np.zeros(slopes.shape[1])]), rcond=None)[0]
    return float(np.linalg.norm(difference - slopes[: len(difference)] @ moves))


def _base_slopes(problem: Problem, planned: Experiment, plain: Array) -> Array:
    """Whitened slopes in the base parameters, the prior's under them, shape (n + k, k)."""
    names = [p.name for p in problem.base]

    def moved(at: Array) -> Array:
        parameters = problem.model.values | dict(zip(names, at.tolist(), strict=True))
        return _simulated(problem, planned, Fitted((), (), parameters, 0.0, plain))

    slopes = jacobian(moved, problem.base, np.array([problem.model.values[name] for name in names]), plain)
    return np.vstack([slopes, problem.prior.root(range(len(names)))])


def _simulated(problem: Problem, planned: Experiment, f: Fitted) -> Array:
    return whiten(output_of(problem, f, planned), problem.noises[0], planned.drive.interval_s)


def _planned(problem: Problem, test: MenuTest, span: Span) -> Experiment:
    like, interval_s = problem.experiments[0], problem.intervals_s[0]
    wave = span.neutral + span.full * test.shape(1.0 / interval_s)
    inputs = np.vstack([wave, *(np.full(len(wave), float(np.median(row))) for row in like.drive.inputs[1:])])
    drive = Drive(inputs, float(like.output[0]), interval_s, like.drive.read_at)
    time_s = interval_s * np.arange(len(wave), dtype=np.float64)
    return Experiment(like.name, like.input, like.output_heading, time_s, drive, None, np.zeros(len(wave)), {})


def _bench_s(problem: Problem, test: MenuTest) -> float:
    interval_s = problem.intervals_s[0]
    return len(test.shape(1.0 / interval_s)) * interval_s


def _chosen(problem: Problem, test: MenuTest, span: Span, why: Note) -> NextTest:
    full = float(f"{span.full:.4g}")  # as it was asked for: what was recorded has passed a converter
    settings = {**test.settings, "full_command": full}
    return NextTest(test.procedure, settings, why, round(_bench_s(problem, test), 1))
