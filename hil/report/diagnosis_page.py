"""The report of a diagnosis: verdict, before and after, what was left out, where, and what the data cannot show."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from hil.diagnose.coverage import Limit
from hil.diagnose.diagnosis import (
    Candidate,
    ChangedParameter,
    Diagnosis,
    Finding,
    Fit,
    NextTest,
    Quantity,
    Spectrum,
    Strip,
)  # fmt: skip
from hil.diagnose.locate import StageShare, Where
from hil.report.diagnosis_figures import (
    before_and_after,
    close_up,
    noise_of,
    region_bars,
    residual_spectrum,
    stage_curves,
    time_strips,
)  # fmt: skip
from hil.report.equation import equation_lines
from hil.report.figure import Picture
from hil.report.name import short_names
from hil.report.number import MINUS, grouped, number, rounded, unit_text
from hil.report.page import write_page
from hil.report.section import Table

_COVERAGE_95 = 1.96
_MOST_CANDIDATES = 12
_MOST_STAGES = 3
_LEAST_GAP = 0.5  # points of fit: a smaller gap is mostly chance, and no share of it is stated

_VERDICTS = {
    "consistent": ("good", "Consistent"),
    "parameter_change": ("told", "Changed parameters"),
    "explained": ("told", "Explained"),
    "partly_explained": ("open", "Partly explained"),
    "unexplained": ("bad", "Unexplained"),
}


def write_diagnosis_report(diagnosis: Diagnosis, path: Path) -> None:
    """Write the page of a diagnosis.

    Raises:
        StorageError: it cannot be written.
    """
    d = diagnosis
    tone, word = _VERDICTS[d.verdict]
    corrected = _is_corrected(d)
    write_page(
        "diagnosis.html", path,
        kicker="Diagnosis",
        title=f"{d.plant_title[:1].upper()}{d.plant_title[1:]}",
        tone=tone,
        word=word,
        headline=d.headline,
        details=_details(d),
        warnings=d.warnings,
        corrected=corrected,
        overlays=_overlays(d, corrected=corrected),
        fits=_fits(d),
        effects=[_effect(f) for f in d.effects],
        changed=_changed(d.changed_parameters),
        place=_place(d.mismatch),
        time=_time(d, corrected=corrected),
        spectra=_spectra(d, corrected=corrected),
        regions=_regions(d, corrected=corrected),
        chain=_chain(d),
        candidates=_candidates(d.candidates, d.effects),
        not_separable=_rivals(d, "or"),
        settled=d.verdict not in ("partly_explained", "unexplained") and not d.not_separable,
        left=_left(d),
        limits=_limits(d.limits),
        next_test=_next_test(d.next_test),
        about=_about(d),
    )  # fmt: skip


def _is_corrected(d: Diagnosis) -> bool:
    """Whether the corrected model says anything else than the nominal one."""
    return bool(d.effects or d.changed_parameters)


def _details(d: Diagnosis) -> list[str]:
    f = d.held_out
    fit = (
        f"On data kept back the nominal model fits {_percent(f.nominal)}, the corrected one {_percent(f.corrected)}; "
        f"noise allows {_percent(f.ceiling)}."
        if _is_corrected(d)
        else f"On data kept back the model fits {_percent(f.nominal)}; noise allows {_percent(f.ceiling)}."
    )
    fits = [fit] if math.isfinite(f.ceiling) and math.isfinite(f.nominal) else []
    return [*fits, *(f"These data cannot tell {names} apart." for names in _rivals(d, "and"))]


def _rivals(d: Diagnosis, word: str) -> list[str]:
    return [f" {word} ".join(name.replace("_", " ") for name in names) for names in d.not_separable]


def _percent(value: float) -> str:
    return f"{_decimals(value)} %"


def _overlays(d: Diagnosis, *, corrected: bool) -> list[Picture]:
    strip = _shown_strip(d)
    if strip is None:
        return []
    whole = before_and_after(strip, d.output, d.mismatch, corrected=corrected)
    part = close_up(strip, d.input, d.output, corrected=corrected)
    return [whole] if part is None else [whole, part]


def _shown_strip(d: Diagnosis) -> Strip | None:
    """The recording in which the nominal model is farthest off."""
    if d.mismatch is not None:
        named = [strip for strip in d.strips if strip.name == d.mismatch.recording]
        if named:
            return named[0]
    return max(d.strips, key=lambda s: float((((s.measured - s.nominal) / noise_of(s)) ** 2).mean()), default=None)


def _fits(d: Diagnosis) -> list[dict[str, str]]:
    names = short_names(d.recordings)
    rows = [_fit(names[name], fit) for name, fit in d.recordings.items()]
    return [*rows, _fit("data kept back", d.held_out)]


def _fit(name: str, fit: Fit) -> dict[str, str]:
    return {
        "name": name, "nominal": _decimals(fit.nominal), "corrected": _decimals(fit.corrected),
        "ceiling": _decimals(fit.ceiling), "closed": _closed(fit),
    }  # fmt: skip


def _decimals(value: float) -> str:
    return f"{value:.2f}".replace("-", MINUS) if math.isfinite(value) else number(value)


def _closed(fit: Fit) -> str:
    """The share of the gap to the ceiling that the correction closes."""
    gap = fit.ceiling - fit.nominal
    return f"{100.0 * (fit.corrected - fit.nominal) / gap:.0f} %".replace("-", MINUS) if gap > _LEAST_GAP else ""


def _effect(f: Finding) -> dict[str, Any]:
    return {
        "title": f"{f.title[:1].upper()}{f.title[1:]}",
        "name": f.name,
        "probability": _probability(f.probability),
        "stage": f.stage,
        "hook": f.hook,
        "sentence": f.sentence,
        "equation": equation_lines(f.equation),
        "source": f.source,
        "parameters": [_parameter(name, q) for name, q in f.parameters.items()],
        "place": _place(f.where),
    }


def _parameter(name: str, q: Quantity) -> dict[str, Any]:
    value, width = rounded(q.value, None if q.std is None else _COVERAGE_95 * q.std)
    return {"name": name, "meaning": q.meaning, "value": value, "width": width, "unit": unit_text(q.unit),
            "at_bound": False}  # fmt: skip


def _probability(p: float) -> str:
    return "above 99 %" if p > 0.99 else "below 1 %" if p < 0.01 else f"{100 * p:.0f} %"


def _place(where: Where | None) -> list[tuple[str, str]]:
    if where is None:
        return []
    low, high = where.frequency_hz
    times = ", ".join(f"{number(start)}…{number(stop)} s" for start, stop in where.time_s)
    return [
        ("Operating region", where.region),
        ("Frequency", f"{number(low, 2)} … {number(high, 2)} Hz" if high > 0.0 else "—"),
        (
            "Time",
            f"{times} of {next(iter(short_names([where.recording]).values()))}" if times else "no stretch of its own",
        ),
    ]


def _changed(changed: Iterable[ChangedParameter]) -> list[dict[str, Any]]:
    return [
        {
            **_parameter(c.name, Quantity(c.after, c.std, c.unit, c.meaning)),
            "before": number(c.before),
            "at_bound": c.at_bound,
        }
        for c in changed
    ]


def _time(d: Diagnosis, *, corrected: bool) -> Picture | None:
    return time_strips(d.strips, d.mismatch, corrected=corrected) if d.strips else None


def _spectra(d: Diagnosis, *, corrected: bool) -> list[Picture]:
    """The spectrum of the recording that is farthest off, and of the one with the command's own lines."""
    usable = [s for s in d.spectra if len(s.frequency_hz) > 2]
    strip = _shown_strip(d)
    chosen: list[Spectrum] = [s for s in usable if strip is not None and s.name == strip.name] or usable[:1]
    if not any(s.lines_hz for s in chosen):
        chosen += [s for s in usable if s.lines_hz and s not in chosen][:1]
    unit = d.output.partition("[")[2].partition("]")[0]
    return [residual_spectrum(f"spectrum-{k}", s, d.mismatch, unit, corrected=corrected) for k, s in enumerate(chosen)]


