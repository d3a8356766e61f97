"""What a limit would have caught: for each, the least fault of this unit that would have failed it.

The unit's own model is driven as the run was, with one fault at a time, and evaluated as the run was. Least sizes are
sought without noise, beside the scatter of healthy repeats; those that are shown are confirmed by repeats with noise.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from heapq import heapify, heappop, heappush
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from hil.arrays import ROUNDING
from hil.cores import parallel_map
from hil.errors import InputError
from hil.language.note import Note
from hil.language.words import _
from hil.passport.certificate import name_words
from hil.passport.unit import UnitRun
from hil.physics.model import Model
from hil.physics.simulate import ActiveEffect
from hil.record.durable import write_whole
from hil.record.invalid_samples import with_blanks
from hil.record.measurement import Limit, Measured
from hil.record.plain import to_json
from hil.record.recording import Array, Recording, split_heading
from hil.record.run_folder.progress import Progress
from hil.report.number import number, with_unit
from hil.session.procedure import Procedure
from hil.session.results import evaluated
from hil.signals.autoregression import coloured
from hil.units import convert
from hil.version import PROGRAM

if TYPE_CHECKING:
    from hil.diagnosis.intake.problem import Problem
    from hil.diagnosis.search.terms import Term

REPEATS = 40
"""Runs with noise: of the healthy unit, and of each fault that is shown."""
_SHARE = 0.95  # of them must fail, or pass for the healthy unit
_SHOWN = 2  # of each limit, the most harmless first
# Shares of an effect's typical size, and of a doubling or halving of a parameter, between which a least size is sought.
_SHARES = tuple(2.0**k for k in range(-8, 5, 2))
_HALVINGS = 4  # of the logarithm between two of them: to 9 %
_LARGER, _TRIES = 1.2, 4  # a size that fails more rarely than sought is made so much larger, so often
_BATCH = 8  # repeats, before it is asked whether more are of use
# Of a transfer function only this value depends on the form. Where it has no limit the simplest is fitted: to choose
# one takes longer than all else that is evaluated.
_OF_FORM, _SIMPLEST = "model_fit", {"poles": 1, "zeros": 0, "dead_time": False}

Values = Mapping[str, Measured]


@dataclass(frozen=True, slots=True)
class LeastFault:
    """A fault of the least size with which a limit is missed.

    Attributes:
        limit: name of the measured value. `name`: of effect or parameter, `stage` where it sits.
        parameter: what is stated of it, `size` in `unit`; `nominal`: without the fault; `shape`: its other values.
        disturbance: by how much the response changes over the run, rms in its own unit.
        failed: of so many `repeats`.
    """

    limit: str
    name: str
    stage: str
    parameter: str
    size: float
    nominal: float
    unit: str
    shape: Mapping[str, tuple[float, str]]
    disturbance: float
    failed: int
    repeats: int


@dataclass(frozen=True, slots=True)
class Power:
    """What the limits of a run would have caught.

    Attributes:
        run: its name. `faults`: the most harmless of each limit.
        unbroken: limits that no fault of the library breaks.
        unproven: limits that the healthy unit itself does not pass in 95 %, or whose verdict no model can repeat.
        tried: names of everything that was tried.
    """

    run: str
    faults: tuple[LeastFault, ...]
    unbroken: tuple[str, ...]
    unproven: tuple[str, ...]
    tried: tuple[str, ...]


def power_of(run: UnitRun, model: Model, progress: Progress, kept: Path | None = None) -> Power:
    """The least faults of a run's limits.

    Args:
        run: of the unit, judged.
        model: of this unit.
        progress: called with how far it is.
        kept: file in which what was found is kept, so that it can go on after a stop; taken away at the end.

    Raises:
        InputError: the run has no limits, or does not belong to the model.
    """
    limits = tuple(m.name for m in run.findings.measured if m.verdict is not None)
    if not limits:
        raise InputError(f"{run.results.run}: no limit was given")
    judge = _Judge(run.procedure, run.limits)
    state, pieces = _State.of(kept, run, model, judge), tuple(_pieces(run, judge, limits))
    faults: list[LeastFault] = []
    proven, tried = set[str](), dict[str, None]()
    for n, (piece, names) in enumerate(pieces):
        try:
            world = _World.of(piece, model, judge, state, str(n))
        except InputError:
            if len(pieces) == 1:
                raise
            continue  # a test in which nothing moves tells no fault
        found = _Search(world, names, _within(progress, n, len(pieces))).faults()
        faults += found.faults
        proven |= found.proven
        tried |= dict.fromkeys(term.label for term in world.terms if _ends(term))
    state.close()
    caught = {fault.limit for fault in faults}
    order = {name: n for n, name in enumerate(limits)}
    return Power(
        run.results.run, tuple(sorted(faults, key=lambda fault: order[fault.limit])),
        tuple(name for name in limits if name in proven - caught),
        tuple(name for name in limits if name not in proven), tuple(tried),
    )  # fmt: skip


def _within(progress: Progress, place: int, of: int) -> Progress:
    """Told how far one of several pieces is."""
    return lambda done, text: progress((place + done) / of, text)


@dataclass(frozen=True, slots=True)
class _Judge:
    """What evaluates a run and judges it."""

    procedure: Procedure
    limits: Mapping[str, Limit]

    def values(self, recording: Recording) -> Values:
        """What is found in a recording, by name; nothing where it cannot be evaluated."""
        if not any(name.partition(",")[0] == _OF_FORM for name in self.limits):
            settings = {**recording.meta.get("settings", {}), **_SIMPLEST}
            recording = replace(recording, meta={**recording.meta, "settings": settings})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # at a fault's largest size no valve may be left
            try:
                return {m.name: m for m in evaluated(self.procedure, recording, self.limits).measured}
            except InputError:
                return {}


def _pieces(run: UnitRun, judge: _Judge, limits: Sequence[str]) -> Iterator[tuple[Recording, Sequence[str]]]:
    """Each test of a sequence, with the limits whose values it alone decides; a run of one test is one piece.

    A test is a small part of a long run: a fault's size is then sought in seconds of samples, not in all of them.
    """
    parts, left = run.recording.meta.get("parts", ()), list(limits)
    whole = {m.name: m.value for m in run.findings.measured}
    tests = dict.fromkeys(part["test"] for part in parts if "test" in part)
    if not tests:
        yield run.recording, limits
        return
    first = 0
    for test in tests:
        end = max(part["first"] + part["count"] for part in parts if part.get("test") == test)
        piece, first = run.recording.rows(first, end - first), end
        found = judge.values(piece)
        names = [name for name in left if name in found and _is_same(found[name].value, whole[name])]
        if names:
            yield piece, names
        left = [name for name in left if name not in names]


def _is_same(one: float | None, other: float | None) -> bool:
    return one is not None and other is not None and math.isclose(one, other, rel_tol=ROUNDING)


_Fault: TypeAlias = "tuple[Term, tuple[float, ...]]"


@dataclass(frozen=True, slots=True)
class _Growing:
    """A fault that grows from nothing, in shares of one of the starts of its term."""

    term: Term
    start: tuple[float, ...]

    def key(self, share: float) -> str:
        """Unlike that of any other."""
        return f"{self.term.name} {self.term.hook} {self.start} {share!r}"

    def at(self, share: float) -> _Fault:
        """The fault of this size, as far as it may go."""
        if self.term.kind == "effect":
            return self.term, self.term.scaled(self.start, share)
        u, nominal = self.term.unknowns[0], self.term.nominal
        return self.term, (float(np.clip(nominal + share * (self.start[0] - nominal), u.low, u.high)),)


@dataclass(slots=True)
class _World:
    """A run as it would have been: driven as it was, with the model in the place of the unit.

    `name`: of this world in what is kept. `last`: what was simulated last, and of which fault.
    """

    recording: Recording
    problem: Problem
    judge: _Judge
    terms: tuple[Term, ...]
    nominal: Array
    state: _State
    name: str
    last: tuple[_Fault | None, Array]

    @classmethod
    def of(cls, recording: Recording, model: Model, judge: _Judge, state: _State, name: str) -> _World:
        from hil.diagnosis.intake.problem import pose
        from hil.diagnosis.search.terms import all_terms
        from hil.identification.preparation.experiment import for_model

        problem = pose(model, [for_model(model, with_blanks(recording))])
        rows = problem.experiments[0].simulated(model)
        terms = all_terms(problem, problem.nominal_residuals)
        return cls(recording, problem, judge, terms, rows, state, name, (None, rows))

    def rows(self, fault: _Fault | None) -> Array:
        """Output and inner signals, shape (1 + observed, n)."""
        if fault != self.last[0]:
            parameters = dict(self.problem.model.values)
            effects = list[ActiveEffect](self.problem.model.active_effects)
            if fault is not None:
                fault[0].apply(fault[1], parameters, effects)
            with np.errstate(all="ignore"):
                self.last = fault, self.problem.experiments[0].respond(self.problem.plant, parameters, effects)
        return self.last[1]

    def disturbance(self, fault: _Fault) -> float:
        """By how much the response changes, rms."""
        change = self.rows(fault)[0] - self.nominal[0]
        rms = float(np.sqrt(np.mean(change**2)))
        return rms if math.isfinite(rms) else math.inf

    def still(self, fault: _Fault) -> Values:
        """What is found without noise."""
        return self._found(self.rows(fault))

    def noisy(self, rows: Array, seed: int) -> Values:
        """What is found with noise of this seed."""
        (noise,), (inner,) = self.problem.noises, self.problem.observed_noise
        rng, n = np.random.default_rng(seed), rows.shape[1]
        white = rng.standard_normal((1, n + 1000))
        shaped = coloured(white, np.array([1.0, *noise.colour]))[0, 1000:]
        rows = rows.copy()
        rows[0] += noise.std * shaped / np.std(shaped)
        for k, signal in enumerate(self.problem.plant.observed, 1):
            rows[k] += inner.get(signal.name, 0.0) * rng.standard_normal(n)
        return self._found(rows)

    def _found(self, rows: Array) -> Values:
        recording, e = self.recording, self.problem.experiments[0]
        name, unit = split_heading(e.output_heading)
        channels = dict(recording.channels)
        signals = [(name, unit), *((s.name, s.unit) for s in self.problem.plant.observed)]
        for (own, of), row in zip(signals, rows, strict=True):
            if (channel := channels.get(own)) is not None and np.isfinite(row).all():
                values = np.interp(recording.time_s, e.time_s, convert(row, of, channel.unit))
                channels[own] = replace(channel, values=np.where(np.isnan(channel.values), np.nan, values))
        own_samples = {key: value for key, value in recording.own.items() if key not in dict(signals)}
        return self.judge.values(replace(recording, channels=channels, own=own_samples))


def _ends(term: Term) -> tuple[tuple[float, ...], ...]:
    """From where strengths are counted: a parameter both ways, an effect with each sign that it may have."""
    if term.kind == "parameter":
        return tuple(dict.fromkeys((term.starts[0], term.starts[-1])))
    signed = {tuple(np.sign([start[k] - term.nulls[k] for k in term.sizes])): start for start in reversed(term.starts)}
    return tuple(signed.values()) if term.scales else ()


@dataclass(frozen=True, slots=True)
class _Found:
    """The most harmless faults of a world's limits, and the limits that its healthy unit passes for sure."""

    faults: tuple[LeastFault, ...]
    proven: frozenset[str]


