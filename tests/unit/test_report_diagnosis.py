"""The report of a diagnosis: every verdict makes a whole page that says what was found and what was not."""

from __future__ import annotations

import hashlib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.diagnosis.diagnosis import (
    Candidate,
    ChangedParameter,
    Diagnosis,
    Finding,
    Fit,
    Left,
    NextTest,
    Quantity,
    Spectrum,
    Strip,
)  # fmt: skip
from hil.diagnosis.evidence.coverage import Limit
from hil.diagnosis.evidence.locate import StageShare, Where
from hil.diagnosis.false_alarms import FalseAlarms
from hil.language.words import speaking
from hil.record.folder import read
from hil.record.run_folder.run_writer import RunWriter
from hil.report.diagnosis_figures import worst_interval
from hil.report.diagnosis_page import write_diagnosis_report
from hil.report.diagnosis_tables import candidate_rows
from hil.report.equation import equation_lines
from hil.report.origins import all_origins, origin_at, origin_of
from tests.page import Page, read_page

NAN = float("nan")
WHERE = Where("data/sweep.csv", ((1.0, 2.5), (6.0, 7.5)), (0.2, 3.1), "reversals of motion",
              {"reversals of motion": 3.2, "high level": 1.1, "rising": 0.4})  # fmt: skip


def a_strip(samples: int = 5000) -> Strip:
    time_s = np.arange(samples) * 2e-3
    command = 50.0 * np.sin(2 * np.pi * 0.5 * time_s)
    corrected = 0.7 * command
    nominal = corrected + 4.0 * np.sign(np.cos(2 * np.pi * 0.5 * time_s)) * (time_s > 5.0)
    noise = 0.3 * np.random.default_rng(1).standard_normal(samples)
    return Strip("data/sweep.csv", time_s, command, corrected + noise, nominal, corrected, 0.3)


def a_spectrum() -> Spectrum:
    frequency = np.arange(1, 2501) * 0.1
    return Spectrum("data/sweep.csv", frequency, 1.0 / frequency, np.full(2500, 0.01), 0.01, (0.5,), (1.5, 2.5), (1.0,))


def a_stage(hook: str, stage: str, share: float) -> StageShare:
    level = np.linspace(-50.0, 50.0, 7)
    return StageShare(hook, stage, "%", share, level, 0.02 * level, -0.02 * level)


def a_diagnosis(**changes: Any) -> Diagnosis:
    friction = Finding(
        "friction", "friction with sticking", 0.981, "spool", "force",
        {"coulomb": Quantity(2.41234, 0.0612, "%", "sliding friction"), "ratio": Quantity(1.2, None, "1")},
        WHERE, "The moving part sticks.", "F = F_C·sgn v; y = x_{s}", "Armstrong 1994",
    )  # fmt: skip
    made = Diagnosis(
        verdict="explained", headline="The model leaves out friction with sticking (spool).", plant="brevini-hpv41",
        plant_title="proportional valve", input="command [%]", output="flow [l/min]",
        chain=(("command", "command"), ("force", "spool"), ("position", "spool"), ("sensor", "sensor")),
        effects=(friction,), changed_parameters=(), not_separable=(), next_test=None,
        candidates=(Candidate("friction", "spool", 98.654, 9210.4, 0.981),
                    Candidate("backlash", "spool", 96.1, 8000.0, 0.004)),
        held_out=Fit(71.234, 98.654, 98.911), recordings={"data/sweep.csv": Fit(70.0, 98.5, 99.0)}, mismatch=WHERE,
        stage_shares=(a_stage("force", "spool", 0.91), a_stage("command", "command", 0.33)),
        left=Left(0.0043, 0.021, 0.3, "l/min", None, (), 2.5),
        limits=(Limit("leakage", "load", "leak", "l/min", 0.0211, 1.4, True),
                Limit("coil_heating", "pilot", "loss", "1", float("inf"), 0.1, False)),
        warnings=(), false_alarms=FalseAlarms(0.01, "0 alarms of 300 healthy simulated units"), seconds=12.3,
        strips=(a_strip(),), spectra=(a_spectrum(),), kept_back="other recordings",
    )  # fmt: skip
    return replace(made, **changes)


def undrawn(**changes: Any) -> Diagnosis:
    """The same without what takes time to draw."""
    return a_diagnosis(strips=(), spectra=(), mismatch=None, **changes)


def page_of(diagnosis: Diagnosis, folder: Path) -> Page:
    write_diagnosis_report(diagnosis, folder / "report.html")
    return read_page(folder / "report.html")


