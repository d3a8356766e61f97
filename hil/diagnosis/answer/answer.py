"""What a diagnosis says, put together from what was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np

from hil.diagnosis.answer.corrected import beyond_noise, corrected, standard_uncertainties
from hil.diagnosis.answer.next_test import Span, next_test
from hil.diagnosis.answer.pictures import spectra, strips
from hil.diagnosis.diagnosis import (
    Candidate,
    ChangedParameter,
    Diagnosis,
    DiagnosisVerdict,
    Finding,
    Fit,
    Left,
    Quantity,
    Strip,
)
from hil.diagnosis.events.event import Events
from hil.diagnosis.evidence.coverage import Limit, limits
from hil.diagnosis.evidence.cross_validation import (
    Judged,
    folds_of,
    held_out_fit,
    judge,
    predicted,
    training_half,
    why_not_better,
)
from hil.diagnosis.evidence.locate import StageShare, Where, locate, stages
from hil.diagnosis.false_alarms import false_alarms
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.question import Question
from hil.diagnosis.search.effort import EFFORT
from hil.diagnosis.search.fitted import Fitted, change_without, output_of
from hil.diagnosis.search.linearization import linearized
from hil.diagnosis.search.terms import Term
from hil.diagnosis.thresholds import FEW, LISTED, MOST
from hil.diagnosis.verdict.changed import Changed, refitted
from hil.diagnosis.verdict.choice import OPEN, Choice, has_drifted
from hil.diagnosis.wording import (
    confounded,
    drifted,
    headline,
    nothing_identifiable,
    sentence,
    unlikely,
)
from hil.identification.uncertainty.evidence import bic_of_known_noise
from hil.identification.uncertainty.fit import fit_ceiling, fit_percent
from hil.language.note import Note
from hil.physics.compose import effect as installed_effect
from hil.physics.compose import effects as installed_effects
from hil.physics.model import Model
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array

# Nothing is said to be surer.
_MOST_SURE = 0.99


class Answer:
    """Puts together what a diagnosis says; computes what several parts need once.

    `asked`: the question. `changed`: the recordings beside those of before, where a gate answers it.
    """

    def __init__(
        self, problem: Problem, choice: Choice, warnings: tuple[Note, ...], span: Span | None, asked: Question,
        changed: Changed | None = None,
    ) -> None:  # fmt: skip
        self.asked, self.changed = asked, changed
        self.warnings, self.span = warnings, span
        self.problem, self.choice, self.events = problem, choice, choice.events
        self.verdict = choice.verdict
        self.judged = self._judged()
        self.alike = choice.alike if self.verdict == "unexplained" else ()
        self.named = choice.chosen if self.verdict != "unexplained" else choice.baseline
        self.folds = folds_of(self.problem, self.choice.chosen, None if changed is None else changed.folds)
        self.used, self.held_out, self.why_nominal = self._used()

    def _used(self) -> tuple[Fitted, Fit, Note | None]:
        """What the corrected model holds, with the fits on data kept back, and why it is the nominal model, if it is.

        Only what is named stands in it, and only where that predicts better what no fit has seen. A name that does not
        stays, and that is said beside it.
        """
        nominal = self.choice.nominal
        before = held_out_fit(self.problem, nominal.residuals, self.folds.scored)
        most = held_out_fit(self.problem, np.ones(len(nominal.residuals)), self.folds.scored)
        proposed = self.named if self.named.terms or has_drifted(self.problem, self.choice) else nominal
        if self.verdict == "unexplained" or proposed is nominal:
            return nominal, _rounded(before, before, most), Note("nothing is named that it would have to hold")
        refit = None if self.changed is None else partial(refitted, self.changed, proposed)
        residuals = predicted(self.problem, proposed, self.folds, refit)
        after = held_out_fit(self.problem, residuals, self.folds.scored)
        why = why_not_better(self.problem, nominal.residuals, residuals, self.folds)
        if not why and (after < before or self._misses(proposed) > self._misses(nominal)):
            why = Note("it predicts worse what no fit has seen, or fits the recordings themselves worse")
        if why:
            return nominal, _rounded(before, before, most), why
        return proposed, _rounded(before, after, most), None

    def _misses(self, f: Fitted) -> float:
        """The squared error of a free simulation of the recordings as they are, coloured noise and all."""
        errors = (e.telling(output_of(self.problem, f, e) - e.output) for e in self.problem.experiments)
        return sum(float(error @ error) for error in errors)

    def _judged(self) -> list[Judged]:
        """The chosen explanation and its closest competitors on data kept back, the chosen one first.

        What another one needs all of adds nothing to it; and where laws only describe, the closest of them is one.
        """
        lasting = [f for f in self.choice.candidates if not _runs_by_clock(f)]
        closest = min(lasting, key=lambda f: bic_of_known_noise(f.chi2, self.problem.size, f.unknowns), default=None)
        fits: list[Fitted] = []
        for f in (self.choice.chosen, *self.choice.candidates):
            is_news = len(fits) < FEW and not any(_labels(g) <= _labels(f) for g in fits)
            if f.terms and (is_news or f is closest):
                fits.append(f)
        return [judge(self.problem, f) for f in fits]

    @property
    def corrected(self) -> Model:
        """The model file's content."""
        return corrected(self.problem, self.used, self.verdict)

    def diagnosis(self, seconds: float) -> Diagnosis:
        """Everything that is said."""
        problem, plant, table = self.problem, self.problem.plant, self.choice.table
        mismatch = self.verdict != "consistent"
        nominal = self.choice.nominal
        found = self._findings()
        changed = self._changed()
        drawn = strips(problem, self.used)
        fits = self._fits(drawn)
        left = self._left(drawn)
        shares = self._stage_shares(nominal) if mismatch else ()
        named = {f.name for f in found}
        everywhere = limits(linearized(problem, self.named), self.choice.terms, self.choice.twins if mismatch else ())
        unseen = tuple(limit for limit in everywhere if limit.effect not in named)
        rivals = self._not_separable()
        return Diagnosis(
            verdict=self.verdict,
            headline=headline(
                self.verdict,
                found,
                changed,
                left,
                self._hidden(unseen, fits),
                self.alike,
                is_cut=bool(problem.work.left_out),
                is_change=self.changed is not None,
            ),
            plant=plant.name,
            plant_title=plant.title,
            input=problem.experiments[0].input,
            output=problem.experiments[0].output_heading,
            chain=tuple((hook.name, hook.stage) for hook in plant.hooks),
            effects=found,
            changed_parameters=changed,
            not_separable=rivals,
            next_test=next_test(
                problem, self.verdict, self.choice, rivals, [x.effect for x in unseen if not x.visible], self.span
            ),
            candidates=self._candidates(),
            held_out=self.held_out,
            kept_back=self.folds.basis,
            recordings=fits,
            mismatch=locate(problem, problem.outputs_of(nominal.residuals)) if mismatch else None,
            stage_shares=shares,
            left=left,
            limits=unseen,
            warnings=self._all_warnings(changed),
            false_alarms=false_alarms(self.problem.plant.name, self.asked.asked),
            seconds=round(seconds, 3),
            strips=drawn,
            spectra=spectra(problem, nominal, self.used),
            question=self.asked.asked,
            why_asked=self.asked.why,
            gate=self._gate(),
            table=None if table is None else {**table.as_dict(LISTED), "effort": asdict(EFFORT)},
            left_out=self._left_out(fits),
            corrected_is="nominal" if self.used is nominal else "named",
            work=problem.work.as_dict(),
            why_corrected=self.why_nominal or Note("it is better than the nominal model on parts that no fit has seen"),
        )

    # -- findings ----------------------------------------------------------------------------------------

    def _findings(self) -> tuple[Finding, ...]:
        events = [self._event_finding(e) for e in self.events]
        hidden = {name for e in self.events for name in e.names}
        return (*events, *(law for law in self._law_findings() if law.name not in hidden))

    def _law_findings(self) -> list[Finding]:
        """The greatest change first."""
        if self.verdict == "unexplained":
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
            name, effect.title, self._probability(name), term.stage, term.hook,
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
        intervals = tuple((round(s.start_s, 3), round(s.stop_s, 3)) for s in events.intervals)[:LISTED]
        if intervals:
            where = replace(where, time_s=intervals, recording=events.intervals[0].recording)
        return Finding(
            events.name, effect.title if effect else events.name, self._probability(events.name),
            events.stage, events.hook,
            {name: Quantity(v, beyond_noise(std, v), unit) for name, (v, std, unit) in events.values.items()},
            where, events.sentence, events.equation, effect.source if effect else "",
        )  # fmt: skip

    def _changed(self) -> tuple[ChangedParameter, ...]:
        if self.verdict == "unexplained":
            return ()
        f = self.choice.chosen
        stds = standard_uncertainties(f)
        found = []
        for term, values in f.pairs:
            if term.kind != "parameter":
                continue
            p, u = self.problem.plant.parameter(term.name), term.unknowns[0]
            std, at_bound = stds.get((p.name, "")), u.at_bound(values[0])
            found.append(ChangedParameter(p.name, term.nominal, float(values[0]), std, u.unit, p.meaning, at_bound))
        return tuple(found)

    # -- evidence ----------------------------------------------------------------------------------------

    def _probability(self, name: str) -> float:
        """That an effect is there, whatever else is: over all rows of the table."""
        return round(min(self.choice.chances.get(name, _MOST_SURE), _MOST_SURE), 3)

    def _candidates(self) -> tuple[Candidate, ...]:
        if not self.judged:
            return ()
        held = ~training_half(self.problem)
        r = self.choice.nominal.residuals[held]
        nothing = float(r @ r)
        rows = [
            Candidate(
                _name(j.fitted), ", ".join(t.stage for t in j.fitted.terms),
                round(j.fit_held_out, 3), round(0.5 * (nothing - j.chi2_held_out), 1),
                min(map(self._probability, j.fitted.names), default=0.0), j.fitted.unknowns,
            )
            for j in self.judged
        ]  # fmt: skip
        return tuple(sorted(rows, key=lambda c: -c.evidence))

    def _not_separable(self) -> tuple[tuple[str, ...], ...]:
        if self.verdict == "unexplained":
            return (self.alike,) if len(self.alike) > 1 else ()
        sides = {event.shows_as for event in self.choice.events}  # another side of what is named has no rivals
        return tuple(names for names in self.choice.rivals if sides.isdisjoint(names))

    def _gate(self) -> Mapping[str, Any] | None:
        """The statistic that says whether the unit has changed; None where the search itself says so."""
        if self.changed is None:
            return None
        later, before = self.changed.later, self.changed.table.before
        column = self.changed.table.columns[later.column]
        return {
            "z": round(later.z, 2), "needed": round(self.changed.needed, 2), "is_alarm": self.changed.is_alarm,
            "is_unsure": self.changed.is_unsure, "shows_as": f"{column.name} {column.hook}".strip(),
            "pseudo_tests": [round(z, 2) for z in before.reach], "count_as_one": round(self.changed.correlated_rows, 1),
            "explained_by_skeleton": round(1.0 - before.left, 3),
        }  # fmt: skip

    def _left_out(self, fits: Mapping[str, Fit]) -> Mapping[str, Any] | None:
        """What the model leaves out of recordings that ask what has changed: how far it reaches, and no search."""
        if self.asked.table is None:
            return None
        verdict: DiagnosisVerdict = "consistent" if self.changed is None else "unexplained"
        return {
            "verdict": verdict, "headline": self._reaches(fits), "effects": [], "changed_parameters": [],
            "searched": self.changed is None,
        }  # fmt: skip

    def _hidden(self, unseen: Sequence[Limit], fits: Mapping[str, Fit]) -> Note | None:
        """What is said in the place of an agreement: that the model had that misfit before, or that noise hides all."""
        if self.changed is not None:
            return Note("The unit is unchanged since identification; {reaches}.", reaches=self._reaches(fits))
        # of the recording that tells most: the half that is kept back may hold no more than a rest
        ceiling = max(fit.ceiling for fit in fits.values())
        share = (1.0 - ceiling / 100.0) ** 2  # of noise in the variance of what the output does
        if share <= MOST and any(limit.visible for limit in unseen):
            return None
        return nothing_identifiable(ceiling)

    def _reaches(self, fits: Mapping[str, Fit]) -> Note:
        """How far the nominal model comes, on the recording that it fits worst, and how far it came then."""
        worst = min(fits.values(), key=lambda fit: np.nan_to_num(fit.nominal, nan=np.inf))
        reaches = Note(
            "the model itself reaches {fit:.3g} of {ceiling:.4g} %", fit=worst.nominal, ceiling=worst.ceiling
        )
        before = (self.problem.model.origin.get("fit_percent") or {}).values()
        return Note("{reaches}, at identification {fit:.3g} %", reaches=reaches, fit=min(before)) if before else reaches

    # -- fits --------------------------------------------------------------------------------------------

    def _fits(self, drawn: Sequence[Strip]) -> dict[str, Fit]:
        """Of every recording, from the simulations that the report draws."""
        found = {}
        for e, strip in zip(self.problem.experiments, drawn, strict=True):
            keep = e.valid
            nominal = fit_percent(e.output[keep], strip.nominal[keep])
            after = fit_percent(e.output[keep], strip.corrected[keep])
            most = fit_ceiling(e.output[keep], strip.noise_std)
            found[e.name] = _rounded(nominal, after, most)
        return found

    # -- places ------------------------------------------------------------------------------------------

    def _left(self, drawn: Sequence[Strip]) -> Left:
        problem, noise = self.problem, self.problem.noises[0]
        r, share = self.used.residuals if self.choice.residuals is None else self.choice.residuals, self.choice.left
        parts = enumerate(problem.output_slices())
        after = np.concatenate([problem.errors(i, r[part])[e.valid] for (i, part), e in
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

    def _all_warnings(self, changed: Sequence[ChangedParameter]) -> tuple[Note, ...]:
        f = self.choice.chosen
        notes = [
            Note("{name} ended on a bound of its range: a warning, not physics", name=name) for name in f.on_bound()
        ]
        if self.verdict == "unexplained" and self.judged:
            closest = min(self.judged, key=lambda j: j.chi2_held_out).fitted
            names = tuple(sorted(_labels(closest)))
            notes.append(Note("the closest description ({names}) is not named as the cause", names=names))
        if has_drifted(self.problem, self.choice) and not self.events and self.used is self.choice.baseline:
            notes.append(self._drifted())
        notes += [
            confounded(c, others, self.problem.prior.was(c.name, f.parameters))
            for c in changed
            if (others := self.problem.prior.confounded_with(c.name))
        ]
        if self.why_nominal and self.named.terms and self.verdict not in ("consistent", "unexplained"):
            notes.append(
                Note("the corrected model is the nominal one, without what is named: {why}", why=self.why_nominal)
            )
        return (*self.warnings, *notes, *unlikely(changed))

    def _drifted(self) -> Note:
        """A word on the base parameters that had to move, those that show most of what the one does that shows most."""
        problem, model = self.problem, self.problem.model
        after = self.choice.baseline.parameters
        slopes = problem.base_jacobian(model.values, model.active_effects, problem.nominal_residuals)
        moves = np.array([after[p.name] - model.values[p.name] for p in problem.base])
        shown = np.abs(moves) * np.linalg.norm(slopes, axis=0)
        moved = [p for p, size in zip(problem.base, shown, strict=True) if size >= MOST * shown.max()]
        return drifted(moved, model.values, after)


def _rounded(nominal: float, corrected: float, most: float) -> Fit:
    """Fits in %; noise allows no less than what is reached."""
    reached = np.fmax(nominal, corrected)
    return Fit(round(nominal, 3), round(corrected, 3), round(float(np.fmax(most, reached)), 3))


def _labels(f: Fitted) -> frozenset[str]:
    return frozenset(term.label for term in f.terms)


def _runs_by_clock(f: Fitted) -> bool:
    """Whether it describes one recording and no other."""
    return not f.terms or any(term.by_clock for term in f.terms)


def _name(f: Fitted) -> str:
    """`friction`, `dead_time + sensor_lag`, `pilot_rate` for a changed parameter."""
    labels = [t.effect_name(v) or t.name for t, v in f.pairs]
    return " + ".join(dict.fromkeys(labels))
