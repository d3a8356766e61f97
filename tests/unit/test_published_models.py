"""Published valves as model files and benches: equal to the papers' numbers, and found by name."""

from dataclasses import replace
from pathlib import Path

import pytest

import hil
from hil.bench.base import whole_bench
from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.catalog import models
from hil.errors import FileError
from hil.findings.results import read_results
from hil.identification.grey_box.identify import starting_model
from hil.physics.model import load_model
from hil.physics.published import tordal
from hil.physics.published.models import FOLDER, TABLES, published_models, published_tables
from hil.physics.transfer_function import from_parameters
from hil.record.read import read_any

pytestmark = pytest.mark.usefixtures("unprinted")


def test_model_files_are_what_the_papers_numbers_make(tmp_path):
    made = published_models()
    assert {path.stem for path in FOLDER.glob("*.json")} == set(made)
    for name, model in made.items():
        assert load_model(FOLDER / f"{name}.json") == model, f"run: python -m hil.physics.published.models ({name})"
        assert model.origin["title"]


def test_installed_model_is_loaded_by_its_bare_name():
    assert set(published_models()) <= set(models())
    run = tordal.RUNS[1]
    linear = from_parameters(load_model(Path("hpv41-plus-10")).values)
    assert linear.numerator == pytest.approx([run.b1, run.b0])
    assert linear.denominator == pytest.approx([1.0, run.a2, run.a1, run.a0])


def test_every_published_valve_has_a_bench():
    read = [read_bench(path).bench for path in benches().values()]
    assert set(published_models()) <= {bench.simulation.get("plant", bench.valve.plant) for bench in read}


def test_bench_gives_back_the_published_transfer_function(tmp_path, prints):
    frequencies = ",".join(str(f) for f in tordal.FREQUENCIES_HZ[::2])
    options = ("--set", f"frequencies={frequencies}", "--set", "biases=50", "--set", "amplitudes=10")
    options += ("--set", "poles=3", "--set", "zeros=1", "--set", "dead_time=no")
    run = ("run", "frequency_response", "--bench", "hpv41-plus-10", "--out", tmp_path / "run", *options)
    prints(*run)
    fitted = read_results(tmp_path / "run" / "results.json").transfer_functions[0]
    published = (-150.8, 6361.0, 31.7, 1225.0, 6345.0)
    for value, variance, expected in zip(
        fitted.coefficient_values, [row[i] for i, row in enumerate(fitted.covariance)], published, strict=True
    ):
        assert abs(value - expected) < 4.0 * variance**0.5
        assert value == pytest.approx(expected, rel=0.01)


def test_list_shows_benches_and_models(command_line):
    said = command_line("list", "models")
    assert "hpv41-plus-10" in said.out
    assert "table 1" in said.out
    said = command_line("list", "benches")
    assert "hpv41-identified" in said.out
    assert "HPV41 as identified" in said.out


# -- a bench that is based on another ----------------------------------------------------------------------


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def test_bench_is_another_one_with_changes(tmp_path):
    path = written(tmp_path / "mine.toml", 'based_on = "brevini-hpv41"\nname = "mine"\n[valve]\nsettling_s = 3.0\n')
    mine, base = read_bench(path), read_bench(benches()["brevini-hpv41"])
    assert (mine.bench.name, mine.bench.valve.settling_s) == ("mine", 3.0)
    assert mine.bench.channels == base.bench.channels
    assert mine.bench.valve.name == base.bench.valve.name
    again = written(tmp_path / "again.toml", mine.text)
    assert read_bench(again).bench == mine.bench


def test_fault_of_the_own_file_is_told_with_its_line(tmp_path):
    path = written(tmp_path / "mine.toml", 'based_on = "brevini-hpv41"\n[channels.command]\nsafe = 200.0\n')
    with pytest.raises(FileError, match=r"mine\.toml:3.*200"):
        read_bench(path)


