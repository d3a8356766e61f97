"""The report of a diagnosis: verdict, before and after, what was left out, where, and what the data cannot show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from hil.diagnosis.diagnosis import Diagnosis, NextTest, Spectrum, Strip
from hil.diagnosis.evidence.locate import StageShare
from hil.language.note import translated
from hil.language.words import _, marked
from hil.physics.other_plant import other_plants
from hil.report.diagnosis_figures import (
    before_and_after,
    close_up,
    noise_of,
    region_bars,
    residual_spectrum,
    stage_curves,
    time_strips,
)
from hil.report.diagnosis_tables import (
    candidate_rows,
    changed_rows,
    decimals,
    effect_entry,
    fit_rows,
    limit_table,
    place_facts,
)
from hil.report.figure import Picture
from hil.report.name import capital
from hil.report.number import number, with_unit
from hil.report.origins import Origin, origin_facts
from hil.report.page import page, write_page

_MOST_STAGES = 3
_VERDICTS = {
    "consistent": ("good", marked("Consistent")),
    "parameter_change": ("told", marked("Changed parameters")),
    "explained": ("told", marked("Explained")),
    "partly_explained": ("open", marked("Partly explained")),
    "unexplained": ("bad", marked("Unexplained")),
}


@page
def write_diagnosis_report(diagnosis: Diagnosis, path: Path, origins: Sequence[Origin] = ()) -> None:
    """Write the page of a diagnosis.

    Args:
        diagnosis: what it says.
        path: of the page.
        origins: of the recordings and the model.

    Raises:
        StorageError: it cannot be written.
    """
    d = diagnosis
    tone, word = _VERDICTS[d.verdict]
    corrected = _is_corrected(d)
    above = [note for note in other_plants(d.plant, ((one.name, one.about) for one in origins)) if note in d.warnings]
    write_page(
        "diagnosis.html", path,
        simulated=d.simulated,
        kicker=_("Diagnosis"),
        title=capital(d.plant_title),
        tone=tone,
        word=_(word),
        headline=translated(d.headline),
        details=_details(d),
        above=list(map(translated, above)),
        warnings=[translated(note) for note in d.warnings if note not in above],
        corrected=corrected,
        overlays=_overlays(d, corrected=corrected),
        fits=fit_rows(d),
        effects=[effect_entry(f) for f in d.effects],
        changed=changed_rows(d.changed_parameters),
        place=place_facts(d.mismatch),
        time=_time(d, corrected=corrected),
        spectra=_spectra(d, corrected=corrected),
        regions=_regions(d, corrected=corrected),
        chain=_chain(d),
        candidates=candidate_rows(d.candidates, d.effects, d.changed_parameters),
        not_separable=_rivals(d, _("or")),
        settled=d.verdict not in ("partly_explained", "unexplained") and not d.not_separable,
        left=_left_over(d, corrected=corrected),
        limits=limit_table(d.limits),
        next_test=_next_test(d.next_test),
        about=_about(d),
        origins=origin_facts(origins),
    )  # fmt: skip


def _is_corrected(d: Diagnosis) -> bool:
    """Whether the corrected model says anything else than the nominal one: by a name, or a description without one."""
    fits_differ = any(abs(fit.corrected - fit.nominal) > 0.0 for fit in d.recordings.values())
    return bool(d.effects or d.changed_parameters) or (d.verdict == "unexplained" and fits_differ)


def _details(d: Diagnosis) -> list[str]:
    f = d.held_out
    fit = (
        _("On data kept back the nominal model fits {nominal}, the corrected one {corrected}; noise allows {ceiling}.")
        if _is_corrected(d)
        else _("On data kept back the model fits {nominal}; noise allows {ceiling}.")
    )
    fit = fit.format(nominal=_percent(f.nominal), corrected=_percent(f.corrected), ceiling=_percent(f.ceiling))
    fits = [fit] if math.isfinite(f.ceiling) and math.isfinite(f.nominal) else []
    return [*fits, *(_("These data cannot tell {names} apart.").format(names=names) for names in _rivals(d, _("and")))]


def _rivals(d: Diagnosis, word: str) -> list[str]:
    return [f" {word} ".join(_(name.replace("_", " ")) for name in names) for names in d.not_separable]


def _percent(value: float) -> str:
    return f"{decimals(value)} %"


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
    return max(d.strips, key=lambda s: float(((s.off(s.nominal) / noise_of(s)) ** 2).mean()), default=None)


def _time(d: Diagnosis, *, corrected: bool) -> Picture | None:
    return time_strips(d.strips, d.mismatch, corrected=corrected) if d.strips else None


def _spectra(d: Diagnosis, *, corrected: bool) -> list[Picture]:
    """The spectrum of the recording that is farthest off, and of the one with the command's own lines."""
    usable = [s for s in d.spectra if len(s.frequency_hz) > 2 and s.frequency_hz[0] > 0.0]
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
    places = {hook for hook, _stage in d.chain}
    stages: list[dict[str, Any]] = []
    for stage, members in groupby(d.chain, key=lambda pair: pair[1]):
        names = [hook for hook, _stage in members]
        hooks = [_place(name, shares.get(name), [f.title for f in d.effects if f.hook == name]) for name in names]
        again = any(other["name"] == stage for other in stages)
        unplaced = [f.title for f in d.effects if f.stage == stage and f.hook not in places and not again]
        named = bool(unplaced) or any(hook["found"] for hook in hooks)
        stages.append({"name": stage, "hooks": hooks, "found": unplaced, "named": named})
    return {"input": d.input, "output": d.output, "stages": stages, "shares": bool(shares)}


