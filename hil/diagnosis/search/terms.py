"""Terms: the single things that may be different. A base parameter that changed, or an effect at a hook."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.thresholds import FEW, MUCH_THE_SAME
from hil.identification.grey_box.estimate import Unknown
from hil.identification.grey_box.lines import between_bins, prominence
from hil.physics.compose import Site, kernel
from hil.physics.effect import EffectParameter, Seen
from hil.physics.plant import Parameter
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array

# Starts of a base parameter, as factors of its value: twice as large or much the same, and as much smaller.
_FACTORS = (MUCH_THE_SAME, 2.0)


@dataclass(frozen=True, slots=True)
class Term:
    """One thing that may be different.

    Attributes:
        kind: a base parameter that changed, or an effect of the library.
        name: of the parameter or the effect. `hook`, `stage`: where the effect sits.
        unknowns: what is estimated. `starts`: where from, one tuple for each start.
        nominal: value of a base parameter in the nominal model.
        growth, change: the effects that a larger, or any other, value of the base parameter is known as; `change` also
            what an effect is known as under another name.
        nulls: values at which an effect does nothing: of each unknown that is a size of it, infinity of a limit, NaN
            of a shape; empty for a base parameter.
        telling: unknowns without whose shape the effect would be another one, and at which end of their range.
        multimodal: whether a fit ends in one of many valleys.
        by_clock: whether it runs by the clock, whatever the command does.
        held: what the nominal model has of the effect already, every parameter by name: then the unknowns are its
            sizes, their nulls what they are in the model, and the term stands in its place. Empty for new physics.
    """

    kind: Literal["parameter", "effect"]
    name: str
    hook: str
    stage: str
    unknowns: tuple[Unknown, ...]
    starts: tuple[tuple[float, ...], ...]
    nominal: float = 0.0
    growth: str = ""
    change: str = ""
    nulls: tuple[float, ...] = ()
    telling: tuple[tuple[str, str], ...] = ()
    multimodal: bool = False
    by_clock: bool = False
    held: tuple[tuple[str, float], ...] = ()

    @property
    def key(self) -> tuple[str, str]:
        """(name, hook)."""
        return self.name, self.hook

    @property
    def is_new(self) -> bool:
        """Whether it is physics that the nominal model lacks, and not something in it that has changed."""
        return self.kind == "effect" and not self.held

    @property
    def sizes(self) -> tuple[int, ...]:
        """The places of the unknowns that say how strong it is: at their nulls it does nothing."""
        return tuple(k for k, null in enumerate(self.nulls) if np.isfinite(null))

    @property
    def null(self) -> float:
        """Value of its first unknown at which it does nothing."""
        return self.nulls[0] if self.nulls else 0.0

    @property
    def scales(self) -> bool:
        """Whether it has strengths at which it does nothing, and beyond which it does ever more."""
        return bool(self.sizes)

    @property
    def is_signed(self) -> bool:
        """Whether its strengths may have either sign."""
        return self.scales and all(self.unknowns[k].low < self.nulls[k] < self.unknowns[k].high for k in self.sizes)

    def scaled(self, values: Sequence[float], share: float) -> tuple[float, ...]:
        """The values with this share of every strength, as far as it may go; as they are where it has none."""
        sized = list(values)
        for k in self.sizes:
            u, null = self.unknowns[k], self.nulls[k]
            sized[k] = float(np.clip(null + share * (values[k] - null), u.low, u.high))
        return tuple(sized)

    def is_nothing(self, values: Sequence[float]) -> bool:
        """Whether it does nothing at these values, as near as a fit comes to that."""
        return self.scales and all(abs(values[k] - self.nulls[k]) <= 1e-3 * self.unknowns[k].scale for k in self.sizes)

    @property
    def label(self) -> str:
        """For messages: `friction at spool`, `pilot_rate`."""
        return f"{self.name} at {self.stage}" if self.kind == "effect" else self.name

    @property
    def reported_name(self) -> str:
        """The name by which an effect is reported."""
        return self.change or self.name

    def effect_name(self, values: Sequence[float]) -> str:
        """The effect that these values stand for, or nothing when it is a changed parameter."""
        if self.kind == "effect":
            return self.reported_name
        return self.change or (self.growth if values[0] > self.nominal else "")

    def named(self, values: Sequence[float]) -> dict[str, float]:
        """The values by the names of the unknowns."""
        return {u.name: float(value) for u, value in zip(self.unknowns, values, strict=True)}

    def apply(self, values: Sequence[float], parameters: dict[str, float], effects: list[ActiveEffect]) -> None:
        """Put these values into a simulation's arguments."""
        if self.kind == "parameter":
            parameters[self.name] = float(values[0])
        else:
            own = {**dict(self.held), **self.named(values)}
            effects.append(ActiveEffect(self.name, self.hook, own))  # the last of a key counts