@dataclass(frozen=True, slots=True)
class _Seen:
    """What a fault does without noise: limits that 95 % of repeats would miss, whether each has a value, rms change."""

    missed: Sequence[str]
    whole: bool
    disturbance: float


@dataclass(slots=True)
class _Search:
    """The least faults in one world: all of them roughly, then those alone that may be the most harmless finely."""

    world: _World
    limits: Sequence[str]
    progress: Progress
    scatter: dict[str, float] = field(default_factory=dict)

    def faults(self) -> _Found:
        """Those of all limits."""
        world = self.world
        self.progress(0.0, "what limits catch: the healthy unit")
        self._healthy()
        growing = [_Growing(term, start) for term in world.terms for start in _ends(term)]
        lowest: list[dict[str, float]] = []
        for n, one in enumerate(growing):
            self.progress(0.05 + 0.45 * n / len(growing), f"what limits catch: {one.term.label}")
            lowest.append(self._coarsest(one))
        found: list[LeastFault] = []
        for n, limit in enumerate(self.scatter):
            self.progress(0.5 + 0.5 * n / len(self.scatter), f"what limits catch: {limit}")
            broken = [(one, shares[limit]) for one, shares in zip(growing, lowest, strict=True) if limit in shares]
            found += islice(self._most_harmless(limit, broken), _SHOWN)
        return _Found(tuple(found), frozenset(self.scatter))

    def _healthy(self) -> None:
        """What repeats of the healthy unit scatter by, of the limits that it passes for sure."""
        kept = self.world.state.of_world(self.world.name, "healthy")
        if not kept:
            repeats = parallel_map(partial(self.world.noisy, self.world.nominal), range(REPEATS))
            for name in self.limits:
                passed = sum(one[name].verdict == "pass" for one in repeats if name in one)
                if passed >= _SHARE * REPEATS and (found := _scatter(repeats, name)) is not None:
                    kept[name] = found
            self.world.state.write()
        self.scatter = {name: kept[name] for name in self.limits if name in kept}

    def _seen(self, growing: _Growing, share: float) -> _Seen:
        """What this size does without noise."""
        kept = self.world.state.of_world(self.world.name, "still")
        if (key := growing.key(share)) not in kept:
            fault = growing.at(share)
            found = self.world.still(fault)
            missed = [name for name, std in self.scatter.items() if _misses(found.get(name), std)]
            whole = all(name in found and found[name].value is not None for name in self.scatter)
            kept[key] = missed, whole, self.world.disturbance(fault)
            self.world.state.write()
        return _Seen(*kept[key])

    def _coarsest(self, growing: _Growing) -> dict[str, float]:
        """The least of a few shares at which each limit is missed; those that none misses are left out.

        From the largest down, until nothing is missed any more.
        """
        lowest: dict[str, float] = {}
        for share in reversed(_SHARES):
            seen = self._seen(growing, share)
            lowest |= dict.fromkeys(seen.missed, share)
            if not seen.missed and seen.whole:
                break
        return lowest

    def _most_harmless(self, limit: str, broken: Sequence[tuple[_Growing, float]]) -> Iterator[LeastFault]:
        """The faults that fail a limit in 95 % of repeats with noise, the most harmless first; each name once.

        A size is known between two shares. What the lower one changes is the least that the fault may: who has the
        lowest of these is halved next, and is the most harmless once it is known well enough.
        """
        shown = set[str]()
        step = _SHARES[1] / _SHARES[0]
        queue = [(self._seen(one, share / step).disturbance, n, share / step, share, _HALVINGS)
                 for n, (one, share) in enumerate(broken)]  # fmt: skip
        heapify(queue)
        while queue:
            _, n, low, high, halvings = heappop(queue)
            growing = broken[n][0]
            if growing.term.name in shown:
                continue
            if low == high:
                if (fault := self._confirmed(limit, growing, high)) is not None:
                    shown.add(growing.term.name)
                    yield fault
                continue
            if halvings:
                middle = math.sqrt(low * high)
                low, high = (low, middle) if limit in self._seen(growing, middle).missed else (middle, high)
            else:
                low = high
            heappush(queue, (self._seen(growing, low).disturbance, n, low, high, halvings - 1))

    def _confirmed(self, limit: str, growing: _Growing, least: float) -> LeastFault | None:
        """The fault at the least share at which enough repeats fail the limit."""
        for attempt in range(_TRIES):
            share = least * _LARGER**attempt
            if (failed := self._failed(limit, growing, share)) < _SHARE * REPEATS:
                continue
            term, values = fault = growing.at(share)
            u, *others = term.unknowns
            nominal = term.nominal if term.kind == "parameter" else term.null
            shape = {one.name: (value, one.unit) for one, value in zip(others, values[1:], strict=True)}
            return LeastFault(
                limit, term.name, term.stage, u.name, values[0], nominal, u.unit, shape,
                self.world.disturbance(fault), failed, REPEATS,
            )  # fmt: skip
        return None

    def _failed(self, limit: str, growing: _Growing, share: float) -> int:
        """How many repeats fail a limit; no more are run once too many of them did not."""
        kept = self.world.state.of_world(self.world.name, "noisy").setdefault(growing.key(share), [])
        rows = self.world.rows(growing.at(share)) if len(kept) < REPEATS else self.world.nominal

        def count() -> int:
            return sum(limit in missed for missed in kept)

        while len(kept) < REPEATS and len(kept) - count() <= (1.0 - _SHARE) * REPEATS:
            seeds = range(len(kept), min(len(kept) + _BATCH, REPEATS))
            for found in parallel_map(partial(self.world.noisy, rows), seeds):
                kept.append([name for name in self.scatter if name in found and found[name].verdict == "fail"])
            self.world.state.write()
        return count()


