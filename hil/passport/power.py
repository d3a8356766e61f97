"""What a limit would have caught: for each, the least fault of this unit that would have failed it.

The unit's own model is driven as the run was, with one fault at a time, and evaluated as the run was. Least sizes are
sought without noise, beside the scatter of healthy repeats; those that are shown are confirmed by repeats with noise.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from hil.cores import spread
from hil.errors import InputError
from hil.language.note import Note
from hil.language.words import _
from hil.passport.certificate import name_words
from hil.passport.unit import UnitRun
from hil.physics.model import Model
from hil.physics.simulate import ActiveEffect
from hil.record.durable import write_whole
from hil.record.invalid_samples import with_blanks
from hil.record.measurement import Limit, Measured, Verdict
from hil.record.plain import to_json
from hil.record.progress import Progress
from hil.record.recording import Array, split_heading
from hil.report.number import number, with_unit
from hil.session.procedure import Procedure
from hil.session.results import evaluated, judged_by, procedure_of
from hil.signals.autoregression import coloured
from hil.units import convert
from hil.version import PROGRAM

if TYPE_CHECKING:
    from hil.diagnosis.problem import Problem
    from hil.diagnosis.search.terms import Term

REPEATS = 40
"""Runs with noise: of the healthy unit, and of each fault that is shown."""
_SHARE = 0.95  # of them must fail, or pass for the healthy unit
_SHOWN = 2  # of each limit, the most harmless first
# Shares of an effect's typical size, and of a doubling or halving of a parameter, between which a least size is sought.
_SHARES = tuple(2.0**k for k in range(-8, 5, 2))
_HALVINGS = 4  # of the logarithm between two of them: to 9 %
_LARGER, _TRIES = 1.2, 4  # a size that fails more rarely than sought is made so much larger, so often

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
        progress: told how far it is.
        kept: file in which what was found is kept, so that it can go on after a stop; taken away at the end.

    Raises:
        InputError: the run has no limits, or does not belong to the model.
    """
    world = _World.of(run, model)
    progress(0.0, "what limits catch: the healthy unit")
    healthy = world.repeated(None)
    passed = [name for name in world.limits if _fraction(healthy, name, "pass") >= _SHARE]
    scatter = {name: found for name in passed if (found := _scatter(healthy, name)) is not None}
    state = _State.of(kept, world)
    growing = [_Growing(term, start) for term in world.terms for start in _ends(term)]
    for n, one in enumerate(growing):
        progress(0.05 + 0.8 * n / len(growing), f"what limits catch: {one.term.label}")
        if one.key not in state.found:
            state.add(one.key, _least(world, one, scatter))
    faults: list[LeastFault] = []
    for n, name in enumerate(scatter):
        progress(0.85 + 0.15 * n / len(scatter), f"what limits catch: confirming {name}")
        broken = [(one, least) for one in growing if (least := state.found[one.key].get(name))]
        ranked = sorted(broken, key=lambda found: world.disturbance(found[0].at(found[1])))
        faults += _confirmed(world, name, ranked)
    state.close()
    caught = {fault.limit for fault in faults}
    return Power(
        run.results.run, tuple(faults), tuple(name for name in scatter if name not in caught),
        tuple(name for name in world.limits if name not in scatter),
        tuple(dict.fromkeys(one.term.label for one in growing)),
    )  # fmt: skip


_Fault: TypeAlias = "tuple[Term, tuple[float, ...]]"


@dataclass(frozen=True, slots=True)
class _Growing:
    """A fault that grows from nothing, in shares of one of the starts of its term."""

    term: Term
    start: tuple[float, ...]

    @property
    def key(self) -> str:
        """Unlike that of any other."""
        return f"{self.term.name} {self.term.hook} {self.start}"

    def at(self, share: float) -> _Fault:
        """The fault of this size, as far as it may go."""
        if self.term.kind == "effect":
            return self.term, self.term.scaled(self.start, share)
        u, nominal = self.term.unknowns[0], self.term.nominal
        return self.term, (float(np.clip(nominal + share * (self.start[0] - nominal), u.low, u.high)),)


