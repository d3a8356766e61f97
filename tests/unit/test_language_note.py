"""Notes: kept as values, English as text, German on a page; taken from the rooms that make them, not typed here."""

from __future__ import annotations

import copy
import datetime as dt
import json
import pickle
import re

import numpy as np
import pytest

from hil.bench.find import benches
from hil.bench.protection_coverage.calibration import overdue
from hil.bench.read import read_bench
from hil.errors import InputError
from hil.language.note import Note, changed, codes_of, error_text, revived
from hil.language.words import speaking
from hil.record.conditions import condition_departures
from hil.record.recording import Channel, Recording
from hil.report.number import note_text
from hil.session.procedure import load_procedure
from procedures._recorded import departures
from tests.studies.coverage.cases import CASES
from tests.studies.coverage.recordings import driven, noisy
from tests.studies.coverage.situations import SITUATIONS

_ENGLISH = re.compile(r"\b(the|of|is|and|with|it|not)\b")


def german(text: str) -> str:
    with speaking("de"):
        return note_text(text)


def stored_and_read(*notes: str) -> tuple[str, ...]:
    return revived(json.loads(json.dumps(notes)), json.loads(json.dumps(codes_of(notes))))


def test_a_note_is_english_text_and_keeps_its_values():
    made = Note("its fit is {fit:.1f} %, where {least:g} % are asked for", fit=np.float64(71.25), least=80.0).at(
        "0.5 A"
    )
    assert made == "0.5 A: its fit is 71.2 %, where 80 % are asked for"
    assert german(made) == "0,5 A: die Anpassung beträgt 71,2 %, verlangt sind 80 %"
    inner = made.values["note"]
    assert (inner.values, type(inner.values["fit"])) == ({"fit": 71.25, "least": 80.0}, float)
    for again in (pickle.loads(pickle.dumps(made)), copy.deepcopy(made), *stored_and_read(made)):
        assert (again, again.code, again.values) == (made, made.code, made.values)


def test_lists_names_and_labels_of_a_note():
    listed = Note("Not stated: {listed}.", listed=(Note("the fluid"), "v1.5"))
    assert (listed, german(listed)) == ("Not stated: the fluid, v1.5.", "Nicht angegeben: das Öl, v1.5.")
    label = Note("setting {setting!l}", setting="rate = 0.5 Hz")
    assert (label, german(label)) == ("setting rate = 0.5 Hz", "Einstellung rate = 0,5 Hz")
    renamed = changed(label.at("a"), lambda text: text.replace("a", "b"))
    assert (renamed, changed("plain a", str.upper)) == ("b: setting rbte = 0.5 Hz", "PLAIN A")


@pytest.mark.parametrize(
    "made_of",
    [
        None, {}, {"code": "it hums"}, {"code": 3, "values": {}}, {"code": "other", "values": {}},
        {"code": "{x.__class__}", "values": {"x": "it hums"}}, {"code": "{x:>999999999}", "values": {"x": "it hums"}},
        {"code": "{x[0]}", "values": {"x": ["it hums"]}}, {"code": "{x}", "values": ["it hums"]},
        {"code": "{x:{y}}", "values": {"x": 1, "y": "999999999"}},
    ],
    ids=str,
)  # fmt: skip
def test_what_a_file_says_a_note_is_made_of_is_not_believed(made_of):
    (again,) = revived(["it hums"], {"it hums": made_of})
    assert (again, type(again)) == ("it hums", str)


def test_an_error_says_its_note_in_the_language_of_the_page():
    error, other = InputError(Note("no measurement: {why}", why=Note("no sample yet"))), OSError(2, "gone")
    assert (str(error), error_text(error)) == ("no measurement: no sample yet",) * 2
    with speaking("de"):
        assert (error_text(error), error_text(other)) == ("kein Messwert: noch kein Abtastwert", str(other))


def recording(**conditions: object) -> Recording:
    t = np.linspace(0.0, 5.0, 501)
    oil = Channel("oil temperature", "degC", 45.25 + 3.0 * t)
    return Recording("run", t, {oil.name: oil}, {"conditions": conditions})


def test_conditions_that_depart_are_said_in_german():
    found = recording(
        supply_pressure_bar=90.0, fluid="HLP 46",
        ranges={"fluid_temperature_c": (38, 42), "supply_pressure_bar": (98.5, 102), "ambient_temperature_c": (15, 30)},
    )  # fmt: skip
    said = [german(text) for text in (*condition_departures(found), *departures(found))]
    assert said[0].startswith("Flüssigkeitstemperatur: gemessen 4")
    assert said[0].endswith("°C; festgelegt ist 38 … 42 °C.")
    assert said[1] == "Versorgungsdruck: angegeben 90 bar; festgelegt ist 98,5 … 102 bar."
    assert said[2] == "Umgebungstemperatur: weder gemessen noch angegeben; festgelegt ist 15 … 30 °C."
    assert said[3].startswith("Nicht angegeben: die Viskositätsklasse der Flüssigkeit")
    assert said[4].startswith("Das Öl hatte 52,8 °C")


def test_overdue_calibrations_are_said_in_german_with_names_and_dates_as_they_are():
    file = read_bench(benches()["brevini-hpv41"])
    due = dt.date(2026, 1, 2)
    channels = {
        name: channel.model_copy(update={"calibration": channel.calibration.model_copy(update={"due": due})})
        for name, channel in file.bench.channels.items()
        if channel.calibration is not None
    }
    bench = file.bench.model_copy(update={"channels": channels})
    texts = list(overdue(bench, dt.date(2026, 11, 26)))
    assert texts
    for text, name in zip(texts, channels, strict=True):
        assert german(text) == (
            f"Kanal „{name}“: die Kalibrierung war am 2026-01-02 fällig; der Tag dieser Prüfung ist 2026-11-26."
        )


@pytest.mark.parametrize("place", [1, 2, 4, 15, 22], ids=lambda i: f"{CASES[i].procedure}-{CASES[i].bench}")
@pytest.mark.parametrize("situation", [SITUATIONS[0], SITUATIONS[1]], ids=lambda one: one.name)
def test_what_procedures_note_is_said_in_german(place, situation, tmp_path):
    case = CASES[place]
    procedure = load_procedure(case.procedure)
    clean = driven(procedure, case.bench, case.settings, situation, tmp_path / "run")
    found = procedure.evaluate(noisy(clean, case.bench, situation, 7))
    for text in (*found.notes, *found.deviations):
        said = german(text)
        assert [german(again) for again in stored_and_read(text)] == [said]
        assert not _ENGLISH.search(said), said
        assert not re.search(r"\d\.\d", said), said


def test_a_sentence_of_a_stranger_stays_as_it_is_and_english_pages_keep_theirs():
    assert german("odd: it hums at -3.5 Hz") == "odd: it hums at −3.5 Hz"
    assert note_text("0 → 80 %: noise alone") == "0 → 80 %: noise alone"