def _place(hook: str, share: float | None, found: list[str]) -> dict[str, Any]:
    """A place of the chain; where something was found, that says more than what a free disturbance there explains."""
    return {"name": hook.replace("_", " "), "share": None if found else share, "found": found}


def _left_over(d: Diagnosis, *, corrected: bool) -> dict[str, Any]:
    left = d.left
    stages: tuple[StageShare, ...] = ()
    if d.verdict in ("partly_explained", "unexplained"):
        stages = tuple(s for s in left.stages if s.share > 0.0)[:_MOST_STAGES]
    return {
        "explained": d.verdict in ("consistent", "explained", "parameter_change"),
        "sentence": _left_sentence(d, corrected=corrected),
        "place": place_facts(left.where),
        "picture": stage_curves(stages) if stages else None,
    }


def _left_sentence(d: Diagnosis, *, corrected: bool) -> str:
    left = d.left
    text = (
        _("The corrected model leaves {rms} (rms) beyond the noise of {noise}{share}.")
        if corrected
        else _("The model leaves {rms} (rms) beyond the noise of {noise}{share}.")
    )
    known = d.verdict != "consistent" and math.isfinite(left.share) and d.gate is None  # else it is of the change
    share = _(": {share} of the misfit").format(share=f"{number(100.0 * left.share, 2)} %") if known else ""
    return text.format(rms=with_unit(left.rms, left.unit), noise=with_unit(left.noise_std, left.unit), share=share)


def _next_test(test: NextTest | None) -> dict[str, Any] | None:
    if test is None:
        return None
    return {
        "command": f"{test.command} --bench BENCH.toml",
        "why": capital(translated(test.why)),
        "seconds": _("{seconds} s of bench time").format(seconds=number(test.bench_s, 3)),
    }


def _false_alarms(d: Diagnosis) -> str:
    known = d.false_alarms
    if known.rate is None:
        return translated(known.scope)
    return _("at most {percent} % of unchanged units: {counted}").format(
        percent=number(100 * known.rate, 2), counted=translated(known.scope)
    )


def _about(d: Diagnosis) -> list[tuple[str, str]]:
    rows: Mapping[str, str] = {
        _("Plant"): d.plant,
        _("Input → output"): f"{d.input} → {d.output}",
        _("Recordings"): ", ".join(d.recordings),
        _("Kept back"): translated(d.kept_back),
        _("False alarms"): _false_alarms(d),
    }
    return [(label, value) for label, value in rows.items() if value]