def _misses(found: Measured | None, scatter: float) -> bool:
    """Whether 95 % of repeats about this value would be measured failing."""
    if found is None or found.value is None:
        return False
    probability = found.fail_probability(found.value, scatter)
    return found.verdict == "fail" if probability is None else probability >= _SHARE


def _scatter(repeats: Sequence[Values], limit: str) -> float | None:
    """Standard deviation of what repeats found; None where one did not find it."""
    values = [one[limit].value for one in repeats if limit in one]
    if len(values) < len(repeats) or None in values:
        return None
    return float(np.std(np.array(values, dtype=np.float64), ddof=1))


@dataclass(slots=True)
class _State:
    """What was found so far, by world and kind, in a file that a stop leaves."""

    path: Path | None
    key: str
    found: dict[str, dict[str, dict[str, Any]]]

    @classmethod
    def of(cls, path: Path | None, run: UnitRun, model: Model, judge: _Judge) -> _State:
        judged = {name: asdict(limit) for name, limit in judge.limits.items()}
        text = to_json([run.results.run, run.recording.meta.get("started_utc"), model.as_dict(), judged, PROGRAM])
        key, found = hashlib.sha256(text.encode()).hexdigest(), dict[str, dict[str, dict[str, Any]]]()
        if path is not None and path.is_file():
            with suppress(OSError, ValueError, KeyError):
                before: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
                found = before["found"] if before["key"] == key else found
        return cls(path, key, found)

    def of_world(self, world: str, kind: str) -> dict[str, Any]:
        """What is kept of this kind: to be read, and to be added to before `write`."""
        return self.found.setdefault(world, {}).setdefault(kind, {})

    def write(self) -> None:
        """Keep what was added."""
        if self.path is not None:
            write_whole(self.path, json.dumps({"key": self.key, "found": self.found}))

    def close(self) -> None:
        if self.path is not None:
            self.path.unlink(missing_ok=True)


