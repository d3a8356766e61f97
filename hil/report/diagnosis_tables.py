"""Tables of a diagnosis: fits, effects with their parameters, explanations, limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from hil.diagnosis.diagnosis import Candidate, ChangedParameter, Diagnosis, Finding, Fit, Quantity
from hil.diagnosis.evidence.coverage import Limit
from hil.diagnosis.evidence.locate import Where
from hil.diagnosis.thresholds import LISTED
from hil.language.note import translated
from hil.language.words import _
from hil.report.equation import equation_lines
from hil.report.name import capital, short_name, short_names
from hil.report.number import MINUS, fixed, grouped, number, rounded, unit_text, with_unit
from hil.report.section import Table
from hil.signals.interval import COVERED

_LEAST_GAP = 0.5  # points of fit: a smaller gap is mostly chance, and no share of it is stated


def fit_rows(d: Diagnosis) -> list[dict[str, str]]:
    """Fit of each recording and of the data kept back: nominal, corrected, ceiling."""
    names = short_names(d.recordings)
    rows = [_fit(names[name], fit) for name, fit in d.recordings.items()]
    return [*rows, _fit(_("data kept back"), d.held_out)]


def _fit(name: str, fit: Fit) -> dict[str, str]:
    return {
        "name": name, "nominal": decimals(fit.nominal), "corrected": decimals(fit.corrected),
        "ceiling": decimals(fit.ceiling), "closed": _closed(fit),
    }  # fmt: skip


def decimals(value: float) -> str:
    """A fit in per cent, to two decimals."""
    return fixed(value, 2) if math.isfinite(value) else number(value)


def _closed(fit: Fit) -> str:
    """The share of the gap to the ceiling that the correction closes."""
    gap = fit.ceiling - fit.nominal
    return f"{100.0 * (fit.corrected - fit.nominal) / gap:.0f} %".replace("-", MINUS) if gap > _LEAST_GAP else ""


def effect_entry(f: Finding) -> dict[str, Any]:
    """What the page says about an effect that was left out."""
    return {
        "title": capital(_(f.title)),
        "name": f.name,
        "probability": _probability(f.probability),
        "stage": _(f.stage),
        "hook": f.hook,
        "sentence": translated(f.sentence),
        "equation": equation_lines(f.equation),
        "source": f.source,
        "parameters": [_parameter(name, q) for name, q in f.parameters.items()],
        "place": place_facts(f.where),
    }


def _parameter(name: str, q: Quantity) -> dict[str, Any]:
    value, width = rounded(q.value, None if q.std is None else COVERED * q.std)
    return {"name": name, "meaning": _(q.meaning), "value": value, "width": width, "unit": unit_text(q.unit),
            "at_bound": False}  # fmt: skip


def _probability(p: float) -> str:
    return _("above 99 %") if p > 0.99 else _("below 1 %") if p < 0.01 else f"{100 * p:.0f} %"


def place_facts(where: Where | None) -> list[tuple[str, str]]:
    """Where a difference shows: region, frequency, time."""
    if where is None:
        return []
    low, high = where.frequency_hz
    times = ", ".join(f"{number(start)}…{number(stop)} s" for start, stop in where.time_s)
    return [
        (_("Operating region"), _(where.region)),
        (_("Frequency"), f"{number(low, 2)} … {number(high, 2)} Hz" if high > 0.0 else "—"),
        (
            _("Time"),
            _("{times} of {recording}").format(times=times, recording=short_name(where.recording))
            if times
            else _("no stretch of its own"),
        ),
    ]


def changed_rows(changed: Iterable[ChangedParameter]) -> list[dict[str, Any]]:
    """Base parameters that have changed, with what they were."""
    return [
        {
            **_parameter(c.name, Quantity(c.after, c.std, c.unit, c.meaning)),
            "before": number(c.before),
            "at_bound": c.at_bound,
        }
        for c in changed
    ]


def candidate_rows(
    candidates: Sequence[Candidate], effects: Sequence[Finding], changed: Sequence[ChangedParameter]
) -> list[dict[str, Any]]:
    """Explanations that were fitted, best first, with their evidence and how far it is behind the best.

    The one that holds every effect found, and nothing but these and the changed parameters, is marked; where there
    is none, each of the effects by itself.
    """
    most = max((c.evidence for c in candidates), default=0.0)
    named = {f.name for f in effects}
    whole = [c.name for c in candidates if named <= _parts(c) <= named | {p.name for p in changed}] if named else []
    marked = set(whole[:1]) or named
    return [
        {
            "name": " + ".join(_(part.replace("_", " ")) for part in c.name.split(" + ")),
            "stage": ", ".join(map(_, c.stage.split(", "))), "unknowns": c.unknowns or "",
            "fit": decimals(c.fit_held_out), "evidence": grouped(c.evidence),
            "behind": grouped(most - c.evidence) if c.evidence < most else _("best"),
            "share": max(0.0, min(1.0, c.evidence / most)) if most > 0.0 else 0.0,
            "probability": _probability(c.probability), "named": c.name in marked,
        }
        for c in candidates[:LISTED]
    ]  # fmt: skip


def _parts(candidate: Candidate) -> set[str]:
    return set(candidate.name.split(" + "))


def limit_table(limits: Sequence[Limit]) -> Table | None:
    """Effects that were not found: those that the data can speak of first."""
    if not limits:
        return None
    rows = [
        (
            _(limit.effect.replace("_", " ")), _(limit.stage),
            limit.parameter.replace("_", " ") + changed_from(limit),
            with_unit(limit.upper, limit.unit) if math.isfinite(limit.upper) else _("no limit"),
            with_unit(limit.typical, limit.unit),
            _("would be visible") if limit.visible else _("not visible in these data"),
        )
        for limit in sorted(limits, key=lambda limit: (limit.visible, limit.effect))
    ]  # fmt: skip
    heads = (
        _("Effect"),
        _("Stage"),
        _("Parameter"),
        _("At most (95 %)"),
        _("Typical size"),
        _("At its typical size it"),
    )
    return Table("", heads, tuple(rows), text_columns=(1, 2, 5))


def changed_from(limit: Limit) -> str:
    """` − 0.8 %` where a limit is that of a change of what the model has."""
    return f" − {with_unit(limit.about, limit.unit)}" if limit.about else ""