def all_terms(problem: Problem, left: Array) -> tuple[Term, ...]:
    """Every term that the plant has, with starts from what the model itself shows.

    `left`: the residuals that nothing explains so far; their lines start periodic effects.
    """
    seen = signals_seen(problem, left)
    sites = kernel(problem.plant.name).sites
    held = {effect.key: effect.parameters for effect in problem.model.active_effects}
    resolved_unit = problem.model.resolved_unit
    effects = [
        _held_term(site, held[site.key], resolved_unit)
        if site.key in held
        else _effect_term(site, seen[site.hook.name], resolved_unit)
        for site in sites
        if site.key not in problem.refuted
    ]
    may_have_changed = () if problem.is_own else problem.base
    values, stage = problem.model.values, problem.plant.stage
    parameters = [_parameter_term(p, values[p.name], stage(p.name)) for p in may_have_changed]
    return (*parameters, *(term for term in effects if term.starts))


def _parameter_term(parameter: Parameter, value: float, stage: str) -> Term:
    unknown = Unknown(parameter.name, parameter.unit, value, parameter.low, parameter.high, parameter.scale)
    size = max(abs(value), parameter.scale)
    starts = {
        float(np.clip(value + (factor - 1.0) * size, parameter.low, parameter.high))
        for larger in _FACTORS
        for factor in (larger, 1.0 / larger)
    }
    return Term(
        "parameter",
        parameter.name,
        "",
        stage,
        (unknown,),
        tuple((s,) for s in sorted(starts)),
        value,
        parameter.growth,
        parameter.change,
    )


def _effect_term(site: Site, seen: Seen, resolved_unit: Callable[[str], str]) -> Term:
    there = [_as_far_as_seen(p, site, seen) for p in site.effect.parameters]
    typical = {p.name: p.typical for p in there}
    starts = tuple(
        tuple(float(np.clip({**typical, **start}[p.name], p.low, p.high)) for p in there)
        for start in site.effect.starts_at(site.hook, seen)
    )
    unknowns = tuple(
        Unknown(p.name, resolved_unit(p.unit), p.typical, p.low, p.high, _size(p, starts, k))
        for k, p in enumerate(there)
    )
    scale = {p.name: p.scale_at(site.hook) for p in site.effect.parameters}
    nulls = tuple(float("nan") if p.null is None else p.null * scale[p.name] for p in site.effect.parameters)
    return Term(
        "effect", site.effect.name, site.hook.name, site.hook.stage, unknowns, tuple(dict.fromkeys(starts)),
        change=site.effect.known_as, nulls=nulls, multimodal=site.effect.multimodal,
        telling=tuple((p.name, p.telling) for p in site.effect.parameters if p.telling), by_clock=site.by_clock,
    )  # fmt: skip


def _held_term(site: Site, held: Mapping[str, float], resolved_unit: Callable[[str], str]) -> Term:
    """An effect that the nominal model has: its sizes may have changed, its shapes stay."""
    there = [p.at(site.hook) for p in site.effect.parameters if p.null is not None and held[p.name] != 0.0]
    values = tuple(held[p.name] for p in there)
    factors = sorted({f for larger in _FACTORS for f in (larger, 1.0 / larger)}) if there else []
    starts = tuple(
        tuple(float(np.clip(factor * v, min(p.low, v), max(p.high, v))) for p, v in zip(there, values, strict=True))
        for factor in factors
    )
    unknowns = tuple(
        Unknown(p.name, resolved_unit(p.unit), v, min(p.low, v), max(p.high, v), _size(p, starts, k))
        for k, (p, v) in enumerate(zip(there, values, strict=True))
    )
    return Term(
        "effect", site.effect.name, site.hook.name, site.hook.stage, unknowns, starts,
        change=site.effect.known_as, nulls=values, multimodal=site.effect.multimodal, by_clock=site.by_clock,
        held=tuple(held.items()),
    )  # fmt: skip


