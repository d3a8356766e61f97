"""The command line is a thin layer over the public interface: what one prints or writes the other returns."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import hil
from hil import api
from hil.errors import FileError
from hil.record.plain import to_json
from hil.record.reading import AS_IT_IS
from hil.record.recording import Recording
from hil.session import fleet
from hil.session.identification import read_for
from tests.passports import run_of

# on one worker: its model is identified once
pytestmark = [pytest.mark.xdist_group("command is api"), pytest.mark.usefixtures("unprinted")]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("commands") / "run"
    sets = {"frequencies": (1.0, 2.0, 4.0), "amplitudes": (20.0,), "biases": (50.0,), "measure_s": 0.5, "rate_hz": 500}
    return hil.run("frequency_response", "brevini-hpv41", folder, **sets).folder


@pytest.fixture(scope="module")
def short(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("commands") / "short.csv"
    hil.write(hil.read(run).rows(1000, 1500), path)
    return path


@pytest.fixture
def said(command_line):
    def called(*arguments, status=0):
        ended = command_line(*arguments)
        assert ended.status == status, ended.err
        return ended.out

    return called


@pytest.fixture
def through(monkeypatch):
    """What the named function of the interface returned."""

    def watch(name):
        function, returned = getattr(api, name), []

        def watched(*arguments, **named):
            returned.append(function(*arguments, **named))
            return returned[-1]

        monkeypatch.setattr(api, name, watched)
        return returned

    return watch


def same_samples(one, other):
    np.testing.assert_array_equal(one.time_s, other.time_s)
    assert one.channels.keys() == other.channels.keys()
    for name, channel in one.channels.items():
        np.testing.assert_allclose(channel.values, other.channels[name].values, rtol=1e-12)


def test_convert(said, through, run, tmp_path):
    returned = through("read")
    said("convert", run, tmp_path / "run.csv")
    same_samples(returned[0], hil.read(run))
    same_samples(hil.read(tmp_path / "run.csv"), hil.read(run))


def test_identify_a_response_of_a_run(said, through, run, tmp_path):
    returned = through("identify")
    options = ("--poles", 2, "--zeros", 0, "--no-dead-time", "--json")
    told = json.loads(said("identify", run, "--plant", "transfer-function", "--out", tmp_path / "m.json", *options))
    assert len(returned) == 1
    again = hil.identify([run], "transfer-function", poles=2, zeros=0, dead_time=False)
    assert told == {**again.as_dict(), "assumed": told["assumed"]}
    assert told["schema"] == "hil.identified/1"
    assert told["assumed"] == [f"{run}, +50 ± 20 %: the frequency response as its procedure measured it"]
    assert hil.load_model(tmp_path / "m.json").values == pytest.approx(again.model.values)
    assert "<table>" in again._repr_html_()


def test_a_response_of_a_run_is_compared_with_what_was_fitted_to_it(run, tmp_path):
    """Gain at rest beside the gain that the procedure measured at its lowest line, and the lines themselves."""
    found = hil.identify(
        [run], "transfer-function", poles=2, zeros=0, dead_time=False, inputs=["command"], output="flow"
    )
    assert str(found) == found.text
    (told,) = hil.compare(found.model, [run])
    assert told.name.endswith("+50 ± 20 %") and told.as_dict()["kind"] == "frequency response"
    assert told.fit == pytest.approx(found.fits[told.name])
    measured = next(v for v in hil.results(run).values if v.name.startswith("gain, "))
    at_lowest = abs(hil.read(run, responses=True).response[0])
    assert at_lowest == pytest.approx(measured.value, rel=0.01)


def test_other_channels_of_a_run_are_not_fitted_to_the_response_of_its_flow(run):
    read = read_for("transfer-function", [run], AS_IT_IS, "", ["command"], "spool position")
    assert isinstance(read[0], Recording)


def test_compare_and_simulate(said, through, short, tmp_path):
    hil.save_model(hil.typical_model("brevini-hpv41"), tmp_path / "model.json")
    compared, simulated = through("compare"), through("simulate")
    told = json.loads(said("compare", "--model", tmp_path / "model.json", short, "--json"))
    assert len(compared) == 1
    (again,) = hil.compare(tmp_path / "model.json", [short])
    assert told["recordings"] == [json.loads(json.dumps(again.as_dict()))]
    said("simulate", "--model", tmp_path / "model.json", "--input", short, "--out", tmp_path / "out.csv")
    assert len(simulated) == 1
    same_samples(hil.read(tmp_path / "out.csv"), hil.simulate(tmp_path / "model.json", short))


def test_average_and_linearise(said, through, tmp_path):
    averaged, linearised = through("average"), through("linearise")
    said("average", "hpv41-plus-5", "hpv41-plus-10", "--out", tmp_path / "mean.csv")
    assert len(averaged) == 1
    mean = hil.average(["hpv41-plus-5", "hpv41-plus-10"])
    np.testing.assert_allclose(hil.read(tmp_path / "mean.csv").response, mean.response, rtol=1e-9)
    told = json.loads(said("linearise", "hpv41-plus-10", "--at", 50, "--poles", 3, "--zeros", 1, "--json"))
    assert len(linearised) == 1
    again = hil.linearise("hpv41-plus-10", 50.0, poles=3, zeros=1)
    assert told["denominator"] == again.model.denominator.tolist()


def test_results_and_export(said, through, run, tmp_path):
    returned, exported = through("results"), through("export")
    assert said("results", run, "--json", "-") == returned[0].as_json() == hil.results(run).as_json()
    for form in ("python", "matlab", "json", "csv"):
        text = said("export", run, "--to", form)
        assert text == exported[-1].text == hil.export(run, form).text == hil.export(hil.results(run), form).text
    path = tmp_path / "valve.c"  # its name stands in it
    said("export", "hpv41-plus-10", "--to", "c", "--out", path)
    written = path.read_bytes()
    assert hil.export("hpv41-plus-10", "c", path).path == path
    assert path.read_bytes() == written


def test_run(said, through, tmp_path):
    returned = through("run")
    step = ("step_response", "--bench", "brevini-hpv41", "--set", "levels=0,80", "--operator", "ab")
    said("run", *step, "--out", tmp_path / "one")
    again = hil.run("step_response", "brevini-hpv41", tmp_path / "other", levels=(0, 80), operator="ab")
    assert returned[0].findings.measured == again.findings.measured
    same_samples(hil.read(tmp_path / "one"), hil.read(tmp_path / "other"))
    assert hil.read(tmp_path / "one").meta["operator"] == "ab"
    assert json.loads(said("report", tmp_path / "one", "--json")) == json.loads(hil.results(tmp_path / "one").as_json())


def test_diagnose(said, through, short, tmp_path):
    returned = through("diagnose")
    model = tmp_path / "model.json"
    hil.save_model(hil.typical_model("brevini-hpv41"), model)
    told = json.loads(said("diagnose", "--model", model, short, "--out", tmp_path / "d", "--json"))
    assert len(returned) == 1
    again = hil.diagnose(model, [short])
    origin = {"simulated": False, "other_plant": []}  # what its files say of what it was made of
    assert {**told, "seconds": 0} == origin | {**json.loads(json.dumps(again.diagnosis.as_dict())), "seconds": 0}
    assert json.loads((tmp_path / "d" / "diagnosis.json").read_text("utf-8"))["schema"] == told["schema"]
    (axis,) = again.plot().axes
    assert len(axis.lines[0].get_xdata()) == len(hil.read(short))


def test_diagnose_a_fleet(said, through, short, tmp_path, monkeypatch):
    worked = []
    monkeypatch.setattr(
        fleet, "over_processes", lambda work, tasks, *_: (worked.append(task.name) or work(task) for task in tasks)
    )
    returned, model, chosen = through("diagnose_fleet"), tmp_path / "model.json", []
    hil.save_model(hil.typical_model("brevini-hpv41"), model)
    read = hil.read(short)
    still = replace(read, channels={**read.channels, "flow": replace(read.channel("flow"), values=np.ones(len(read)))})
    for name, recording in (("good", read), ("dead", still)):
        (tmp_path / name).mkdir()
        hil.write(recording, tmp_path / name / "short.csv")
        chosen.append(tmp_path / name)
    arguments = [argument for folder in chosen for argument in ("--fleet", folder)]
    told = json.loads(said("diagnose", *arguments, "--model", model, "--out", tmp_path / "d", "--json", status=2))
    assert len(returned) == 1 and told["schema"] == "hil.fleet/1"
    good, dead = hil.diagnose_fleet(chosen, model=model)
    assert good.diagnosed.diagnosis.verdict == told["units"][0]["diagnosis"]["verdict"] == "consistent"
    assert "stands at 1 all the time" in dead.error == told["units"][1]["error"]
    assert (tmp_path / "d" / "good" / "report.html").is_file() and not (tmp_path / "d" / "dead").exists()
    del worked[:]
    again = json.loads(said("diagnose", *arguments, "--model", model, "--out", tmp_path / "d", "--json", status=2))
    assert again == told and worked == []
    hil.write(read, tmp_path / "dead" / "short.csv")
    assert [one.error for one in hil.diagnose_fleet(chosen, model=model, out=tmp_path / "d")] == ["", ""]
    assert worked == ["dead"]


def test_two_units_of_a_fleet_with_one_name_are_refused(tmp_path):
    with pytest.raises(FileError, match="two folders of a fleet are called 'valve'"):
        hil.diagnose_fleet([tmp_path / "a" / "valve", tmp_path / "b" / "valve"])


def test_diff(said, through, short, tmp_path):
    """Channels with other names, one without a unit, give what the model's own names give."""
    returned, model = through("diff"), tmp_path / "model.json"
    hil.save_model(hil.typical_model("brevini-hpv41"), model)
    read = hil.read(short)
    called = {"command [%]": "cmd [%]", "flow [l/min]": "q"}
    theirs = {"time [s]": read.time_s, **{called.get(c.heading, c.heading): c.values for c in read.channels.values()}}
    for name in ("old", "new"):
        for folder in (tmp_path / name, tmp_path / "own" / name):
            folder.mkdir(parents=True)
        hil.write(read, tmp_path / "own" / name / "short.csv")
        pd.DataFrame(theirs).to_csv(tmp_path / name / "short.csv", index=False)
    given = ("--input", "cmd", "--output", "q", "--unit", "q=l/min")
    told = json.loads(said("diff", tmp_path / "old", tmp_path / "new", "--model", model, *given, "--json"))
    assert len(returned) == 1 and told["verdict"] == "unchanged"
    again = hil.diff(tmp_path / "own" / "old", tmp_path / "own" / "new", model=hil.load_model(model))
    assert told == json.loads(to_json(again.as_dict()))


def test_passport(said, through, tmp_path, own_state, stranger):
    returned, unit = through("issue_passport"), run_of(tmp_path)
    told = json.loads(said("passport", unit, "--no-model", "--no-names", "--out", tmp_path / "one.pdf", "--json"))
    assert len(returned) == 1
    again = hil.issue_passport([unit], tmp_path / "other.pdf", identify=False, names=False)
    assert told["serial"] == again.unit.serial and told["verdict"] == again.unit.verdict
    assert told["fingerprint"] == again.signer.fingerprint
    assert [b"Muster" in (tmp_path / name).read_bytes() for name in ("one.pdf", "other.pdf")] == [False, False]


def test_what_is_installed_as_json(said):
    told = json.loads(said("list", "procedures", "--json"))
    assert told["schema"] == "hil.installed/1"
    assert "step_response" in [one["name"] for one in told["procedures"]]