def as_dict(powers: Sequence[Power]) -> dict[str, Any]:
    """`hil.power/1`."""
    return {"schema": "hil.power/1", "runs": [asdict(one) for one in powers]}


def rows(powers: Sequence[Power]) -> list[list[str]]:
    """For the annex: limit, fault, least size, how many of the repeats failed; in the language that is spoken."""
    return [
        [name_words(f.limit), _(f.name.replace("_", " ")), _(f.stage),
         f"{'≥' if f.size > f.nominal else '≤'} {with_unit(f.size, f.unit, 2)}{_nominal_text(f)}",
         _("{n} of {all}").format(n=f.failed, all=f.repeats)]
        for power in powers for f in power.faults
    ]  # fmt: skip


def _nominal_text(fault: LeastFault) -> str:
    """The nominal value of a parameter; what else an effect has."""
    if fault.parameter == fault.name:
        return f" ({number(fault.nominal, 2)})"
    others = (f"{_(name.replace('_', ' '))} {with_unit(value, unit, 2)}" for name, (value, unit) in fault.shape.items())
    return f" ({text})" if (text := ", ".join(others)) else ""


def notes(powers: Sequence[Power]) -> list[Note]:
    """What cannot be said of limits by a size."""
    unbroken = tuple(dict.fromkeys(name_words(name) for power in powers for name in power.unbroken))
    unproven = tuple(dict.fromkeys(name_words(name) for power in powers for name in power.unproven))
    found = []
    if unbroken:
        found.append(Note("No fault of the library breaks: {names}.", names=unbroken))
    if unproven:
        found.append(
            Note("Not tried, since the model of the healthy unit itself does not pass for sure: {names}.",
                 names=unproven)
        )  # fmt: skip
    return found