@dataclass(slots=True)
class _World:
    """A run as it would have been: driven as it was, with the model in the place of the unit."""

    run: UnitRun
    problem: Problem
    procedure: Procedure
    judged_by: Mapping[str, Limit]
    limits: tuple[str, ...]
    terms: tuple[Term, ...]
    nominal: Array
    repeats: dict[_Fault | None, list[Values]]

    @classmethod
    def of(cls, run: UnitRun, model: Model) -> _World:
        from hil.diagnosis.problem import pose
        from hil.diagnosis.search.terms import all_terms
        from hil.identification.preparation.experiment import for_model

        limits = tuple(m.name for m in run.findings.measured if m.verdict is not None)
        if not limits:
            raise InputError(f"{run.results.run}: no limit was given")
        problem = pose(model, [for_model(model, with_blanks(run.recording))])
        rows = problem.experiments[0].simulated(model)
        terms = all_terms(problem, problem.nominal_residuals)
        procedure, judged = procedure_of(run.recording), judged_by(run.recording, run.folder)
        return cls(run, problem, procedure, judged, limits, terms, rows, {})

    def rows(self, fault: _Fault | None) -> Array:
        """Output and inner signals, shape (1 + observed, n)."""
        parameters, effects = dict(self.problem.model.values), list[ActiveEffect](self.problem.model.active_effects)
        if fault is not None:
            fault[0].apply(fault[1], parameters, effects)
        with np.errstate(all="ignore"):
            return self.problem.experiments[0].respond(self.problem.plant, parameters, effects)

    def disturbance(self, fault: _Fault) -> float:
        """By how much the response changes, rms."""
        change = self.rows(fault)[0] - self.nominal[0]
        return float(np.sqrt(np.mean(change**2)))

    def still(self, fault: _Fault) -> Values:
        """What is found without noise."""
        return self._found(self.rows(fault))

    def _noisy(self, fault: _Fault | None, seed: int) -> Values:
        rows, (noise,), (inner,) = self.rows(fault), self.problem.noises, self.problem.observed_noise
        rng, n = np.random.default_rng(seed), rows.shape[1]
        white = rng.standard_normal((1, n + 1000))
        shaped = coloured(white, np.array([1.0, *noise.colour]))[0, 1000:]
        rows = rows.copy()
        rows[0] += noise.std * shaped / np.std(shaped)
        for k, signal in enumerate(self.problem.plant.observed, 1):
            rows[k] += inner.get(signal.name, 0.0) * rng.standard_normal(n)
        return self._found(rows)

    def repeated(self, fault: _Fault | None) -> Sequence[Values]:
        """What repeats with noise find, each with its own."""
        if fault not in self.repeats:
            self.repeats[fault] = spread(partial(self._noisy, fault), range(REPEATS))
        return self.repeats[fault]

    def _found(self, rows: Array) -> Values:
        recording, e = self.run.recording, self.problem.experiments[0]
        name, unit = split_heading(e.output_heading)
        channels = dict(recording.channels)
        signals = [(name, unit), *((s.name, s.unit) for s in self.problem.plant.observed)]
        for (own, of), row in zip(signals, rows, strict=True):
            if (channel := channels.get(own)) is not None and np.isfinite(row).all():
                values = np.interp(recording.time_s, e.time_s, convert(row, of, channel.unit))
                channels[own] = replace(channel, values=np.where(np.isnan(channel.values), np.nan, values))
        own_samples = {key: value for key, value in recording.own.items() if key not in dict(signals)}
        made = replace(recording, channels=channels, own=own_samples)
        try:
            found = evaluated(self.procedure, made, self.judged_by)
        except InputError:
            return {}
        return {m.name: m for m in found.measured}


