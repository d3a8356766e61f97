"""The report of a run: whole, self-contained, escaped, the same bytes for the same run."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hil.report
from hil.errors import StorageError
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Channel, Recording, recording
from hil.record.run_folder.header import read_end
from hil.record.run_folder.run_writer import RunWriter
from hil.report.number import number, rounded, with_minus, with_uncertainty
from hil.report.run_page import write_run_report
from tests import curves
from tests.page import Page, read_page


def a_recording(meta: dict | None = None) -> Recording:
    time_s = np.arange(5000) * 1e-3
    command = 50.0 * np.sin(2 * np.pi * time_s)
    return recording("runs/one", time_s, {"command [%]": command, "flow [l/min]": 0.7 * command}, meta)


def page_of(findings: Findings, folder: Path, meta: dict | None = None) -> Page:
    write_run_report(a_recording(meta), findings, folder / "report.html")
    return read_page(folder / "report.html")


def test_empty_findings_still_make_a_page(tmp_path):
    write_run_report(a_recording(), Findings(), tmp_path / "report.html")
    page = read_page(tmp_path / "report.html")
    assert "Not judged No limit was given, so nothing was judged" in page.text
    assert page.drawings == 1


def test_settings_stand_with_their_units(tmp_path):
    settings = {"hold_s": 2.0, "amplitudes": [5, 10.5], "cycles": 3, "slow": True, "offset": None}
    units = {"amplitudes": "%", "hold_s": "s", "slow": "", "offset": "%"}
    write_run_report(a_recording({"settings": settings}), Findings(), tmp_path / "report.html", units)
    assert "Hold 2 s Amplitudes 5, 10.5 % Cycles 3 Slow yes" in read_page(tmp_path / "report.html").text


def test_values_stand_with_as_many_digits_as_are_known(tmp_path):
    bandwidth = Measurement("bandwidth_3db", "Hz", "frequency of −3 dB", low=1.0)
    found = Findings((bandwidth.at("+50 ± 5 %").of(1.26912, 0.00612), bandwidth.at("−50 ± 5 %").of(0.9, 0.08)))
    write_run_report(a_recording(), found, tmp_path / "report.html")
    text = read_page(tmp_path / "report.html").text
    assert "Bandwidth 3 dB frequency of −3 dB" in text
    assert "+50 ± 5 % 1.269 ± 0.012 Hz ≥ 1 pass" in text
    assert "−50 ± 5 % 0.90 ± 0.16 Hz ≥ 1 cannot tell" in text


def test_hostile_names_stay_text(tmp_path):
    hostile = "<script>alert(1)</script>&\"'$\\frac{$ 阀"
    meta = {"valve": {"name": hostile}, "bench": hostile, "procedure": hostile, "settings": {hostile: hostile},
            "events": [{"event": hostile, "time_s": None, "row": 0, "details": {hostile: hostile}}]}  # fmt: skip
    found = Findings((Measurement(hostile, "1", hostile).of(1.0),), {hostile: {hostile: np.arange(9.0)}}, (hostile,))
    time_s = np.arange(100) * 1e-3
    strange = replace(a_recording(meta), channels={hostile: Channel(hostile, hostile, 1.0 * time_s)}, time_s=time_s)
    write_run_report(strange, found, tmp_path / "report.html")
    page = read_page(tmp_path / "report.html")
    assert "script" not in page.tags
    assert hostile in page.text


def test_the_same_run_makes_the_same_bytes(tmp_path):
    found = Findings(curves={"anything": {"x": np.arange(9.0), "y": np.arange(9.0) ** 2}})
    for name in ("a", "b"):
        write_run_report(a_recording(), found, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_page_that_cannot_be_written_is_a_named_error(tmp_path):
    with pytest.raises(StorageError, match="report cannot be written"):
        write_run_report(a_recording(), Findings(), tmp_path / "nowhere" / "report.html")


@pytest.mark.parametrize(
    ("value", "expanded", "shown"),
    [
        (1.26912, 0.01224, ("1.269", "0.012")),
        (0.04, 0.0996, ("0.04", "0.10")),
        (1234.4, 123.0, ("1230", "120")),
        (-0.0001, 0.02, ("0.000", "0.020")),
        (-3.14159, 0.5, ("\N{MINUS SIGN}3.14", "0.50")),
        (2.5e-6, 1e-7, ("2.50·10⁻⁶", "0.10·10⁻⁶")),
        (1e-7, 7.1e-5, ("0", "7.1·10⁻⁵")),
        (3.0, None, ("3", "")),
        (3.0, 0.0, ("3", "")),
        (3.0, float("inf"), ("3", "∞")),
        (None, 0.1, ("—", "")),
        (float("nan"), 0.1, ("—", "")),
        (float("-inf"), 0.1, ("\N{MINUS SIGN}∞", "")),
    ],
)
def test_a_value_has_the_digits_of_its_uncertainty(value, expanded, shown):
    assert rounded(value, expanded) == shown


def test_numbers_in_words():
    assert number(123456.0) == "123456"
    assert number(1.4e-5, 3) == "1.4·10⁻⁵"
    assert with_uncertainty(0.5, 0.1, "1") == "0.50 ± 0.10"
    assert with_minus("-50 ± 5 % of run-3") == "\N{MINUS SIGN}50 ± 5 % of run-3"


def test_responses_are_drawn_by_bias_with_distortion_fits_and_models(tmp_path):
    responses = [curves.response(bias, amplitude) for bias in (50.0, -50.0, 0.0) for amplitude in (5.0, 10.0)]
    page = page_of(Findings(curves={"responses": responses}), tmp_path)
    assert page.drawings == 2 + 1 + 1  # three biases in two pictures, sine fits, the recording
    assert page.text.count("amplitude ratio [dB]") == 2
    assert "THD [%]" in page.text
    assert "+50 ± 5 %, no zero in the right half plane G(s) = 1 / (s + 1)³ 98.10 0.02" in page.text
    assert "−50 ± 10 %: 2 poles, 0 zeros" in page.text


def test_a_multisine_shows_noise_and_distortion_apart(tmp_path):
    page = page_of(Findings(curves={"responses": [curves.response(50.0, 10.0, multisine=True)]}), tmp_path)
    assert all(text in page.text for text in ("odd distortion", "even distortion", "noise of the mean"))
    assert "THD" not in page.text


def test_a_bare_response_is_drawn_without_what_is_not_known(tmp_path):
    keys = ("frequency_hz", "magnitude_db", "phase_deg")
    bare = {key: curves.response(0.0, 5.0)[key] for key in keys}
    assert page_of(Findings(curves={"responses": [bare]}), tmp_path).drawings == 2


def test_flow_curve_steps_and_large_sines_have_their_sections(tmp_path):
    drawn = {
        "flow_curve": curves.flow_curve(), "steps": [curves.step(80.0), curves.step(-80.0), curves.step(40.0)],
        "large_sines": [curves.large_sine(f) for f in (0.1, 0.3, 0.5, 0.7)],
    }  # fmt: skip
    page = page_of(Findings(curves=drawn), tmp_path)
    assert page.drawings == 1 + 1 + 2 + 1
    for text in ("at half speed", "dead band", "c9 1.2e-15", "0 → −80 % 56·(1 − e^(−(t − 0.02)/0.2))",
                 "0.1 Hz 0.12 5.88 0.04 1.00", "command [%]", "response [l/min]"):  # fmt: skip
        assert text in page.text, text


def test_a_cylinders_steps_and_drift_have_their_sections(tmp_path):
    drawn = {
        "velocity_steps": [curves.velocity_step(s) for s in (26.2361, -20.8, 26.3, -20.7, 1.0)],
        "drift": [curves.drift(0.0)],
    }
    page = page_of(Findings(curves=drawn), tmp_path)
    assert page.drawings == 1 + 1 + 1
    for text in ("Speed [mm/s]", "0 → 0.262361 A 26.236 0.8 … 1.99", "0 → −0.208 A −20.8", "position [mm]"):
        assert text in page.text, text


def test_a_flow_curve_without_options_is_drawn(tmp_path):
    command = np.linspace(0.0, 1.0, 20)
    bare = {"command": command, "rising": command, "falling": command, "std": None, "dead_band": None}
    assert page_of(Findings(curves={"flow_curve": bare}), tmp_path).drawings == 2


def test_a_strangers_curves_are_drawn_plainly(tmp_path):
    strange = {
        "steps": {"time_s": np.arange(99.0), "pressure_bar": np.arange(99.0), "gain": 3.25, "remark": "as usual"},
        "spectrum": [
            {"label": "cold", "frequency_hz": np.arange(5.0), "gain": np.ones(5), "gain_unit": "bar"},
            {"alone": [1.0, 2.0], "settled": True},
        ],
        "nothing": None, "empty": [], "value": 7, "table": np.ones((2, 3)),
    }  # fmt: skip
    page = page_of(Findings(curves=strange), tmp_path)
    for text in ("time [s]", "pressure [bar]", "gain 3.25", "remark as usual", "gain [bar]", "settled True", "Cold"):
        assert text in page.text, text
    assert page.drawings == 1 + 2 + 1


def test_missed_limits_are_told_beside_the_verdict(tmp_path):
    gain = Measurement("gain", "l/min", "flow at full opening", low=60.0, high=75.0)
    found = Findings((gain.at("-100 %").of(52.31, 0.4), gain.at("+100 %").of(None)))
    text = page_of(found, tmp_path).text
    assert "Fail At least one limit is missed." in text
    assert "Fail: gain at −100 % is 52.31 ± 0.80 l/min, limit 60 … 75 l/min: it is missed by 7.7 l/min" in text
    assert "Cannot tell: gain at +100 % is not determined" in text


def test_conditions_instruments_and_identity_of_a_run_folder(tmp_path):
    meta = {
        "procedure": "flow_curve", "bench": "bench 3", "valve": {"name": "HPV41", "serial": "4711", "settling_s": 2.0},
        "conditions": {"fluid": "mineral oil", "fluid_temperature_c": 40.0}, "settings": {"hold_s": 2.0, "slow": True},
        "instruments": [{"name": "flow meter", "serial": "88"}],
        "bench_file": "sample_rate_hz = 500\n[simulation]\nseed = 9",
        "sampling": {"timing": "virtual", "rate_hz": 480.0, "delay_s": {"flow": 0.0}},
    }  # fmt: skip
    with RunWriter.create(tmp_path / "run", meta, [("flow", "l/min")]) as run:
        run.append(np.arange(10) / 480.0, {"flow": np.arange(10.0)})
        run.event("interlock tripped", reason="over-pressure")
    from hil.record.folder import read

    write_run_report(read(tmp_path / "run"), Findings(), tmp_path / "report.html")
    text = read_page(tmp_path / "report.html").text
    end = read_end(tmp_path / "run")
    assert end is not None
    for said in (
        "Flow curve: HPV41", "Valve HPV41 Serial 4711", "Fluid temperature 40 °C", "Hold 2 s", "Slow yes",
        "flow meter: serial 88",
        "Sample rate asked 500 Hz", "Seed of the simulation 9", "Device: rate 480 Hz", "Device: delay flow 0 s",
        f"CRC-32 of the samples {end.crc32}", end.sha256["run.json"], "interlock tripped reason over-pressure",
    ):  # fmt: skip
        assert said in text, said


def test_before_the_results_stand_unit_operator_conditions_and_deviations(tmp_path):
    meta = {"valve": {"name": "HPV41", "serial": "4711"}, "operator": "AM", "conditions": {"fluid_temperature_c": 40.0}}
    found = Findings((Measurement("rise", "ms", "").of(3.0, 0.1),), deviations=("oil too cold",))
    first_page = page_of(found, tmp_path, meta).text.partition("Results Quantity")[0]
    for said in ("Not judged", "Serial 4711", "Operator AM", "Fluid temperature 40 °C", "standard oil too cold"):
        assert said in first_page, said


def test_the_verdict_is_set_in_letters_for_two_metres():
    style = (Path(hil.report.__file__).parent / "style.css").read_text(encoding="utf-8")
    sizes = [float(rem) for rem in re.findall(r"^\.verdict \.word \{[^}]*font-size: ([\d.]+)rem", style, re.M)]
    assert sizes == [pytest.approx(3.2, abs=0.3)]
    (printed,) = re.findall(r"\.verdict \.word \{ font-size: (\d+)pt", style)
    assert int(printed) >= 28


@pytest.mark.parametrize(("value", "word"), [(3.0, "Not finished"), (9.0, "Fail")])
def test_of_a_run_that_was_stopped_nothing_but_a_miss_is_a_verdict(tmp_path, value, word):
    found = Findings((Measurement("rise", "ms", "", high=5.0).of(value, 0.1),))
    assert page_of(found, tmp_path, {"outcome": "StoppedError: by hand"}).text.partition(" the run ")[0].count(word)


def test_a_broken_off_run_says_so_on_top(tmp_path):
    meta = {"outcome": "TrippedError: over-pressure", "incomplete": "of 9 rows only 5"}
    text = page_of(Findings(), tmp_path, meta).text
    assert (
        "Not finished The test did not end as planned, so it proves nothing. "
        "The run did not end as planned: over-pressure." in text
    )
    assert "The recording is incomplete: of 9 rows only 5" in text


def test_reports_load_no_drawing_library_before_they_draw():
    code = "import sys, hil.report.run_page, hil.report.diagnosis_page; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
