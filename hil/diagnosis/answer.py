"""What a diagnosis says, put together from what was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from hil.diagnosis.changed import Changed
from hil.diagnosis.corrected import beyond_noise, corrected, standard_uncertainties
from hil.diagnosis.coverage import Limit, limits
from hil.diagnosis.decide import OPEN, has_drifted
from hil.diagnosis.diagnosis import (
    Candidate,
    ChangedParameter,
    Diagnosis,
    Finding,
    Fit,
    Left,
    NextTest,
    Quantity,
    Strip,
    Verdict,
)
from hil.diagnosis.events.event import Events
from hil.diagnosis.events.recognise import TOLERANCE_OF_EVENTS
from hil.diagnosis.evidence import (
    Judged,
    calibrated,
    indistinguishable,
    judge,
    probabilities,
    training_half,
)
from hil.diagnosis.false_alarms import FalseAlarms, false_alarms
from hil.diagnosis.happened import Happened
from hil.diagnosis.kept_back import fit_kept_back, kept_back, predicted
from hil.diagnosis.locate import StageShare, Where, locate, stages
from hil.diagnosis.measures import LAW_TOLERANCE, excess, share_left
from hil.diagnosis.named import predicted as predicted_change
from hil.diagnosis.never_worse import why_not_better
from hil.diagnosis.next_test import Span, next_test
from hil.diagnosis.pictures import spectra, strips
from hil.diagnosis.question import Question
from hil.diagnosis.search.around import around
from hil.diagnosis.search.fitted import Fitted, change_without, output_of
from hil.diagnosis.search.polish import roughly
from hil.diagnosis.search.terms import Term
from hil.diagnosis.wording import (
    drifted,
    headline,
    nothing_can_be_said,
    quantity_text,
    sentence,
    told_only_together,
    unlikely,
)
from hil.diagnosis.yardsticks import FEW, LISTED, MOST, PLAINLY
from hil.identification.fit import fit_ceiling, fit_percent
from hil.physics.compose import effect as installed_effect
from hil.physics.compose import effects as installed_effects
from hil.physics.model import Model
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array

# Judgement, not measurement; how often such probabilities were right is in docs/explanation/proof.md.
_MOST_SURE, _NOTHING_KNOWN, _ONE_IN_FIVE = 0.99, 0.95, 0.2


class Answer:
    """Puts together what a diagnosis says; computes what several parts need once.

    `asked`: the question. `changed`: the recordings beside those of before, where a gate answers it.
    """

    def __init__(
        self, found: Happened, warnings: tuple[str, ...], span: Span | None, asked: Question,
        changed: Changed | None = None,
    ) -> None:  # fmt: skip
        self.asked, self.changed = asked, changed
        self.found, self.warnings, self.span = found, warnings, span
        self.problem, self.choice, self.events = found.problem, found.choice, found.events
        self.judged = self._judged()
        self.verdict = _verdict(found)
        self.alike = found.choice.alike if self.verdict == "unexplained" else ()
        if not found.events and changed is None and self._is_doubted():
            self.alike = self._as_good() if self.verdict == "explained" else ()
            self.verdict = "unexplained"
        beside = not found.replaces_laws and found.choice.verdict != "unexplained"
        self.by_law = not found.events or beside
        self.named = found.choice.chosen if self.verdict != "unexplained" and self.by_law else found.choice.baseline
        self.kept = kept_back(self.problem, self.choice.chosen)
        self.used, self.held_out, self.why_nominal = self._used()

    @property
    def has_drifted(self) -> bool:
        """Whether the verdict is `consistent` because base parameters may wander."""
        consistent = self.verdict == "consistent"
        return consistent and has_drifted(self.problem, self.choice.nominal, self.choice.baseline)

    def _is_doubted(self) -> bool:
        """Whether what was chosen is improbable, as others are as good or data kept back speak against it."""
        names = self.choice.chosen.names
        likely = max((self._probability(name) for name in names), default=1.0)
        return likely < min(_ONE_IN_FIVE, self._none_of_these())

    def _as_good(self) -> tuple[str, ...]:
        """Names that would each explain everything, where there are several and none is more probable."""
        alike = [name for pair in self.choice.rivals for name in pair]
        return tuple(dict.fromkeys(alike))

    def _used(self) -> tuple[Fitted, Fit, str]:
        """What the corrected model holds, with the fits on data kept back, and why it is the nominal model, if it is.

        Only what is named stands in it, and only where that predicts better what no fit has seen. A name that does not
        stays, and that is said beside it.
        """
        nominal = self.choice.nominal
        before = fit_kept_back(self.problem, nominal.residuals, self.kept)
        most = fit_kept_back(self.problem, np.ones(len(nominal.residuals)), self.kept)
        proposed = self.named if self.named.terms or self.has_drifted else nominal
        if self.verdict == "unexplained" or proposed is nominal:
            return nominal, _rounded(before, before, most), "nothing is named that it would have to hold"
        residuals = self._predicted(proposed)
        after = fit_kept_back(self.problem, residuals, self.kept)
        why = why_not_better(self.problem, nominal.residuals, residuals, self.kept)
        if not why and (after < before or self._misses(proposed) > self._misses(nominal)):
            why = "it predicts worse what no fit has seen, or fits the recordings themselves worse"
        if why:
            return nominal, _rounded(before, before, most), why
        return proposed, _rounded(before, after, most), ""

    def _predicted(self, f: Fitted) -> Array:
        """Residuals where no fit has looked."""
        if self.changed is None:
            return predicted(self.problem, f, self.kept)
        return predicted_change(self.changed, f, self.kept)

    def _misses(self, f: Fitted) -> float:
        """The squared error of a free simulation of the recordings as they are, coloured noise and all."""
        errors = (e.telling(output_of(self.problem, f, e) - e.output) for e in self.problem.experiments)
        return sum(float(error @ error) for error in errors)

    def _judged(self) -> list[Judged]:
        """The chosen explanation and its closest competitors on data kept back, the chosen one first."""
        fits: list[Fitted] = [self.choice.chosen] if self.choice.chosen.terms else []
        names = {_name(f) for f in fits}
        for f in self.choice.candidates:
            if len(fits) < FEW and _name(f) not in names:
                names.add(_name(f))
                fits.append(f)
        return [judge(self.problem, f) for f in fits]

    @property
    def corrected(self) -> Model:
        """The model file's content."""
        return corrected(self.problem, self.used, self.verdict)

    def diagnosis(self, seconds: float) -> Diagnosis:
        """Everything that is said."""
        problem, plant = self.problem, self.problem.plant
        mismatch = self.verdict != "consistent"
        nominal = self.choice.nominal
        found = self._findings()
        changed = self._changed()
        drawn = strips(problem, self.used)
        fits = self._fits(drawn)
        left = self._left(drawn)
        shares = self._stage_shares(nominal) if mismatch else ()
        named = {f.name for f in found}
        everywhere = limits(around(problem, self.named), self.choice.terms, self._twins())
        unseen = tuple(limit for limit in everywhere if limit.effect not in named)
        rivals = self._not_separable()
        return Diagnosis(
            verdict=self.verdict,
            headline=self._headline(found, changed, left, self._hidden(unseen, fits)),
            plant=plant.name,
            plant_title=plant.title,
            input=problem.experiments[0].input,
            output=problem.experiments[0].output_heading,
            chain=tuple((hook.name, hook.stage) for hook in plant.hooks),
            effects=found,
            changed_parameters=changed,
            not_separable=rivals,
            next_test=self._next_test(rivals, [limit.effect for limit in unseen if not limit.visible]),
            candidates=self._candidates(),
            held_out=self.held_out,
            kept_back=self.kept.said,
            recordings=fits,
            mismatch=locate(problem, problem.outputs_of(nominal.residuals)) if mismatch else None,
            stage_shares=shares,
            left=left,
            limits=unseen,
            warnings=self._all_warnings(changed),
            false_alarms=self._false_alarms(),
            seconds=round(seconds, 3),
            strips=drawn,
            spectra=spectra(problem, nominal, self.used),
            question=self.asked.asked,
            why_asked=self.asked.why,
            gate=self._gate(),
            table=self.choice.table,
            left_out=self._left_out(fits),
            corrected_is="nominal" if self.used is nominal else "named",
            work=problem.work.as_dict(),
            why_corrected=self.why_nominal or "it is better than the nominal model on parts that no fit has seen",
        )

    def _twins(self) -> list[Fitted]:
        """Other explanations that these data do not exclude: what the chosen one leaves says how true laws are here."""
        if self.verdict == "consistent":
            return []
        least = self.choice.chosen.chi2
        most = max(least + indistinguishable(least), least + (PLAINLY - 1.0) * max(least - self.problem.size, 0.0))
        choice = self.choice
        found = (choice.chosen, *choice.candidates, *choice.descriptions, *choice.pairs)
        return [f for f in found if f.chi2 <= most]

    def _headline(self, found: Sequence[Finding], changed: Sequence[ChangedParameter], left: Left, hidden: str) -> str:
        is_cut = bool(self.problem.work.left_out)
        return headline(self.verdict, found, changed, left, hidden, self.alike, is_cut=is_cut)

    # -- findings ----------------------------------------------------------------------------------------

    def _findings(self) -> tuple[Finding, ...]:
        laws = self._law_findings()
        events = self._told_events()
        told = {name for e in events for name in e.told}
        return (*(self._event_finding(e) for e in events), *(law for law in laws if law.name not in told))

    def _told_events(self) -> list[Events]:
        """All but those that a law of their name is told instead of."""
        laws = self.choice.chosen.names if self.by_law and self.verdict != "unexplained" else ()
        return [e for e in self.events if e.name not in laws or not e.gives_way]

    def _law_findings(self) -> list[Finding]:
        """The greatest change first."""
        if self.verdict == "unexplained" or not self.by_law:
            return []
        f = self.choice.chosen
        changes = [change_without(self.problem, f, k) for k in range(len(f.terms))]
        order = sorted(range(len(f.terms)), key=lambda k: -float(changes[k] @ changes[k]))
        return [x for k in order if (x := self._finding(f, k, changes[k])) is not None]

    def _finding(self, f: Fitted, k: int, change: Array) -> Finding | None:
        """One term as a finding; `change`: what residuals would be without it, less what they are."""
        term, values = f.terms[k], f.values[k]
        name = term.effect_name(values)
        if not name:
            return None
        effect = installed_effect(term.name if term.kind == "effect" else name)
        quantities = self._quantities(f, term, values)
        where = locate(self.problem, self.problem.outputs_of(change))
        return Finding(
            name, effect.title, self._told_probability(name), term.stage, term.hook,
            quantities, where, sentence(effect, term, quantities), effect.equation, effect.source,
        )  # fmt: skip

    def _quantities(self, f: Fitted, term: Term, values: Sequence[float]) -> dict[str, Quantity]:
        stds = standard_uncertainties(f)
        if term.kind == "parameter":
            u = term.unknowns[0]
            std = stds.get((term.name, ""))
            return {
                term.name: Quantity(values[0], std, u.unit, self.problem.plant.parameter(term.name).meaning),
                "change": Quantity(values[0] - term.nominal, std, u.unit, "beyond the nominal model"),
            }
        effect = installed_effect(term.name)
        meanings, held = {p.name: p.meaning for p in effect.parameters}, dict(term.held)
        return {
            u.name: Quantity(
                float(v), stds.get((f"{term.name}.{u.name}", term.hook)), u.unit, meanings[u.name], held.get(u.name)
            )
            for u, v in zip(term.unknowns, values, strict=True)
        }

    def _event_finding(self, events: Events) -> Finding:
        effect = next((e for e in installed_effects() if e.name == events.name), None)
        difference = self.problem.outputs_of(events.residuals - self.choice.baseline.residuals)
        where = locate(self.problem, difference)
        spells = tuple((round(s.start_s, 3), round(s.stop_s, 3)) for s in events.spells)[:LISTED]
        if spells:
            where = replace(where, time_s=spells, recording=events.spells[0].recording)
        return Finding(
            events.name, effect.title if effect else events.name, calibrated(self._event_probability(events)),
            events.stage, events.hook,
            {name: Quantity(v, beyond_noise(std, v), unit) for name, (v, std, unit) in events.values.items()},
            where, events.sentence, events.equation, effect.source if effect else "",
        )  # fmt: skip

    def _changed(self) -> tuple[ChangedParameter, ...]:
        if self.verdict == "unexplained" or not self.by_law:
            return ()
        f = self.choice.chosen
        stds = standard_uncertainties(f)
        found = []
        for term, values in zip(f.terms, f.values, strict=True):
            if term.kind != "parameter":
                continue
            p, u = self.problem.plant.parameter(term.name), term.unknowns[0]
            std, at_bound = stds.get((p.name, "")), u.at_bound(values[0])
            found.append(ChangedParameter(p.name, term.nominal, float(values[0]), std, u.unit, p.meaning, at_bound))
        return tuple(found)

    # -- evidence ----------------------------------------------------------------------------------------

    def _none_of_these(self) -> float:
        """The probability that no explanation of the library is the true one."""
        if self.verdict == "unexplained":
            return _NOTHING_KNOWN
        return _something_else(self.choice.left, LAW_TOLERANCE)

    def _event_probability(self, events: Events) -> float:
        """Of events that were read off the recordings themselves, next to certain; else from what they leave."""
        if events is not self.choice.events:
            return _MOST_SURE
        return round(1.0 - _something_else(self._left_by(events), TOLERANCE_OF_EVENTS[events.name]), 3)

    def _left_by(self, events: Events) -> float:
        """The share of the misfit that events leave."""
        return share_left(self.problem, events.chi2, excess(self.problem, self.choice.baseline.chi2))

    def _chances(self) -> list[float]:
        return probabilities(self.judged, self._none_of_these())

    def _probability(self, name: str) -> float:
        """That an effect is there, whatever else is: over all explanations that have it, and not something unknown in
        its place.
        """
        if self.choice.chances:
            return round(min(self.choice.chances.get(name, 0.0), _MOST_SURE), 3)
        total = sum(p for p, j in zip(self._chances(), self.judged, strict=True) if name in j.fitted.names)
        total /= 1.0 - self._none_of_these()
        return round(min(total * (1.0 - self._something_instead(name)), _MOST_SURE), 3)

    def _told_probability(self, name: str) -> float:
        """As it is told: that of one score as it is, any other as often as such were right."""
        said = self._probability(name)
        return said if self.choice.chances else calibrated(said)

    def _something_instead(self, name: str) -> float:
        """The probability that what one member of the chosen explanation takes is something unknown's: the more of its
        own part of the misfit stays, the greater. For a single cause that part is the whole.
        """
        f = self.choice.chosen
        others = [k for k, (t, v) in enumerate(zip(f.terms, f.values, strict=True)) if t.effect_name(v) != name]
        if self.verdict == "unexplained" or not others or len(others) == len(f.terms):
            return self._none_of_these()
        return _something_else(self.choice.left / max(self._left_by_others(tuple(others)), 1e-12), LAW_TOLERANCE)

    @cache  # noqa: B019  lives as long as the answer
    def _left_by_others(self, keep: tuple[int, ...]) -> float:
        """The share of the misfit that some members of the chosen explanation leave without the others, at most all."""
        without = roughly(self.problem, self.choice.chosen.only(keep))
        left = share_left(self.problem, without.chi2, excess(self.problem, self.choice.baseline.chi2))
        return min(max(left, self.choice.left), 1.0)

    def _candidates(self) -> tuple[Candidate, ...]:
        if not self.judged:
            return ()
        held = ~training_half(self.problem)
        r = self.choice.nominal.residuals[held]
        nothing = float(r @ r)
        rows = [
            Candidate(
                _name(j.fitted), ", ".join(t.stage for t in j.fitted.terms),
                round(j.fit_held_out, 3), round(0.5 * (nothing - j.chi2_held_out), 1), round(p, 3),
                j.fitted.unknowns,
            )
            for j, p in zip(self.judged, self._chances(), strict=True)
        ]  # fmt: skip
        return tuple(sorted(rows, key=lambda c: -c.evidence))

    def _not_separable(self) -> tuple[tuple[str, ...], ...]:
        if (self.verdict == "unexplained" and not self.alike) or not self.by_law:
            return ()
        told = {name for e in self._told_events() for name in e.told}
        return tuple(names for names in self.choice.rivals if names[0] not in told)

    def _gate(self) -> Mapping[str, Any] | None:
        """The statistic that says whether the unit has changed; None where the search itself says so."""
        if self.changed is None:
            return None
        later, before = self.changed.later, self.changed.table.before
        column = self.changed.table.columns[later.column]
        return {
            "z": round(later.z, 2), "needed": round(self.changed.needed, 2), "is_alarm": self.changed.is_alarm,
            "is_unsure": self.changed.is_unsure, "shows_as": f"{column.name} {column.hook}".strip(),
            "pseudo_tests": [round(z, 2) for z in before.reach], "count_as_one": round(self.changed.as_one, 1),
            "explained_by_skeleton": round(1.0 - before.left, 3),
        }  # fmt: skip

    def _left_out(self, fits: Mapping[str, Fit]) -> Mapping[str, Any] | None:
        """What the model leaves out of recordings that ask what has changed: how far it reaches, and no search."""
        if self.asked.table is None:
            return None
        verdict: Verdict = "consistent" if self.changed is None else "unexplained"
        return {
            "verdict": verdict, "headline": _reaches(fits), "effects": [], "changed_parameters": [],
            "searched": self.changed is None,
        }  # fmt: skip

    def _hidden(self, unseen: Sequence[Limit], fits: Mapping[str, Fit]) -> str:
        """What is said in the place of an agreement: that the model had that misfit before, or that noise hides all."""
        if self.changed is not None:
            return f"The unit is unchanged since identification; {_reaches(fits)}."
        # of the recording that tells most: the half that is kept back may hold no more than a rest
        ceiling = max(fit.ceiling for fit in fits.values())
        share = (1.0 - ceiling / 100.0) ** 2  # of noise in the variance of what the output does
        if share <= MOST and any(limit.visible for limit in unseen):
            return ""
        return nothing_can_be_said(ceiling)

    def _false_alarms(self) -> FalseAlarms:
        problem = self.problem
        coloured = any(noise.colour or noise.hum_hz for noise in problem.noises)
        lasting_s = sum(e.duration_s for e in problem.experiments)
        return false_alarms(problem.plant.name, "coloured" if coloured else "white", lasting_s)

    # -- fits --------------------------------------------------------------------------------------------

    def _fits(self, drawn: Sequence[Strip]) -> dict[str, Fit]:
        """Of every recording, from the simulations that the report draws."""
        found = {}
        for e, strip in zip(self.problem.experiments, drawn, strict=True):
            keep = e.told
            nominal = fit_percent(e.output[keep], strip.nominal[keep])
            after = fit_percent(e.output[keep], strip.corrected[keep])
            most = fit_ceiling(e.output[keep], strip.noise_std)
            found[e.name] = _rounded(nominal, after, most)
        return found

    # -- places ------------------------------------------------------------------------------------------

    def _left(self, drawn: Sequence[Strip]) -> Left:
        problem, noise = self.problem, self.problem.noises[0]
        r = self.found.residuals if self.events else self.used.residuals
        share = self._left_by(self.events[-1]) if self.events else self.choice.left
        parts = enumerate(problem.output_slices())
        after = np.concatenate([problem.errors(i, r[part])[e.told] for (i, part), e in
                                zip(parts, problem.experiments, strict=True)])  # fmt: skip
        before = np.concatenate([strip.off(strip.nominal) for strip in drawn])
        rms, nominal = (float(np.sqrt(max(float(np.mean(x**2)) - noise.std**2, 0.0))) for x in (after, before))
        open_question = self.verdict in OPEN
        where: Where | None = locate(problem, self.problem.outputs_of(r)) if open_question else None
        curves = self._stage_shares(self.used) if open_question else ()
        return Left(round(share, 4), rms, noise.std, problem.model.output_unit, where, curves, nominal)

    def _stage_shares(self, f: Fitted) -> tuple[StageShare, ...]:
        effects: list[ActiveEffect] = [*self.problem.model.active_effects, *f.effects]
        return stages(self.problem, f.parameters, effects, f.residuals)

    # -- what else ---------------------------------------------------------------------------------------

    def _next_test(self, rivals: Sequence[Sequence[str]], unseen: Sequence[str]) -> NextTest | None:
        return next_test(self.problem, self.verdict, self.choice, rivals, unseen, self.span)

    def _all_warnings(self, changed: Sequence[ChangedParameter]) -> tuple[str, ...]:
        f = self.choice.chosen
        bounds = f.on_bound() if self.by_law else ()
        said = [f"{name} ended on a bound of its range: a warning, not physics" for name in bounds]
        if self.verdict == "unexplained" and f.terms:
            left = quantity_text(100 * self.choice.left, None, "%")
            said.append(
                f"the closest description ({_labels(f)}) leaves {left} of the misfit and is not named as the cause"
            )
        if self.has_drifted and not self.events and self.used is self.choice.baseline:
            said.append(self._drifted())
        said += [
            told_only_together(c, others, self.problem.prior.was(c.name, f.parameters))
            for c in changed
            if (others := self.problem.prior.told_only_with(c.name))
        ]
        if self.why_nominal and self.named.terms and self.verdict not in ("consistent", "unexplained"):
            said.append(f"the corrected model is the nominal one, without what is named: {self.why_nominal}")
        return (*self.warnings, *said, *unlikely(changed))

    def _drifted(self) -> str:
        """A word on the base parameters that had to move, those that show most of what the one does that shows most."""
        problem, model = self.problem, self.problem.model
        after = self.choice.baseline.parameters
        slopes = problem.base_jacobian(model.values, model.active_effects, problem.nominal_residuals)
        moves = np.array([after[p.name] - model.values[p.name] for p in problem.base])
        shown = np.abs(moves) * np.linalg.norm(slopes, axis=0)
        told = [p for p, size in zip(problem.base, shown, strict=True) if size >= MOST * shown.max()]
        return drifted(told, model.values, after)


