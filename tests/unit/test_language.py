"""Pages in German: catalogues in step with the code, decimal signs, the language asked for, files in English."""

from __future__ import annotations

import io
import json
import re

import pikepdf
import pytest
from babel.messages.pofile import read_po

from docs.catalogues import CATALOGUES, ROOMS, catalogue, compiled, long_sentences, text_of
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.cli.commands.run import understood
from hil.console.board import interlocks_of, lines_of
from hil.errors import SettingError
from hil.language.choice import choose, page_language
from hil.language.figures import localised
from hil.language.note import Note, translated
from hil.language.words import _, languages, plural, speaking, spoken
from hil.record.measurement import Findings, Measurement
from hil.report.number import fixed, label_text, number, with_uncertainty
from hil.report.run_page import write_run_report
from hil.report.terminal import findings_text
from hil.session.procedure import load_procedure
from hil.session.rehearsal import Rehearsal, is_of_rehearsal
from tests.chromium import chromium
from tests.page import read_page
from tests.passports import run_of
from tests.unit.test_report_run import a_recording

FILES = sorted(CATALOGUES.glob("*/LC_MESSAGES/*.po"))
BANDWIDTH = Measurement(
    "bandwidth_3db", "Hz", "frequency at which the amplitude ratio is 3 dB below the reference", 1.0
)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_catalogues_are_in_step_with_the_code(path):
    made = catalogue(path.stem, path)
    assert path.stem in ROOMS
    assert path.read_bytes() == text_of(made), "python docs/catalogues.py brings it up to date"
    assert path.with_suffix(".mo").read_bytes() == compiled(made)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_everything_is_translated_with_the_same_places(path):
    for message in read_po(io.BytesIO(path.read_bytes())):
        if message.id:
            texts = zip(*(([t] if isinstance(t, str) else t) for t in (message.id, message.string)), strict=True)
            for said, translated in texts:
                assert translated, f"not translated: {said}"
                assert _places(said) == _places(translated), said


def test_no_sentence_is_too_long_for_one_reading():
    assert list(long_sentences()) == []


def _places(text: str) -> set[str]:
    """Names of places with their formats; a language may begin with another of them."""
    return {place.replace("!c", "") for place in re.findall(r"{[^{}]*}", text)}


def test_german_numbers_have_a_comma_and_english_ones_a_point():
    shown = [number(1.5), number(-0.25), fixed(2.0, 2), with_uncertainty(1.269, 0.012, "Hz"), number(1e-9)]
    assert shown == ["1.5", "−0.25", "2.00", "1.269 ± 0.012 Hz", "1·10⁻⁹"]
    with speaking("de"):
        shown = [number(1.5), number(-0.25), fixed(2.0, 2), with_uncertainty(1.269, 0.012, "Hz"), number(1e-9)]
        assert localised("3.25") == "3,25"
    assert shown == ["1,5", "−0,25", "2,00", "1,269 ± 0,012 Hz", "1·10⁻⁹"]


def test_a_language_lasts_as_long_as_its_context_and_no_other_is_spoken():
    assert languages() == ("en", "de")
    with speaking("de"), speaking("en"):
        assert (spoken(), _("Verdict"), plural("{n} run", "{n} runs", 2)) == ("en", "Verdict", "{n} runs")
    with speaking("de"):
        assert (_("Verdict"), _("no such text"), _("")) == ("Urteil", "no such text", "")
    assert _("Verdict") == "Verdict"
    with pytest.raises(SettingError, match="language 'fr': en, de are spoken"), speaking("fr"):
        pass


@pytest.mark.parametrize(
    ("environment", "language"),
    [
        ({}, "en"), ({"LANG": "de_DE.UTF-8"}, "de"), ({"LANG": "C.UTF-8"}, "en"), ({"LANG": "fr_FR.UTF-8"}, "en"),
        ({"LC_ALL": "C", "LANG": "de_DE.UTF-8"}, "en"), ({"LANGUAGE": "fr:de", "LANG": "en_US"}, "de"),
        ({"HIL_LANGUAGE": "en", "LANG": "de_AT"}, "en"), ({"HIL_LANGUAGE": "DE-ch"}, "de"),
    ],
)  # fmt: skip
def test_the_environment_decides_where_nobody_says(environment, language):
    assert page_language(environment) == language


def test_a_language_that_is_not_spoken_is_refused_by_name():
    with pytest.raises(SettingError, match=r"--language nl: en, de are spoken"):
        choose("nl")
    with pytest.raises(SettingError, match="HIL_LANGUAGE=nl: en, de are spoken"):
        page_language({"HIL_LANGUAGE": "nl"})


