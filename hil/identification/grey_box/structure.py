"""Choose a plant's structure from recordings in time, by evidence that more freedom must pay for.

Structures are fitted from the simplest on, each from the estimate of the one that it grows from, coarsely at first.
The Bayesian criterion counts samples as the residual's colour leaves them independent. It rules out forms whose
unknowns would not pay even if they left as little as the most pliant one; what comes near is fitted to the end, and
judged by parts of the recordings, foretold from those before or after them. Where every form leaves more than noise,
plain ones are judged so too, whatever the criterion says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from hil.arrays import LEAST
from hil.errors import InputError, SettingError
from hil.identification.frequency.table_fit import Orders
from hil.identification.grey_box.criteria import CRITERIA, EFFORT
from hil.identification.grey_box.estimate import Estimate, Unknown, estimate, side_by_side
from hil.identification.grey_box.linear_starts import poles_rad_s
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.initial_condition import start_slope, with_free_start
from hil.identification.uncertainty.evidence import EXCLUDED_BIC, VERY_STRONG, odds, simplest_good
from hil.language.note import Note
from hil.physics.plant import Parameter, Parameters, Plant, Structure
from hil.physics.transfer_function import from_parameters, pole_parameters
from hil.record.recording import Array, Complex, Mask
from hil.signals.colour import colour_factor
from hil.signals.information_criterion import bic
from hil.signals.interval import COVERED

_GAINS = ("gain", "integrator_gain")
_SHARES = ("pair1_zero", "pair1_zero_square", "pair2_zero", "pair2_zero_square", "bend", "neutral")
_POLES = {"lag_time": 1, "pair1_time": 2, "pair2_time": 2}


@dataclass(frozen=True, slots=True)
class Tried:
    """A structure that was fitted.

    Attributes:
        values: every parameter of the plant.
        bic: smaller is better; infinite of a form that gave way to another, since nothing shows its gain at rest.
        mean_square: of the weighted residuals, 0 where nothing was measured: what is left of a recording that begins in
            motion, its beginning left out, moves still, and is no ground for a plainer form.
        held_out: root mean square error where it was foretold, in noise standard deviations; NaN
            where the criterion alone ruled the structure out.
        vague: parameters whose interval in it is wider than the whole response or record: it says nothing of them.
    """

    structure: Structure
    values: Parameters
    bic: float
    mean_square: float
    held_out: float
    vague: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class StructureChoice:
    """The chosen structure and everything that was tried, best evidence first.

    `spread`: root mean square of the output about its mean, in noise standard deviations; NaN where nothing was
    foretold.
    """

    chosen: Tried
    tried: tuple[Tried, ...]
    spread: float = float("nan")

    @property
    def probable(self) -> tuple[tuple[Tried, float], ...]:
        """The forms that evidence does not exclude, each with its probability; the chosen one is always among them."""
        least = min(t.bic for t in self.tried)
        near = [t for t in self.tried if t.bic <= least + EXCLUDED_BIC or t is self.chosen]
        return tuple(zip(near, odds([t.bic for t in near]).tolist(), strict=True))

    def form_std(self, name: str) -> float:
        """By how much a free parameter depends on the form: root mean square distance in forms that tell it too.

        The lag is a real pole's, which other forms may have as one of a pair: of theirs the nearest counts.
        """
        own = self.chosen.values[name]
        having = [
            (min(values, key=lambda value: abs(value - own)), share)
            for t, share in self.probable
            if name not in t.vague
            and (values := _real_times_s(t.values) if name == "lag_time" else _free_value(t, name))
        ]
        total = sum(share for _, share in having)
        return math.sqrt(sum(share * (value - own) ** 2 for value, share in having) / total) if having else 0.0

    @property
    def sentence(self) -> Note:
        """Why this one, in one line."""
        rivals = [t for t in self.tried if np.isfinite(t.held_out) and t is not self.chosen]
        name, count = self.chosen.structure.name, len(self.tried)
        if not rivals:
            return Note("structure '{name}' of {count} tried: no other comes near its evidence", name=name, count=count)
        best = min(rivals, key=lambda t: t.held_out)
        return Note(
            "structure '{name}' of {count} tried: it predicts unseen data to {error:.3g} times the noise, a fit of "
            "{fit:.2f} %, '{other}' to {others:.3g} times",
            name=name, count=count, error=self.chosen.held_out, other=best.structure.name, others=best.held_out,
            fit=100.0 * (1.0 - self.chosen.held_out / self.spread),
        )  # fmt: skip


def _real_times_s(values: Parameters) -> list[float]:
    """Time constants of the poles of a transfer function that hardly oscillate."""
    poles = from_parameters(values).poles
    return [-1.0 / pole.real for pole in poles if abs(pole.imag) < -pole.real]


def _free_value(tried: Tried, name: str) -> list[float]:
    return [tried.values[name]] if name in tried.structure.free else []


def choose_structure(plant: Plant, experiments: Sequence[Experiment]) -> StructureChoice:
    """The structure of a plant that experiments, bound to it, support."""
    search = _Search(plant, experiments, plant.typical, cache(partial(poles_rad_s, experiments)))
    choice: StructureChoice | None = None
    for switch in plant.switches:
        turned, turns = replace(search, off={**search.off, switch: 1.0 - search.off[switch]}), False
        plain = [s for s in plant.structures if _is_plain(s) and switch not in s.fixed]
        plain = sorted(plain, key=_poles, reverse=True)[:1]
        judged = [(s, search.values(s, search.best(s, search.off))) for s in plain]
        for _ in range(2):  # by a plain form before others are fitted, and again by the form that is chosen then
            improves = any(turned.improves(search, *form) for form in judged)
            if choice is None or improves != turns:
                choice, turns = _chosen(turned if improves else search), improves
            judged = [(t.structure, dict(t.values)) for t in _discriminating(choice, switch)]
    return choice or _chosen(search)


def with_orders(plant: Plant, orders: Orders) -> Plant:
    """A plant with the structures alone that have the poles, zeros and dead time asked for; an integrator is a pole.

    Raises:
        SettingError: it has none of them.
    """
    having = {s.name: s for s in plant.structures if _has(s, orders)}
    if not having:
        plain = [s.name for s in plant.structures if not {"bend", "dead_time"} & {*s.free}]
        raise SettingError(
            "poles, zeros and dead time: no form for samples in time has them; there are, with a dead time or without: "
            f"{'; '.join(plain)}"
        )
    after = {s.name: s.after for s in plant.structures}

    def grown_from(name: str) -> str:
        return name if name in having or not name else grown_from(after[name])

    return replace(plant, structures=tuple(replace(s, after=grown_from(s.after)) for s in having.values()))


def _has(structure: Structure, orders: Orders) -> bool:
    zeros = sum("zero" in name for name in structure.free)
    return (
        orders.poles in (None, _poles(structure) + ("integrator_gain" in structure.free))
        and orders.zeros in (None, zeros)
        and orders.dead_time in (None, "dead_time" in structure.free)
    )


def _discriminating(choice: StructureChoice, switch: str) -> list[Tried]:
    """Forms that tell how a switch stands: the chosen one, or plain ones where that, an integrator, has it fixed."""
    if switch not in choice.chosen.structure.fixed:
        return [choice.chosen]
    return [t for t in choice.tried if switch not in t.structure.fixed and _is_plain(t.structure)]


def _is_plain(structure: Structure) -> bool:
    return len({*structure.free} - {"bend"}) <= CRITERIA.plain


def _poles(structure: Structure) -> int:
    return sum(_POLES.get(name, 0) for name in structure.free)


def _chosen(search: _Search) -> StructureChoice:
    forms = {s.name: s for s in search.plant.structures}
    rich, fits = search.most_pliant(), dict[str, Estimate]()
    for name, s in forms.items():
        if rich and fits and (s.after not in {"", *fits} or _cannot_pay(s, rich, list(fits.values()))):
            continue
        before = search.values(forms[s.after], fits[s.after]) if s.after else search.off
        if "bend" in s.free and not search.bends(s, before, fits[s.after]):
            continue
        fits[name] = search.best(s, before, rich)
    least = min(fits.values(), key=lambda found: found.chi2)
    count = independent(least.residuals)
    near = min(_bic(found, count) for found in fits.values()) + 2.0 * VERY_STRONG
    is_misfit = least.chi2 > CRITERIA.misfit * len(least.residuals)
    for name, found in fits.items():
        if found is least or _bic(found, count) <= near or (is_misfit and _is_plain(forms[name])):
            fits[name] = search.fitted(forms[name], search.values(forms[name], found))
    count = independent(min(fits.values(), key=lambda found: found.chi2).residuals)
    tried = [
        Tried(s, search.values(s, found), _bic(found, count), found.chi2 / len(found.residuals), float("nan"))
        for s, found in ((forms[name], found) for name, found in fits.items())
    ]
    return _judged(search, sorted(tried, key=lambda t: t.bic), fits)


def _cannot_pay(form: Structure, rich: Estimate, fits: Sequence[Estimate]) -> bool:
    """Whether a form has too many unknowns to come near in evidence, though it left as little as the most pliant one.

    That says nothing where a plainer form leaves less: then it was not fitted from a good start.
    """
    least, count = min(found.chi2 for found in fits), independent(rich.residuals)
    if _fall(rich.chi2, least) * rich.count > CRITERIA.by_chance * len(rich.values):
        return False
    bound = bic(min(rich.chi2, least) / len(rich.residuals), count, len(form.free))
    return bound > min(_bic(found, count) for found in fits) + VERY_STRONG


def _leaves_more(found: Estimate, rich: Estimate) -> bool:
    """Whether a fit leaves more than the most pliant form's, by more than that one's unknowns bring by chance."""
    return _fall(found.chi2, rich.chi2) * rich.count > CRITERIA.by_chance * len(rich.values)


def _fall(before: float, now: float) -> float:
    """By how much the logarithm of a sum of squares falls."""
    return math.log(max(before, LEAST) / max(now, LEAST))


def independent(residuals: Array) -> float:
    """How many independent samples coloured residuals are worth, those apart that say nothing and are exactly 0."""
    return max(np.count_nonzero(residuals) / colour_factor(residuals), 2.0)


def _bic(found: Estimate, count: float) -> float:
    return bic(max(found.chi2 / len(found.residuals), 1e-12), count, len(found.values))


def _judged(search: _Search, tried: list[Tried], fits: Mapping[str, Estimate]) -> StructureChoice:
    near = [t for t in tried if t.bic <= tried[0].bic + VERY_STRONG][: EFFORT.judged]
    # where no form is right, evidence between wrong ones favours the most pliant
    if tried[0].mean_square > CRITERIA.misfit:
        near += [t for t in tried if _is_plain(t.structure) and t not in near]
    rest = [t for t in tried if t not in near]
    if len(near) == 1:
        return StructureChoice(tried[0], tuple(tried))
    errors = [search.foretold(t) for t in near]
    near = [
        replace(t, held_out=float(np.sqrt(np.mean(error))), vague=search.vague(fits[t.structure.name]))
        for t, error in zip(near, errors, strict=True)
    ]
    # the gain at rest is to be known to within the whole response; of a bent curve it is that of any level
    vague = [t.vague - ({"gain"} if "bend" in t.structure.free else set()) for t in near]
    shown = ["gain" not in names for names in vague]
    chosen = simplest_good(errors, [(len(t.structure.free), t.bic) for t in near])
    # a pole as slow as the recording is long follows a bend or a drift, and goes on with it; a form of which nobody
    # would know a parameter gives way to one with better evidence
    if vague[chosen]:
        each = zip(shown, vague, near, strict=True)
        known = simplest_good(errors, [(not s, bool(v), len(t.structure.free), t.bic) for s, v, t in each], COVERED)
        if not shown[chosen] or (not vague[known] and near[known].bic < near[chosen].bic):
            chosen = known
    if shown[chosen]:
        near = [t if s else replace(t, bic=math.inf) for s, t in zip(shown, near, strict=True)]
    return StructureChoice(near[chosen], (*near, *rest), search.spread)


@dataclass(frozen=True, slots=True)
class _Search:
    plant: Plant
    experiments: Sequence[Experiment]
    off: Parameters
    poles: Callable[[int], Complex | None]

    def values(self, structure: Structure, found: Estimate) -> dict[str, float]:
        """Every parameter of the plant at a fit of a structure."""
        return self._at(structure, found.values)

    def improves(self, other: _Search, structure: Structure, start: Parameters) -> bool:
        """Whether what is off here, but is on there, or the reverse, simulates so well that the other is excluded.

        From the start as it was read: where that is free, a wrong one costs nothing.
        """
        before, now = other.left(structure, start), self.left(structure, start)
        return _fall(float(before @ before), float(now @ now)) * independent(now) > EXCLUDED_BIC

    def left(self, structure: Structure, start: Parameters) -> Array:
        """What a structure that is fitted from a start leaves from the first output as it was read."""
        fitted = self.fitted(structure, start, rough=True)
        return self._answers(self.values(structure, fitted)) - self._wanted()

    @property
    def spread(self) -> float:
        """Root mean square of the outputs about their means, in noise standard deviations."""
        about = self._weighted([e.output - np.mean(e.valid_output) for e in self.experiments])
        return float(np.linalg.norm(about)) / math.sqrt(max(int(np.count_nonzero(about)), 1))

    def most_pliant(self) -> Estimate | None:
        """A coarse fit of the form that leaves least where samples show its poles, of those with many unknowns."""
        many = [s for s in self.plant.structures if len(s.free) >= 2 * CRITERIA.plain]
        starts = [(*self._scaled(s, start), s) for s in many for start in self._of_samples(s)]
        if not starts:
            return None
        _, start, form = min(starts, key=lambda each: each[0])
        return self.fitted(form, start, rough=True)

    def bends(self, structure: Structure, before: Parameters, straight: Estimate) -> bool:
        """Whether a static curve takes more of what its form leaves without one than an unknown takes by chance.

        The score test: without a fit, by slopes alone.
        """
        small = 1e-3 * self._natural(self.plant.parameter("bend"))
        slope = self._errors({**before, **structure.fixed, "bend": small}) - straight.residuals
        others = np.linalg.qr(straight.jacobian)[0]
        slope -= others @ (others.T @ slope)
        taken = float(slope @ straight.residuals) ** 2 / max(float(slope @ slope), LEAST)
        return _fall(straight.chi2, straight.chi2 - taken) * independent(straight.residuals) > CRITERIA.by_chance

    def best(self, structure: Structure, before: Parameters, rich: Estimate | None = None) -> Estimate:
        """The best coarse fit of a structure over its starts, the most promising first.

        Until two come to the same, or one to the noise: by chance alone does the most pliant form leave less.
        """
        fits: list[Estimate] = []
        for start in self._promising(structure, before)[: EFFORT.starts]:
            fits = sorted([*fits, self.fitted(structure, start, rough=True)], key=lambda found: found.chi2)
            if len(fits) > 1 and _fall(fits[1].chi2, fits[0].chi2) * fits[0].count < CRITERIA.by_chance:
                break
            if rich and rich.mean_square <= CRITERIA.misfit and not _leaves_more(fits[0], rich):
                break
        return fits[0]

    def vague(self, found: Estimate) -> frozenset[str]:
        """Parameters whose interval is wider than their natural size."""
        stds = zip(found.named, found.std.tolist(), strict=True)
        return frozenset(name for name, std in stds if COVERED * std > self._natural(self.plant.parameter(name)))

    def foretold(self, tried: Tried) -> Array:
        """Mean squared weighted error in blocks of the recordings, each fitted to those on one side of it alone.

        A form that follows a bend or a drift by slow poles does so between blocks, and not beyond them. Both ways: a
        staircase up is another test than the same staircase down.
        """
        owner = np.concatenate([np.arange(len(e.output)) * EFFORT.blocks // len(e.output) for e in self.experiments])
        made = []
        for block in EFFORT.foretold:
            used = owner < block if block > EFFORT.blocks // 2 else owner > block
            found = self.fitted(tried.structure, tried.values, used, rough=True)
            errors = self._errors(self.values(tried.structure, found))[owner == block]
            made.append(float(errors @ errors) / max(int(np.count_nonzero(errors)), 1))
        return np.array(made)

    def fitted(
        self, structure: Structure, start: Parameters, used: Mask | None = None,
        *, rough: bool = False,
    ) -> Estimate:  # fmt: skip
        """Of a structure from a start, to all samples or to those that are used."""
        known: list[int] = []  # how many residuals there are, once a point has been simulated

        def residuals(values: Array) -> Array:
            try:
                errors = self._errors(self._at(structure, values))
            except InputError:  # a step to a pole at zero, which has no state of rest: no number, so it is not taken
                if not known:
                    raise
                return np.full(known[0], np.nan)
            known[:] = [len(errors)]
            return errors if used is None else errors * used

        unknowns = [self._unknown(self.plant.parameter(name), start[name]) for name in structure.free]
        by_chance = CRITERIA.by_chance / sum(len(e.output) for e in self.experiments)
        most, least = (
            (EFFORT.search_evaluations, min(EFFORT.coarse * by_chance, 1e-4))
            if rough
            else (EFFORT.refined_evaluations, EFFORT.fine * by_chance)
        )
        return estimate(residuals, unknowns, max_evaluations=most, tolerance=least)

    def _errors(self, parameters: Parameters) -> Array:
        """Weighted simulated minus measured, all experiments one after another."""

        def errors_of(i: int) -> list[Array]:
            e = self.experiments[i]
            simulated = e.respond(self.plant, parameters)[0]
            slope = start_slope(e, self.plant, parameters, (), 1.0 / e.weight, plain=simulated)
            return [with_free_start(e.telling((simulated - e.output) * e.weight), slope)]

        return side_by_side(errors_of, len(self.experiments))

    def _at(self, structure: Structure, values: Array) -> dict[str, float]:
        made = {**self.off, **structure.fixed, **dict(zip(structure.free, values.tolist(), strict=True))}
        if made.get("pair2_time", 0.0) > made.get("pair1_time", 0.0):  # the slower is the first, in every run and form
            for of in ("time", "damping"):
                made[f"pair1_{of}"], made[f"pair2_{of}"] = made[f"pair2_{of}"], made[f"pair1_{of}"]
        return made

    def _starts(self, structure: Structure, before: Parameters) -> Iterator[dict[str, float]]:
        for time_s in self._times(before):
            for given in structure.starts:
                scaled = {name: value * time_s ** self._power(name) for name, value in given.items()}
                yield {name: scaled.get(name, before[name]) for name in structure.free}

    def _of_samples(self, structure: Structure) -> Iterator[dict[str, float]]:
        """The start whose poles the samples themselves show."""
        if not _poles(structure) or structure.fixed or "dead_time" in structure.free:
            return
        if (found := self.poles(_poles(structure))) is not None:
            at = {**self.plant.typical, **pole_parameters(found)}
            yield {name: at[name] for name in structure.free}

    def _promising(self, structure: Structure, before: Parameters) -> list[dict[str, float]]:
        """Different starts, those first that leave least once what acts in proportion is fitted."""
        starts = (*self._starts(structure, before), *self._of_samples(structure))
        scaled = {tuple(start.values()): (left, start) for left, start in (self._scaled(structure, s) for s in starts)}
        return [start for _, start in sorted(scaled.values(), key=lambda each: each[0])]

    def _scaled(self, structure: Structure, start: Mapping[str, float]) -> tuple[float, dict[str, float]]:
        """A start with gain, offset, zeros and bend by linear least squares, and the sum of squares that is left."""
        gains = [name for name in _GAINS if name in structure.free]
        if not gains:
            errors = self._errors({**self.off, **structure.fixed, **start})
            return float(errors @ errors), dict(start)
        shares = [name for name in structure.free if name in _SHARES]
        at = {**self.plant.typical, **structure.fixed, **start, **dict.fromkeys(shares, 0.0), gains[0]: 1.0}
        at["offset"] = 0.0
        plain, wanted = self._answers(at), self._wanted()
        one = self._weighted([np.ones(len(e.output)) for e in self.experiments])
        rows = np.array([plain, *(self._answers(at | {name: 1.0}) - plain for name in shares), one])
        sizes = np.linalg.lstsq(rows.T, wanted, rcond=None)[0]
        left = wanted - sizes @ rows
        gain, *above, offset = sizes.tolist()
        ratios = {name: value / (gain or 1.0) for name, value in zip(shares, above, strict=True)}
        found = {**start, gains[0]: gain, "offset": offset, **ratios}
        return float(left @ left), {name: found[name] for name in structure.free}

    def _wanted(self) -> Array:
        return self._weighted([e.output for e in self.experiments])

    def _weighted(self, rows: Sequence[Array]) -> Array:
        """Rows in units of the noise, 0 where the output says nothing, all experiments one after another."""
        each = zip(self.experiments, rows, strict=True)
        return np.concatenate([e.telling(row * e.weight) for e, row in each])

    def _answers(self, parameters: Parameters) -> Array:
        """Weighted simulated outputs, all experiments one after another."""

        def answers_of(i: int) -> list[Array]:
            e = self.experiments[i]
            return [e.telling(e.respond(self.plant, parameters)[0] * e.weight)]

        return side_by_side(answers_of, len(self.experiments))

    def _times(self, before: Parameters) -> list[float]:
        """The slowest time known so far, or trial times between a sample and the record."""
        known = max((abs(before[p.name]) for p in self.plant.parameters if p.unit == "s"), default=0.0)
        if known > 0.0:
            return [known]
        interval_s = min(e.drive.interval_s for e in self.experiments)
        length_s = max(e.duration_s for e in self.experiments)
        return [float(t) for t in np.geomspace(2.0 * interval_s, length_s / 5.0, EFFORT.trial_times)]

    def _power(self, name: str) -> int:
        return {"s": 1, "s^2": 2}.get(self.plant.parameter(name).unit, 0)

    def _unknown(self, parameter: Parameter, start: float) -> Unknown:
        scale = self._natural(parameter)
        size = max(abs(start), 1e-3 * scale) if parameter.unit in ("s", "s^2") else scale
        return Unknown(parameter.name, parameter.unit, start, parameter.low, parameter.high, size)

    def _natural(self, parameter: Parameter) -> float:
        """The size of a parameter that these recordings suggest."""
        output = float(np.mean([np.std(e.output) for e in self.experiments])) or 1.0
        given = float(np.mean([np.std(e.drive.inputs[0]) for e in self.experiments])) or 1.0
        length_s = max(e.duration_s for e in self.experiments)
        natural = {
            "{output}": output, "{input}": given, "[{output}]/[{input}]": output / given, "1/[{input}]": 1.0 / given,
            "s": length_s, "s^2": length_s**2, "[{output}]/[{input}]/s": output / given / length_s,
        }  # fmt: skip
        return natural.get(parameter.unit, 1.0)