def _verdict(found: Happened) -> Verdict:
    if not found.events:
        return found.choice.verdict
    return "partly_explained" if found.choice.verdict in OPEN and not found.replaces_laws else "explained"


def _reaches(fits: Mapping[str, Fit]) -> str:
    """How far the nominal model comes, on the recording that it fits worst."""
    worst = min(fits.values(), key=lambda fit: np.nan_to_num(fit.nominal, nan=np.inf))
    return f"the model itself reaches {worst.nominal:.3g} of {worst.ceiling:.4g} %"


def _rounded(nominal: float, corrected: float, most: float) -> Fit:
    """Fits in %; noise allows no less than what is reached."""
    reached = np.fmax(nominal, corrected)
    return Fit(round(nominal, 3), round(corrected, 3), round(float(np.fmax(most, reached)), 3))


def _labels(f: Fitted) -> str:
    return ", ".join(term.label for term in f.terms)


def _something_else(left: float, tolerance: float) -> float:
    """The probability that the truth is something else, from the share of the misfit that an explanation leaves.

    `tolerance`: the share at which it would no longer have been accepted; one in five of those at it may be wrong.
    """
    return float(np.clip(1.0 - _MOST_SURE + _ONE_IN_FIVE * left / tolerance, 0.0, 0.6))


def _name(f: Fitted) -> str:
    """`friction`, `dead_time + sensor_lag`, `pilot_rate` for a changed parameter."""
    labels = [t.effect_name(v) or t.name for t, v in zip(f.terms, f.values, strict=True)]
    return " + ".join(dict.fromkeys(labels))