def test_explained_says_what_where_and_how_well(tmp_path):
    page = page_of(a_diagnosis(), tmp_path)
    for text in (
        "Explained The model leaves out friction", "fits 71.23 %, the corrected one 98.65 %; noise allows 98.91 %",
        "sweep.csv 70.00 98.50 99.00 98 %", "Friction with sticking · probability 98 % · stage: spool",
        "coulomb 2.41 ± 0.12 % sliding friction", "ratio 1.2 not known", "reversals of motion",
        "Source: Armstrong 1994",
        "friction spool 9 210 best 98.65 98 %", "backlash spool 8 000 1 210 96.10 below 1 %",
        "leakage load leak 0.0211 l/min 1.4 l/min would be visible",
        "coil heating pilot loss no limit 0.1 not visible in these data", "No further test is needed",
    ):  # fmt: skip
        assert text in page.text, text
    assert page.drawings == 5


def test_a_german_page_says_places_and_explanations_in_german(tmp_path):
    with speaking("de"):
        text = page_of(a_diagnosis(), tmp_path).text
    for german in ("Umkehr der Bewegung", "Reibung Schieber 9 210", "Lose Schieber 8 000", "Leckage Last leak"):
        assert german in text, german


def test_the_explanation_that_was_chosen_is_marked():
    friction = a_diagnosis().effects[0]
    mass = ChangedParameter("mass", 20.0, 100.0, 0.2, "kg", "moved mass")
    tried = [Candidate(name, "spool", 99.0, 9000.0 - i, 0.5) for i, name in enumerate(("friction + mass", "friction"))]

    def marked(candidates, changed):
        return [row["name"] for row in candidate_rows(candidates, (friction,), changed) if row["named"]]

    assert marked(tried, (mass,)) == ["friction + mass"]
    assert marked(tried, ()) == ["friction"]
    assert marked(tried[1:], (mass,)) == ["friction"]


def test_limits_on_what_cannot_be_seen_come_first(tmp_path):
    text = page_of(undrawn(), tmp_path).text
    assert text.index("coil heating") < text.index("leakage load")


def test_consistent_speaks_of_no_correction(tmp_path):
    page = page_of(
        a_diagnosis(verdict="consistent", effects=(), mismatch=None, stage_shares=(), candidates=()), tmp_path
    )
    assert "Consistent" in page.text
    assert "Corrected" not in page.text
    assert "What was left out" not in page.text
    assert "corrected model leaves" not in page.text


def test_unexplained_hands_over_what_is_left_without_a_name(tmp_path):
    left = Left(1.0, 2.5, 0.3, "l/min", WHERE, (a_stage("force", "spool", 0.7), a_stage("sensor", "sensor", 0.0)), 2.5)
    page = page_of(a_diagnosis(verdict="unexplained", effects=(), left=left), tmp_path)
    assert "leaves 2.5 l/min (rms) beyond the noise of 0.3 l/min: 100 % of the misfit" in page.text
    assert "force (spool): 70 %" in page.text
    assert "sensor (sensor)" not in page.text


def test_a_description_without_a_name_is_shown_before_and_after(tmp_path):
    described = undrawn(verdict="unexplained", effects=())
    text = page_of(described, tmp_path).text
    assert "the corrected one 98.65 %" in text and "Before and after" in text
    kept = undrawn(verdict="unexplained", effects=(), recordings={"data/sweep.csv": Fit(70.0, 70.0, 99.0)})
    assert "corrected one" not in page_of(kept, tmp_path).text


def test_changed_parameter_at_its_bound_is_a_warning(tmp_path):
    changed = ChangedParameter("gain", 1.5, 1.80123, 0.0151, "l/min", "flow at full opening", at_bound=True)
    page = page_of(undrawn(verdict="parameter_change", effects=(), changed_parameters=(changed,)), tmp_path)
    assert "gain 1.5 1.801 ± 0.030 l/min flow at full opening at its bound" in page.text
    assert "not physics" in page.text


def test_rivals_next_test_and_warnings_are_shown(tmp_path):
    test = NextTest("step_response", {"levels": (10.0, 80.0), "note": "a b"}, "Steps tell them apart.", 20.0)
    page = page_of(
        undrawn(next_test=test, not_separable=(("friction", "dead_time"),), warnings=("clipped at 10 V",)), tmp_path
    )
    assert "hil run step_response --set levels=10,80 --set 'note=a b' --bench BENCH.toml" in page.text
    assert "friction or dead time" in page.text
    assert "These data cannot tell friction and dead time apart." in page.text
    assert "clipped at 10 V" in page.text


