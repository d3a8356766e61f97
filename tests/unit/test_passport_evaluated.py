"""A passport says what the samples say: edits of a run folder are refused, and the receiver can look for himself."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pikepdf
import pytest

import hil.passport.issue as issuing
from hil.bench.audit import Audit, chain, evaluated_on_the_trail, head, on_the_trail
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.errors import FileError
from hil.passport.contents import lay_out
from hil.passport.evaluate import evaluate_passport
from hil.passport.issue import Issued, Wanted, issue
from hil.passport.key import signing_key
from hil.passport.unit import read_unit_runs
from hil.record.folder import read
from hil.record.measurement import Limit
from hil.record.run_folder.header import read_end, sha256_of
from hil.record.run_folder.seal import check_seal, read_seal, seal_folder
from hil.session.kept_results import results_of_run
from hil.session.results import report_again
from tests.passports import run_of

pytestmark = pytest.mark.usefixtures("unprinted", "own_state", "stranger")

WITHOUT_MODEL = Wanted(identify=False)
OLDER = "valve-hil 0.0.9"
SAMPLES = Path(__file__).parent.parent / "samples"


def edited(path: Path, edit: Callable[[dict], object]) -> None:
    content = json.loads(path.read_text(encoding="utf-8"))
    edit(content)
    path.write_text(json.dumps(content), encoding="utf-8")


def resealed(run: Path, *names: str) -> None:
    edited(run / "seal.json", lambda seal: seal["sha256"].update({name: sha256_of(run / name) for name in names}))


def passport_of(folder: Path, run: Path, name: str = "unit.pdf") -> Issued:
    """A passport of the run, without a model."""
    return issue([run], folder / name, signing_key(None), WITHOUT_MODEL)


def better(run: Path) -> None:
    """Two numbers: a failed valve passes."""
    edited(
        run / "results.json", lambda r: (r["values"][0].update(value=50.0, verdict="pass"), r.update(verdict="pass"))
    )


def on_a_trail(folder: Path, **given: float) -> Path:
    """A run that stands in the audit trail of this computer."""
    with on_the_trail(read_bench(benches()["brevini-hpv41"]), folder / "run", {"operator": "Eva"}) as begins:
        begins()
        run = run_of(folder, **given)
    evaluated_on_the_trail(run)
    return run


# -- the seal ----------------------------------------------------------------------------------------------


def test_every_file_of_a_closed_run_is_sealed(tmp_path):
    run = run_of(tmp_path)
    end, seal = read_end(run), read_seal(run)
    assert end is not None and seal is not None
    assert {*end.sha256, *seal.sha256, "seal.json"} == {path.name for path in run.iterdir()}
    assert {name: sha256_of(run / name) for name in (*end.sha256, *seal.sha256)} == {**end.sha256, **seal.sha256}
    (run / "photo.jpg").write_bytes(b"later")
    assert check_seal(run) == seal


@pytest.mark.parametrize("name", ["../state/secret", "/etc/hostname"])
def test_a_seal_names_files_of_its_folder_only(tmp_path, name):
    run = run_of(tmp_path)
    edited(run / "seal.json", lambda seal: seal["sha256"].update({name: "0" * 64}))
    with pytest.raises(FileError, match="no file of the run folder"):
        read_unit_runs([run])


@pytest.mark.parametrize("name", ["run.json", "end.json", "samples.f8", "samples.log", "events.jsonl", "results.json"])
@pytest.mark.parametrize("how", ["changed", "gone"])
def test_a_file_that_is_another_is_named(tmp_path, name, how):
    run = run_of(tmp_path)
    if how == "gone":
        (run / name).unlink()
    else:
        (run / name).write_bytes((run / name).read_bytes() + b" ")
    with pytest.raises(FileError, match=name):
        check_seal(run)
    with pytest.raises(FileError, match=name):
        read_unit_runs([run])


def test_results_that_were_edited_are_shown_nowhere(tmp_path):
    run = run_of(tmp_path, gain=70.0)
    better(run)
    with pytest.raises(FileError, match=r"results\.json: changed after .*hil report"):
        results_of_run(run)


def test_limits_of_a_report_belong_to_the_run(tmp_path):
    run = run_of(tmp_path)
    assert report_again(run, {"gain": Limit(None, 45.0)}).findings.verdict == "fail"
    assert read_seal(run).limits == {"gain": Limit(None, 45.0)}
    assert report_again(run).findings.verdict == "fail"  # the receiver, who gives none
    unit = read_unit_runs([run])
    assert unit.verdict == "fail" and unit.runs[0].late_limits == ("gain",)


# -- issuing -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sealed", ["sealed again", "as by an earlier version"])
def test_a_failed_valve_gets_no_pass_by_an_editor(tmp_path, sealed):
    run = run_of(tmp_path, gain=70.0)
    better(run)
    if sealed == "sealed again":
        resealed(run, "results.json")
    else:
        (run / "seal.json").unlink()
        edited(run / "end.json", lambda end: [end["sha256"].pop(name) for name in ("samples.f8", "samples.log")])
    with pytest.raises(FileError, match=r"gain: 50 ± 1 l/min, limits 40 … 60, pass in the results, 70 ± 1 .* fail by"):
        passport_of(tmp_path, run)
    assert not (tmp_path / "unit.pdf").exists()


@pytest.mark.parametrize(
    ("edit", "refused"),
    [
        ({"value": 50.009}, False),  # 1 % of ± 1
        ({"value": 50.011}, True),
        ({"std": 0.504}, False),
        ({"std": 0.51}, True),
        ({"std": None}, True),
        ({"high": 61.0}, True),
        ({"unit": "l/h"}, True),
        ({"name": "flow"}, True),
        ({"meaning": "what we like"}, True),
    ],
)
def test_a_figure_moves_by_no_more_than_a_hundredth_of_its_width(tmp_path, edit, refused):
    run = run_of(tmp_path)
    edited(run / "results.json", lambda results: results["values"][0].update(edit))
    resealed(run, "results.json")
    if refused:
        with pytest.raises(FileError, match="not what the samples of the run say"):
            read_unit_runs([run])
    else:
        assert read_unit_runs([run]).verdict == "pass"


def test_a_curve_or_a_deviation_that_was_taken_out_is_missed(tmp_path):
    run = run_of(tmp_path)
    edited(run / "results.json", lambda results: results.update(deviations=[]))
    resealed(run, "results.json")
    with pytest.raises(FileError, match="'oil was not sampled' is missing"):
        read_unit_runs([run])
    run = run_of(tmp_path, name="other")
    edited(run / "results.json", lambda results: results["curves"][0]["rows"][7].__setitem__(1, 90.0))
    resealed(run, "results.json")
    with pytest.raises(FileError, match="curve flow_curve: not the one"):
        read_unit_runs([run])


def test_samples_sealed_again_with_a_forged_checksum_are_another_run_on_the_trail(tmp_path):
    run = on_a_trail(tmp_path, gain=70.0)
    assert passport_of(tmp_path, run, "a.pdf").unit.verdict == "fail"
    twin = run_of(tmp_path / "elsewhere", gain=50.0)
    for path in run.iterdir():
        path.write_bytes((twin / path.name).read_bytes())
    with pytest.raises(FileError, match="not the one that stands in the audit trail"):
        passport_of(tmp_path, run, "b.pdf")


@pytest.mark.parametrize("moved", [False, True])
def test_limits_edited_in_the_seal_are_not_those_on_the_trail(tmp_path, moved):
    run = on_a_trail(tmp_path, gain=70.0)
    if moved:
        run = run.rename(tmp_path / "moved")
    seal_folder(run, {"gain": Limit(None, 90.0)})
    edited(run / "results.json", lambda r: (r["values"][0].update(low=None, high=90.0, verdict="pass"),
                                            r.update(verdict="pass")))  # fmt: skip
    resealed(run, "results.json")
    assert read_unit_runs([run]).verdict == "pass"  # in itself it is right
    with pytest.raises(FileError, match=r"seal\.json: not the one that stands in the audit trail"):
        passport_of(tmp_path, run)


def test_a_report_with_limits_stands_on_the_trail_and_on_page_one(tmp_path):
    run = on_a_trail(tmp_path)
    report_again(run, {"gain": Limit(None, 55.0)})
    assert list(chain(Audit().path))[-1].line["details"]["limits"] == {"gain": {"low": None, "high": 55.0}}
    before = head(Audit().path)
    passport_of(tmp_path, run)
    first, content = page_one(tmp_path / "unit.pdf"), content_of(tmp_path / "unit.pdf")
    assert "Limits given after the run Gain" in first
    assert before is not None and before.sha256[:16] in first
    assert content["audit_trail"] == {"line": before.number, "sha256": before.sha256, "holds": 1}
    issued = head(Audit().path)
    assert issued is not None and issued.line["details"]["sha256"] == sha256_of(tmp_path / "unit.pdf")


def test_a_run_that_the_trail_does_not_hold_is_said_on_page_one(tmp_path):
    passport_of(tmp_path, run_of(tmp_path))
    assert "Audit trail does not hold these runs" in page_one(tmp_path / "unit.pdf")


def test_a_run_that_was_stopped_is_closed_on_the_trail(tmp_path):
    def stopped():
        with on_the_trail(read_bench(benches()["brevini-hpv41"]), tmp_path / "run", {}) as begins:
            begins()
            run_of(tmp_path, outcome="KeyboardInterrupt: Ctrl-C")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    drives, stop, closes = (link.line for link in chain(Audit().path))
    assert [drives["act"], stop["act"], closes["act"]] == ["drives", "stop", "closes"]
    edited(tmp_path / "run" / "end.json", lambda end: end.update(outcome="completed"))
    for name in ("results.json", "seal.json"):
        (tmp_path / "run" / name).unlink()
    with pytest.raises(FileError, match=r"end\.json: not the one that stands in the audit trail"):
        passport_of(tmp_path, tmp_path / "run")


# -- another version of the program -----------------------------------------------------------------------


def evaluated_by_another(run: Path) -> Path:
    """As another version left it, which found less."""
    edited(run / "results.json", lambda results: results["values"][0].update(value=49.0))
    edited(run / "seal.json", lambda seal: seal.update(program=OLDER))
    resealed(run, "results.json")
    return run


def test_another_version_is_named_and_its_values_stand_until_told(tmp_path, command_line, prints):
    run, out = evaluated_by_another(run_of(tmp_path)), tmp_path / "unit.pdf"
    status, _, err = command_line("passport", run, "--out", out, "--no-model")
    assert status == 2 and OLDER in err and "gain: 49 ± 1" in err and "--evaluated-anew" in err
    words = prints("passport", run, "--out", out, "--no-model", "--evaluated-anew")
    assert "evaluated anew: " in words and "gain: 49 ± 1" in words
    first = page_one(out)
    assert f"evaluated: {OLDER}" in first and "values evaluated anew: valve-hil" in first and "50.0 ± 1.0" in first
    assert evaluate_passport(out.read_bytes()).faults == ()
    (inside,) = lay_out(out.read_bytes(), tmp_path / "laid-out")
    assert results_of_run(inside)["gain"].value == pytest.approx(50.0)
    assert results_of_run(run)["gain"].value == 49.0  # the runs are as they were


def test_the_same_figures_of_another_version_need_no_word(tmp_path):
    run = run_of(tmp_path)
    edited(run / "seal.json", lambda seal: seal.update(program=OLDER))
    passport_of(tmp_path, run)
    assert f"evaluated: {OLDER}" in page_one(tmp_path / "unit.pdf")


def test_a_folder_of_a_version_that_did_not_seal_is_taken_and_said_to_be_one(tmp_path):
    run = run_of(tmp_path)
    (run / "seal.json").unlink()
    edited(run / "end.json", lambda end: [end["sha256"].pop(name) for name in ("samples.f8", "samples.log")])
    passport_of(tmp_path, run)
    assert "an earlier version, unsealed" in page_one(tmp_path / "unit.pdf")
    found = evaluate_passport((tmp_path / "unit.pdf").read_bytes())
    assert found.faults == () and "did not seal" in found.notes[0]


# -- the receiver ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.parametrize("names", [True, False])
def test_the_receiver_evaluates_what_he_has(tmp_path, language, names, command_line, prints):
    run, out = run_of(tmp_path, gain=70.0), tmp_path / "unit.pdf"
    asked = ("passport", run, "--out", out, "--no-model", "--language", language, *(() if names else ("--no-names",)))
    prints(*asked)
    status, words, _ = command_line("verify", out, "--evaluate")
    assert status == 0 and "evaluated anew: 1 values of 1 run" in words
    told = json.loads(prints("verify", out, "--evaluate", "--json"))
    assert told["status"] == 0 and told["evaluated"]["values"] == 1 and told["evaluated"]["faults"] == []


def forged(tmp_path: Path, monkeypatch, part: str) -> Path:
    """A passport in which one part says PASS and the others FAIL, rightly signed by the owner of the key."""
    good, bad = run_of(tmp_path / "good"), run_of(tmp_path / "bad", gain=70.0)
    if part == "results":
        better(bad)
        resealed(bad, "results.json")
        monkeypatch.setattr("hil.passport.unit.disagreements", lambda *_, **__: [])
    nice, real = read_unit_runs([good]), Wanted(identify=False)
    with monkeypatch.context() as lies:
        if part == "page":
            original = issuing.certificate_of
            lies.setattr(issuing, "certificate_of", lambda _unit, *rest, **named: original(nice, *rest, **named))
        if part in ("conditions", "instruments"):
            stated = issuing.certificate_of
            other = {"conditions": [("Fluid temperature", "55 °C")],
                     "instruments": [["flow meter", "F-1", "2026-03-01", "2029-03-01", "not stated"]]}  # fmt: skip
            lies.setattr(issuing, "certificate_of", lambda *rest, **named: stated(*rest, **named) | {part: other[part]})
        if part == "certificate":
            xml = issuing.certificate_xml
            lies.setattr(issuing, "certificate_xml", lambda _unit, *rest, **named: xml(nice, *rest, **named))
        issue([bad], tmp_path / "forged.pdf", signing_key(None), real)
    monkeypatch.undo()
    return tmp_path / "forged.pdf"


@pytest.mark.parametrize(
    ("part", "says"),
    [
        ("page", "page one does not say what the results say"),
        ("conditions", "page one does not say what the runs say: Fluid temperature 40"),
        ("instruments", "page one does not say what the runs say: 2027-03-01"),
        ("certificate", "certificate.xml does not say what the results say"),
        ("results", "gain: 50 ± 1 l/min, limits 40 … 60, pass in the results, 70 ± 1"),
    ],
)
def test_who_holds_the_key_cannot_make_one_part_lie(tmp_path, monkeypatch, stranger, part, says, command_line, prints):
    state = tmp_path / "state"
    file = forged(tmp_path, monkeypatch, part)
    monkeypatch.setenv("HIL_STATE_DIR", str(state))
    monkeypatch.syspath_prepend(str(stranger))
    prints("verify", file, "--trust", state / "passport-certificate.pem")
    status, words, _ = command_line("verify", file, "--evaluate")
    assert (
        status == 1 and f"does not follow from the samples: {'run run: ' if part == 'results' else ''}{says}" in words
    )


def test_samples_that_were_exchanged_inside_do_not_follow(tmp_path):
    out = tmp_path / "unit.pdf"
    passport_of(tmp_path, run_of(tmp_path, gain=70.0))
    other = run_of(tmp_path / "other", gain=50.0)
    with pikepdf.open(out) as pdf:
        for name in ("samples.f8", "samples.log", "end.json", "seal.json"):
            pdf.attachments[f"runs/run/{name}"].get_file().obj.write((other / name).read_bytes())
        pdf.save(tmp_path / "changed.pdf")
    faults = evaluate_passport((tmp_path / "changed.pdf").read_bytes()).faults
    assert faults == evaluate_passport((tmp_path / "changed.pdf").read_bytes()).faults
    assert "changed after the run was sealed" in faults[0] and "hil report" not in faults[0]


def test_pages_that_cannot_be_read_do_not_follow(tmp_path):
    out = tmp_path / "unit.pdf"
    passport_of(tmp_path, run_of(tmp_path))
    with pikepdf.open(out) as pdf:
        pdf.pages[0].obj.Contents = pdf.make_stream(b"BT ET")
        pdf.save(tmp_path / "blank.pdf")
    faults = evaluate_passport((tmp_path / "blank.pdf").read_bytes()).faults
    assert any("page one does not say" in fault for fault in faults)


def test_a_passport_of_8f99e50_is_evaluated_and_its_results_called_unsealed():
    found = evaluate_passport((SAMPLES / "8f99e50" / "passport.pdf").read_bytes())
    assert (found.faults, found.values, found.runs) == ((), 14, 1) and "did not seal" in found.notes[0]


def test_the_annex_says_the_model_that_is_inside(tmp_path):
    with pikepdf.open(SAMPLES / "8f99e50" / "passport.pdf") as pdf:
        inside = pdf.attachments["model.json"].get_file()
        model = json.loads(inside.read_bytes())
        name, told = next(iter(model["parameters"].items()))
        model["parameters"][name] = {**told, "value": 0.98 * told["value"]}
        inside.obj.write(json.dumps(model).encode())
        pdf.save(tmp_path / "changed.pdf")
    (fault,) = evaluate_passport((tmp_path / "changed.pdf").read_bytes()).faults
    assert fault.startswith(f"the annex does not say what model.json says: {name.replace('_', ' ')}")


def test_a_broken_trail_issues_nothing(tmp_path):
    run = on_a_trail(tmp_path)
    lines = Audit().path.read_bytes().splitlines(keepends=True)
    Audit().path.write_bytes(b"".join(lines[1:]))
    with pytest.raises(FileError, match="line 1 does not follow"):
        passport_of(tmp_path, run)


def test_a_procedure_that_is_not_here_can_be_evaluated_by_nobody(tmp_path, monkeypatch, stranger, command_line):
    from hil.catalog import entries

    out = tmp_path / "unit.pdf"
    run = run_of(tmp_path)
    passport_of(tmp_path, run)
    monkeypatch.setattr("sys.path", [path for path in __import__("sys").path if path != str(stranger)])
    entries.cache_clear()
    assert command_line("verify", out)[0] == 0
    status, words, _ = command_line("verify", out, "--evaluate")
    assert status == 1 and "sine_gain" in words
    assert command_line("passport", run, "--out", tmp_path / "b.pdf", "--no-model")[0] == 2


def test_a_run_with_holes_and_one_that_broke_off_are_evaluated_like_others(tmp_path):
    run = run_of(tmp_path, outcome="tripped: over-pressure")
    (run / "results.json").unlink()
    (run / "seal.json").unlink()
    assert read_unit_runs([run]).verdict == "cannot tell"
    assert np.isfinite(read(run).time_s).all()


def page_one(file: Path) -> str:
    from pypdf import PdfReader

    return " ".join(PdfReader(file).pages[0].extract_text().split())


def content_of(file: Path) -> dict:
    with pikepdf.open(file) as pdf:
        return json.loads(pdf.attachments["passport.json"].get_file().read_bytes())