def _regions(d: Diagnosis, *, corrected: bool) -> Picture | None:
    if d.mismatch is None or not d.mismatch.shares:
        return None
    after = d.left.where.shares if corrected and d.left.where is not None else None
    return region_bars(d.mismatch.shares, after)


def _chain(d: Diagnosis) -> dict[str, Any]:
    """The signal's way: stages in order, each with its places, their share of the misfit, and what was found there."""
    shares = {s.hook: s.share for s in d.stage_shares}
    stages = []
    for stage, members in groupby(d.chain, key=lambda pair: pair[1]):
        names = [hook for hook, _stage in members]
        hooks = [
            {"name": name, "share": shares.get(name), "found": [f.title for f in d.effects if f.hook == name]}
            for name in names
        ]
        elsewhere = [f.title for f in d.effects if f.stage == stage and f.hook not in names]
        named = bool(elsewhere) or any(hook["found"] for hook in hooks)
        stages.append({"name": stage, "hooks": hooks, "found": elsewhere, "named": named})
    return {"input": d.input, "output": d.output, "stages": stages, "shares": bool(shares)}


def _candidates(candidates: Sequence[Candidate], effects: Sequence[Finding]) -> list[dict[str, Any]]:
    most = max((c.evidence for c in candidates), default=0.0)
    named = {f.name for f in effects}
    return [
        {
            "name": c.name, "stage": c.stage, "fit": _decimals(c.fit_held_out), "evidence": grouped(c.evidence),
            "behind": grouped(most - c.evidence) if c.evidence < most else "best",
            "share": max(0.0, min(1.0, c.evidence / most)) if most > 0.0 else 0.0,
            "probability": _probability(c.probability), "named": c.name in named,
        }
        for c in candidates[:_MOST_CANDIDATES]
    ]  # fmt: skip