def test_the_page_of_a_run_is_german_and_what_is_printed_is_not(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_LANGUAGE", "de")
    found = Findings((BANDWIDTH.of(1.26912, 0.00612), BANDWIDTH.at("−50 %").of(0.99, 0.08)))
    write_run_report(a_recording(), found, tmp_path / "report.html")
    page = read_page(tmp_path / "report.html")
    assert '<html lang="de">' in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Nicht entscheidbar Kein Grenzwert ist sicher verletzt" in page.text
    assert "Bandbreite 3 dB bei −50 % ist 0,99 ± 0,16 Hz, Grenzwert ≥ 1 Hz: er ist um 0,01 Hz verfehlt" in page.text
    assert "Frequenz, bei der das Amplitudenverhältnis 3 dB unter dem Bezug liegt" in page.text
    assert not re.search(r"\d\.\d", re.sub(r"ISO 14253-1|valve-hil [\d.]+", "", page.text)), "a decimal point is left"
    assert "bandwidth_3db, −50 %  0.99 ± 0.16    Hz" in findings_text(found)


def test_a_german_table_of_values_fits_a_telephone(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_LANGUAGE", "de")
    symmetry = Measurement("symmetry", "l/min per %", "gain of the weaker side", 0.99712, 0.99723)
    found = Findings((BANDWIDTH.of(1.26912, 0.00012), BANDWIDTH.at("−50 %").of(None), symmetry.of(0.99706, 0.00008)))
    write_run_report(a_recording(), found, tmp_path / "report.html")
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 400, "height": 800})
        page.goto((tmp_path / "report.html").as_uri())
        beyond = "box => box.scrollWidth - box.clientWidth"
        assert page.locator(".scroll:has(table.results)").evaluate_all(f"boxes => boxes.map({beyond})") == [0]


@pytest.mark.usefixtures("stranger")
def test_a_page_in_german_by_option(tmp_path, prints):
    runs = [run_of(tmp_path, name=name, gain=gain) for name, gain in (("a", 50.0), ("b", 53.0))]
    page = tmp_path / "page.html"
    prints("compare", *runs, "--page", page, "--language", "de")
    assert "1 von 1 Werten weichen über ihre Unsicherheit hinaus ab: Verstärkung." in read_page(page).text
    assert page_language({}) == "en", "the option outlasts its command"


@pytest.mark.usefixtures("stranger")
def test_the_certificate_in_german_and_its_files_in_english(tmp_path, prints):
    run = run_of(tmp_path)
    prints("passport", run, "--out", tmp_path / "p.pdf", "--language", "de")
    with pikepdf.open(tmp_path / "p.pdf") as pdf:
        assert pdf.Root.Lang == "de"
        assert str(pdf.docinfo["/Title"]) == "Ventilpass: HPV41, SN-7"
        content = json.loads(pdf.attachments["passport.json"].get_file().read_bytes())
        xml = pdf.attachments["certificate.xml"].get_file().read_bytes().decode()
    assert content["model"].startswith("No model of this unit is inside")
    assert re.findall(r"value(?:XMLList)?>[^<]*\d[^<]*<", xml)
    assert not re.search(r"\d,\d", xml), "a decimal comma in a file for programs"


def test_what_a_run_says_before_it_drives_is_german_for_a_console_only(monkeypatch):
    monkeypatch.setenv("HIL_LANGUAGE", "de")
    procedure = load_procedure("frequency_response")
    assert understood(procedure, {"biases": "50"}, {}) == "\nsetting biases = 50 %"
    monkeypatch.setenv("HIL_ACCOUNT", "")
    assert understood(procedure, {"biases": "50"}, {}) == "\nEinstellung biases = 50 %"


@pytest.mark.parametrize("language", languages())
def test_a_console_finds_what_a_rehearsal_has_shown_in_every_language(language):
    with speaking(language):
        lines = list(map(translated, Rehearsal(12.5, ("supply is low",)).notes))
    assert all(map(is_of_rehearsal, lines)) and not is_of_rehearsal("50 %: 1 Hz")


def test_the_board_of_a_bench_is_german_and_keeps_the_names_of_channels():
    bench = read_bench(benches()["brevini-hpv41"])
    with speaking("de"):
        lines = lines_of(bench, [], {"command": (12.5, 0.0)})
        asked = {one["name"]: one["asks"] for one in interlocks_of(bench, lines)}
    assert asked["over-pressure"] == "supply pressure ≤ 140, höchstens 0,02 s lang verletzt"
    assert asked["command-not-obeyed"].startswith("command read-back − command zwischen −5 … 5, ")
    assert asked["flow-without-command"].startswith("flow zwischen −10 … 10, solange command zwischen −5 … 5, ")
    assert asked["dead-flow-meter"] == "flow ändert sich innerhalb von 0,5 s"
    assert next(line.limit for line in lines if line.name == "command") == "−100 … 100"


@pytest.mark.parametrize(
    ("place", "german"),
    [
        ("+100 %, supply 52.5 bar", "+100 %, Versorgung 52,5 bar"),
        ("as the bench stands", "Prüfstand unverstellt"),
        ("-50 %, load 100 → 0 %", "−50 %, Last 100 → 0 %"),
        ("100 %, feedback lost", "100 %, ohne Rückführung"),
        ("a stranger's 1.2 A, -3 Hz", "a stranger's 1,2 A, −3 Hz"),
    ],
)
def test_where_a_value_was_measured_is_said_in_the_language_of_the_page(place, german):
    with speaking("de"):
        assert label_text(place) == german
        note = Note("no figures: {why}.", why="?").at(place).translated
    assert note.startswith(german.replace("−", "-"))
    assert str(Note("no figures: {why}.", why="?").at(place)).startswith(place)