def test_nothing_known_still_makes_a_page(tmp_path):
    bare = a_diagnosis(
        effects=(), candidates=(), recordings={}, mismatch=None, stage_shares=(), limits=(), strips=(), spectra=(),
        chain=(), verdict="unexplained", held_out=Fit(NAN, NAN, NAN), left=Left(NAN, NAN, NAN, "1", None, (), 2.5),
    )  # fmt: skip
    assert page_of(bare, tmp_path).drawings == 0


@pytest.mark.parametrize("noise", [0.0, NAN])
def test_a_recording_without_noise_has_a_unit_all_the_same(tmp_path, noise):
    strip = replace(a_strip(120), noise_std=noise)
    assert page_of(a_diagnosis(strips=(replace(strip, measured=strip.corrected),), spectra=()), tmp_path).drawings == 3


def test_hostile_names_stay_text(tmp_path):
    hostile = "<script>x</script>&\"'$\\frac{$_{ 阀"
    effect = replace(
        a_diagnosis().effects[0],
        **{f.name: hostile for f in fields(Finding) if f.type == "str"},
        parameters={hostile: Quantity(1.0, 0.1, hostile, hostile)},
    )
    page = page_of(
        a_diagnosis(
            headline=hostile, plant_title=hostile, input=hostile, effects=(effect,), warnings=(hostile,),
            strips=(replace(a_strip(), name=hostile),), spectra=(replace(a_spectrum(), name=hostile),),
        ),
        tmp_path,
    )  # fmt: skip
    assert "script" not in page.tags
    assert hostile in page.text


def test_the_same_diagnosis_makes_the_same_bytes(tmp_path):
    for name, seconds in (("a", 1.0), ("b", 99.0)):  # how long it took is not on the page
        write_diagnosis_report(a_diagnosis(seconds=seconds), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_the_close_up_shows_where_the_nominal_model_is_off():
    strip = a_strip()
    first, stop = worst_interval(strip)
    assert strip.time_s[first] >= 5.0 - 0.002
    assert stop - first == 500


def test_equations_have_a_line_for_each_law_and_indices_below():
    assert equation_lines("F = F_C·z;  y = x_{ab} + 1") == [
        [("base", "F = F"), ("below", "C"), ("base", "·z")],
        [("base", "y = x"), ("below", "ab"), ("base", " + 1")],
    ]
    assert equation_lines("") == []


def test_the_chain_marks_the_stage_of_an_effect_that_has_no_hook(tmp_path):
    effect = replace(a_diagnosis().effects[0], hook="", stage="sensor", title="drift of the sensor")
    write_diagnosis_report(undrawn(effects=(effect,)), tmp_path / "report.html")
    content = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert content.count('class="stage named"') == 1
    assert '<div class="named-effect">drift of the sensor</div>' in content


def test_the_place_of_what_was_found_has_no_share_of_its_own(tmp_path):
    none = (a_stage("force", "spool", 0.0), a_stage("position", "spool", 0.99))
    text = page_of(undrawn(stage_shares=none), tmp_path).text
    assert "spool force friction with sticking position 99 %" in text


def test_a_diagnosis_says_what_it_was_made_of(tmp_path):
    meta = {"valve": {"serial": "4711"}, "bench": "bench 3"}
    with RunWriter.create(tmp_path / "run", meta, [("flow", "l/min")]) as run:
        run.append(np.arange(10) / 480.0, {"flow": np.arange(10.0)})
    (tmp_path / "model.json").write_text("{}", encoding="utf-8")
    whence = all_origins([origin_at(tmp_path / "model.json"), origin_of(read(tmp_path / "run"))], [])
    samples = hashlib.sha256((tmp_path / "run" / "samples.f8").read_bytes()).hexdigest()
    write_diagnosis_report(undrawn(), tmp_path / "report.html", whence)
    text = read_page(tmp_path / "report.html").text
    assert f"{tmp_path / 'run'} 4711; bench 3; 20" in text
    assert f"SHA-256 of samples.f8 {samples}" in text
    assert f"SHA-256 of model.json {hashlib.sha256(b'{}').hexdigest()}" in text
    assert all_origins([], [str(tmp_path / "run")])[0].sha256 == samples


def test_the_chain_marks_one_of_two_places_of_the_same_stage(tmp_path):
    effect = replace(a_diagnosis().effects[0], hook="load", stage="cylinder")
    chain = (("load_pressure", "cylinder"), ("flow", "flow"), ("load", "cylinder"))
    write_diagnosis_report(undrawn(effects=(effect,), chain=chain, stage_shares=()), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8").count('class="stage named"') == 1


def test_an_open_question_without_a_test_is_not_called_settled(tmp_path):
    text = page_of(undrawn(not_separable=(("friction", "backlash"),)), tmp_path).text
    assert "No further test is needed" not in text
    assert "would tell more" in text
