"""A unit has a name: serial number, operator and notes, from the prompt to the archive."""

import json
from pathlib import Path

import pytest

from hil.bench.find import benches, find_bench
from hil.bench.read import read_bench
from hil.errors import SettingError
from hil.session.labels import NO_LABELS, Labels, folder_name, labelled, labels_of, new_folder
from hil.session.procedure import load_procedure

pytestmark = pytest.mark.usefixtures("unprinted")
STEP = ("run", "step_response", "--set", "levels=0,80")


def asking(tmp_path, name="hpv41-modbus-tcp"):
    """A bench on a link whose file wants a serial number for each run."""
    lines = Path(benches()[name]).read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith("serial = ")]
    kept.insert(kept.index("[valve]") + 1, 'serial = "ask"')
    path = tmp_path / "bench.toml"
    path.write_text("\n".join(kept) + "\n", encoding="utf-8")
    return read_bench(path)


def test_serial_is_asked_for_when_the_bench_says_so(tmp_path):
    bench, procedure = asking(tmp_path), load_procedure("step_response")
    told, labels = labelled(bench, procedure, NO_LABELS, ask=lambda: "A7\r\n")
    assert labels.serial == told.bench.valve.serial == "A7"
    assert told.text == bench.text


def test_without_a_terminal_the_option_is_named(tmp_path):
    with pytest.raises(SettingError, match=r'serial = "ask": say which unit this is with --serial SN'):
        labelled(asking(tmp_path), load_procedure("step_response"), NO_LABELS)


def test_certificate_needs_a_unit_on_a_real_bench():
    bench = read_bench(find_bench("cummins-efc-modbus"))
    procedure = load_procedure("efc_acceptance")
    assert procedure.certificate
    with pytest.raises(SettingError, match=r"issues a certificate.*--serial SN; nothing was driven"):
        labelled(bench.of_unit(""), procedure, NO_LABELS)
    with pytest.raises(SettingError, match="issues a certificate"):
        labelled(bench, procedure, Labels("simulated"))
    assert labelled(bench, procedure, Labels("15969046"))[1].serial == "15969046"


def test_simulated_bench_has_a_simulated_unit():
    bench = read_bench(find_bench("cummins-efc-acceptance"))
    assert labelled(bench, load_procedure("efc_acceptance"), NO_LABELS)[1].serial == "simulated"


@pytest.mark.parametrize(
    ("serial", "notes", "said"),
    [
        ("A\x1b[2J7", (), "printable"),
        ("x" * 65, (), "up to 64"),
        ("", ("oil",), "KEY=VALUE"),
        ("", ("oil=a", "oil=b"), "given twice"),
        ("", ("oil=a\nb",), "--note oil: 'a.nb': up to 1000 printable"),
        ("  ", (), "nothing but blanks"),
    ],
)
def test_label_that_is_none_is_refused(serial, notes, said):
    with pytest.raises(SettingError, match=said):
        labels_of(serial, "", notes)


def test_folder_of_a_unit_keeps_its_letters_and_no_path():
    assert folder_name("jog", "Ventil-Ü/7").startswith("jog-Ventil-Ü-7-")
    assert folder_name("jog", "../../阀门").startswith("jog-阀门-")
    assert len(folder_name("efc_frequency_response", 64 * "阀").encode()) < 255


def test_run_is_found_again_by_its_unit(monkeypatch, tmp_path, command_line, prints):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HIL_ARCHIVE", str(tmp_path / "lab"))
    labels = ("--serial", "A/7", "--operator", "mk", "--note", "oil=VG 46")
    prints(*STEP, "--bench", "brevini-hpv41", *labels)
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("step_response-A-7-")
    header = json.loads((folder / "run.json").read_text(encoding="utf-8"))["meta"]
    assert (header["valve"]["serial"], header["operator"], header["notes"]) == ("A/7", "mk", {"oil": "VG 46"})
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert all(text in page for text in ("A/7", "mk", "VG 46"))
    said = command_line("runs", "--serial", "A/7", "--json")
    (row,) = json.loads(said.out)
    assert (row["serial"], row["operator"], Path(row["run"])) == ("A/7", "mk", folder)


def test_archive_that_is_away_does_not_fail_the_run(tmp_path, command_line):
    away = "postgresql://hil@127.0.0.1:9/none"
    run = (*STEP, "--bench", "brevini-hpv41", "--out", tmp_path / "run", "--archive", away)
    said = command_line(*run)
    assert said.status == 0
    assert "will be entered later" in said.err


def test_a_simulated_bench_asks_too_and_nothing_is_no_answer(tmp_path):
    bench, procedure = asking(tmp_path, "brevini-hpv41"), load_procedure("step_response")
    assert labelled(bench, procedure, NO_LABELS, ask=lambda: "A7\r")[1].serial == "A7"
    with pytest.raises(SettingError, match="nothing was typed or scanned"):
        labelled(bench, procedure, NO_LABELS, ask=lambda: "\r")
    with pytest.raises(SettingError, match=r"--serial SN"):
        labelled(bench, procedure, NO_LABELS)


def test_runs_of_one_second_have_folders_of_their_own(tmp_path, monkeypatch):
    monkeypatch.setattr("hil.session.labels.folder_name", lambda procedure, serial: f"{procedure}-{serial}")
    (tmp_path / "jog-7").mkdir()
    assert new_folder(tmp_path, "jog", "7", {"jog-7-1"}) == tmp_path / "jog-7-2"
    assert new_folder(tmp_path, "jog", "8") == tmp_path / "jog-8"