def _ends(term: Term) -> tuple[tuple[float, ...], ...]:
    """From where strengths are counted: a parameter both ways, an effect with each sign that it may have."""
    if term.kind == "parameter":
        return tuple(dict.fromkeys((term.starts[0], term.starts[-1])))
    signed = {tuple(np.sign([start[k] - term.nulls[k] for k in term.sizes])): start for start in reversed(term.starts)}
    return tuple(signed.values()) if term.scales else ()


def _least(world: _World, growing: _Growing, scatter: Mapping[str, float]) -> dict[str, float]:
    """The least share at which each limit is missed in 95 %; those that none misses are left out.

    From the largest down, until nothing is missed any more.
    """
    found = cache(lambda share: world.still(growing.at(share)))
    lowest: dict[str, float] = {}
    for share in reversed(_SHARES):
        missed = [name for name, std in scatter.items() if _misses(found(share).get(name), std)]
        lowest |= dict.fromkeys(missed, share)
        if not missed and all(name in found(share) and found(share)[name].value is not None for name in scatter):
            break
    for name, share in lowest.items():
        low, high = share / _SHARES[1] * _SHARES[0], share
        for _halving in range(_HALVINGS):
            middle = math.sqrt(low * high)
            low, high = (low, middle) if _misses(found(middle).get(name), scatter[name]) else (middle, high)
        lowest[name] = high
    return lowest


def _misses(found: Measured | None, scatter: float) -> bool:
    """Whether 95 % of repeats about this value would be measured failing."""
    if found is None or found.value is None:
        return False
    probability = found.fail_probability(found.value, scatter)
    return found.verdict == "fail" if probability is None else probability >= _SHARE


def _confirmed(world: _World, limit: str, ranked: Sequence[tuple[_Growing, float]]) -> Iterator[LeastFault]:
    """The most harmless faults that fail a limit in 95 % of repeats with noise; each name once."""
    shown = set[str]()
    for growing, least in ranked:
        if len(shown) == _SHOWN or growing.term.name in shown:
            continue
        for attempt in range(_TRIES):
            fault = term, values = growing.at(least * _LARGER**attempt)
            failed = round(REPEATS * _fraction(world.repeated(fault), limit, "fail"))
            if failed >= _SHARE * REPEATS:
                shown.add(term.name)
                u, *others = term.unknowns
                nominal = term.nominal if term.kind == "parameter" else term.null
                shape = {one.name: (value, one.unit) for one, value in zip(others, values[1:], strict=True)}
                yield LeastFault(
                    limit, term.name, term.stage, u.name, values[0], nominal, u.unit, shape, world.disturbance(fault),
                    failed, REPEATS,
                )  # fmt: skip
                break


def _fraction(repeats: Sequence[Values], limit: str, verdict: Verdict) -> float:
    return sum(one[limit].verdict == verdict for one in repeats if limit in one) / len(repeats)


def _scatter(repeats: Sequence[Values], limit: str) -> float | None:
    """Standard deviation of what repeats found; None where one did not find it."""
    values = [one[limit].value for one in repeats if limit in one]
    if len(values) < len(repeats) or None in values:
        return None
    return float(np.std(np.array(values, dtype=np.float64), ddof=1))


@dataclass(slots=True)
class _State:
    """What was found so far, in a file that a stop leaves."""

    path: Path | None
    key: str
    found: dict[str, dict[str, float]]

    @classmethod
    def of(cls, path: Path | None, world: _World) -> _State:
        run = world.run
        judged = {name: asdict(limit) for name, limit in world.judged_by.items()}
        parts = [run.results.run, run.recording.meta.get("started_utc"), world.problem.model.as_dict(), judged, PROGRAM]
        text = to_json(parts)
        key, found = hashlib.sha256(text.encode()).hexdigest(), dict[str, dict[str, float]]()
        if path is not None and path.is_file():
            with suppress(OSError, ValueError, KeyError):
                before: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
                found = before["found"] if before["key"] == key else found
        return cls(path, key, found)

    def add(self, name: str, least: dict[str, float]) -> None:
        self.found[name] = least
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