def _left(d: Diagnosis) -> dict[str, Any]:
    left = d.left
    stages: tuple[StageShare, ...] = ()
    if d.verdict in ("partly_explained", "unexplained"):
        stages = tuple(s for s in left.stages if s.share > 0.0)[:_MOST_STAGES]
    return {
        "explained": d.verdict in ("consistent", "explained", "parameter_change"),
        "rms": _with_unit(left.rms, left.unit),
        "noise": _with_unit(left.noise_std, left.unit),
        "share": f"{number(100.0 * left.share, 2)} %"
        if d.verdict != "consistent" and math.isfinite(left.share)
        else "",
        "place": _place(left.where),
        "picture": stage_curves(stages, "left-over") if stages else None,
    }


def _limits(limits: Sequence[Limit]) -> Table | None:
    """Effects that were not found: those that the data can speak of first."""
    if not limits:
        return None
    rows = [
        (
            limit.effect.replace("_", " "), limit.stage, limit.parameter.replace("_", " "),
            _with_unit(limit.upper, limit.unit) if math.isfinite(limit.upper) else "no limit",
            _with_unit(limit.typical, limit.unit),
            "would have been seen" if limit.visible else "cannot be seen in these data",
        )
        for limit in sorted(limits, key=lambda limit: (limit.visible, limit.effect))
    ]  # fmt: skip
    heads = ("Effect", "Stage", "Parameter", "At most (95 %)", "Typical size", "At its typical size it")
    return Table("", heads, tuple(rows), text_columns=(1, 2, 5))


def _with_unit(value: float, unit: str) -> str:
    return f"{number(value, 3)} {unit_text(unit)}".rstrip()


def _next_test(test: NextTest | None) -> dict[str, Any] | None:
    if test is None:
        return None
    settings = [f"--set {shlex.quote(f'{name}={_setting(value)}')}" for name, value in test.settings.items()]
    return {
        "command": " ".join(["hil run", test.procedure, *settings, "--bench BENCH.toml"]),
        "why": test.why,
        "seconds": f"{number(test.bench_s, 3)} s of bench time",
    }


def _setting(value: Any) -> str:
    return ",".join(f"{v:g}" for v in value) if isinstance(value, tuple | list) else str(value)


def _about(d: Diagnosis) -> list[tuple[str, str]]:
    rows: Mapping[str, str] = {
        "Plant": d.plant,
        "Input → output": f"{d.input} → {d.output}",
        "Recordings": ", ".join(d.recordings),
        "False alarms": f"{100 * d.false_alarm_rate:.2g} % of units without any effect are not called consistent",
        "Computed in": f"{number(d.seconds, 3)} s",
    }
    return [(label, value) for label, value in rows.items() if value]