def test_another_device_and_another_terminal_keep_nothing_of_those_of_the_base(tmp_path):
    text = (
        'based_on = "four-way-lab"\n[devices.daq]\ndriver = "modbus"\nmodel = "wago-750"\naddress = "127.0.0.1:1502"\n'
        '[devices.other]\nsimulated = "in_process"\n[channels."tank setting"]\ndevice = "other"\nterminal = "ao0"\n'
        "calibration = { slope = 2.0 }\n"
    )
    mine, base = whole_bench(written(tmp_path / "mine.toml", text), text)[0], read_bench(benches()["four-way-lab"])
    assert mine["devices"]["daq"] == {"driver": "modbus", "model": "wago-750", "address": "127.0.0.1:1502"}
    tank = mine["channels"]["tank setting"]
    assert (tank["device"], tank["terminal"], tank["calibration"]) == ("other", "ao0", {"slope": 2.0})
    assert "pwm" not in tank and tank["limits"]["high"] == base.bench.channels["tank setting"].limits.high
    assert mine["channels"]["oil temperature"]["pwm"] == {"carrier_hz": 1000.0}  # that one stays where it was


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('based_on = "nothing"', "did you mean|known"),
        ('based_on = "gone.toml"', "no such bench file"),
        ("based_on = 3", "name a bench file"),
        ('based_on = "mine.toml"', "one on itself"),
    ],
)
def test_base_that_cannot_be_is_refused_in_words(tmp_path, text, said):
    with pytest.raises(FileError, match=said):
        read_bench(written(tmp_path / "mine.toml", text + "\n"))


def test_model_beside_the_base_is_found_from_elsewhere(tmp_path):
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "valve.json").write_text((FOLDER / "hpv41-identified.json").read_text("utf-8"), "utf-8")
    written(tmp_path / "lab" / "base.toml", 'based_on = "brevini-hpv41"\n[valve]\nplant = "valve.json"\n')
    mine = read_bench(written(tmp_path / "mine.toml", 'based_on = "lab/base.toml"\nname = "mine"\n'))
    assert load_model(Path(mine.bench.valve.plant)).plant == "brevini-hpv41"


# -- tables of the published responses ---------------------------------------------------------------------

ORDERS = ("--plant", "transfer-function", "--poles", "3", "--zeros", "1", "--no-dead-time")
RUNS = [name for name in published_models() if name.startswith(("hpv41-plus", "hpv41-minus"))]


def _function(path):
    return from_parameters(load_model(path).values)


def test_table_files_are_what_the_papers_numbers_make():
    assert {path.stem for path in TABLES.glob("*.csv")} == set(published_tables()) == set(RUNS)
    for name, table in published_tables().items():
        assert read_any(name).response == pytest.approx(table.response, rel=1e-12)


@pytest.mark.parametrize("run", tordal.RUNS, ids=lambda run: run.name)
def test_section_6_gives_every_row_of_tables_1_and_2(tmp_path, run, prints):
    name = f"hpv41-{'plus' if run.bias > 0 else 'minus'}-{run.amplitude:g}"
    prints("identify", name, *ORDERS, "--out", tmp_path / "g.json")
    linear = _function(tmp_path / "g.json")
    assert linear.numerator == pytest.approx([run.b1, run.b0], rel=1e-4)
    assert linear.denominator == pytest.approx([1.0, run.a2, run.a1, run.a0], rel=1e-4)


def test_mean_of_six_responses_is_the_mean_model(tmp_path, prints):
    mean, found = tmp_path / "mean.csv", tmp_path / "mean.json"
    prints("average", *RUNS, "--normalised", "--out", mean)
    options = (*ORDERS, "--weights", "uniform", "--out", found)
    prints("identify", mean, *options)
    assert _function(found).numerator == pytest.approx(tordal.MEAN_MODEL.numerator, rel=1e-3)
    assert _function(found).denominator == pytest.approx(tordal.MEAN_MODEL.denominator, rel=1e-3)


def test_average_in_python_refuses_other_frequencies():
    one = hil.read("hpv41-plus-10")
    two = replace(one, frequency_hz=one.frequency_hz * 1.01)
    with pytest.raises(FileError, match="other frequencies"):
        hil.average([one, two])
    assert hil.average([one, one]).response == pytest.approx(one.response)


def test_an_identification_starts_from_an_installed_model_by_name():
    assert starting_model("hpv41-identified").parameters["pilot_ratio"].value == 1.107