def _as_far_as_seen(parameter: EffectParameter, site: Site, seen: Seen) -> Parameter:
    """A parameter whose bounds count what really passes the hook, where that is more than its full scale."""
    there = parameter.at(site.hook)
    wider = parameter.at(replace(site.hook, full_scale=max(site.hook.full_scale, seen.size)))
    return replace(there, low=min(there.low, wider.low), high=max(there.high, wider.high))


def _size(parameter: Parameter, starts: Sequence[tuple[float, ...]], k: int) -> float:
    """A natural step: of the smaller starts, so that derivatives at small strengths stay meaningful."""
    sizes = [abs(start[k]) for start in starts if start[k] != 0.0]
    return min([*sizes, parameter.scale]) if sizes else parameter.scale


def signals_seen(problem: Problem, left: Array) -> Mapping[str, Seen]:
    """What passes each hook of the plant in the nominal simulation of all experiments."""
    traced = problem.traces(problem.model.values, problem.model.active_effects)
    traces = [(rows, e.drive.interval_s) for rows, e in zip(traced, problem.experiments, strict=True)]
    tones = _tones(problem, left)
    duration_s = max(e.duration_s for e in problem.experiments)
    found: dict[str, Seen] = {}
    for k, hook in enumerate(problem.plant.hooks):
        # What passes a force hook is a speed; effects there are sized by what drives the part.
        arrives = [t[k - 1] if hook.is_force else t[k] for t, _ in traces]
        if hook.is_force and k == 0:
            arrives = [e.drive.inputs[0] for e in problem.experiments]
        rows = [(row, dt) for row, (_, dt) in zip(arrives, traces, strict=True)]
        found[hook.name] = _seen(rows, tones, duration_s)
    return found


def _seen(
    rows: Sequence[tuple[Array, float]], tones: tuple[tuple[float, float, float], ...], duration_s: float
) -> Seen:
    values = np.concatenate([row for row, _ in rows])
    speeds = np.concatenate([np.abs(np.diff(row)) / dt for row, dt in rows])
    low, high = float(values.min()), float(values.max())
    # The amplitude of a typical recording: a slow sweep over everything must not hide a small sine.
    amplitudes = [float(np.ptp(row)) / 2.0 for row, _ in rows]
    amplitude = max(float(np.median(amplitudes)), 1e-6 * max(abs(low), abs(high), 1e-9))
    moving = speeds[speeds > 0.0]
    quantiles = np.quantile(moving, (0.5, 0.9, 0.99)) if moving.size else np.zeros(3)
    return Seen(
        low, high, amplitude, (float(quantiles[0]), float(quantiles[1]), float(quantiles[2])),
        tones, duration_s, rows[0][1],
    )  # fmt: skip


_Line = tuple[float, float, tuple[float, float, float]]


def _tones(problem: Problem, left: Array) -> tuple[tuple[float, float, float], ...]:
    """The strongest lines in the residuals, and the one that stands out most: (frequency in Hz, amplitude in the
    output's unit, phase).
    """
    strongest: list[_Line] = []
    standing_out: list[_Line] = []
    for e, noise, part in zip(problem.experiments, problem.noises, problem.output_slices(), strict=True):
        r = -left[part]
        spectrum = np.fft.rfft((r - r.mean()) * np.hanning(len(r)))
        power = np.abs(spectrum) ** 2
        above = prominence(power)
        duration_s = len(r) * e.interval_s
        for found, of in ((strongest, power / np.median(power)), (standing_out, above)):
            k = int(np.argmax(of[2:])) + 2
            size = 4.0 * np.abs(spectrum[k]) / len(r) * noise.std
            at = between_bins(power, k)
            phase = np.angle(spectrum[k]) - np.pi * (at - k) + np.pi / 2.0
            tone = (float(at / duration_s), float(size), float((phase + np.pi) % (2.0 * np.pi) - np.pi))
            found.append((float(of[k]), 1.0 / duration_s, tone))
    first = max(standing_out, key=lambda item: item[0])
    others = [item for item in sorted(strongest, key=lambda item: -item[0]) if abs(item[2][0] - first[2][0]) > item[1]]
    return tuple(tone for _, _, tone in [first, *others][:FEW])
