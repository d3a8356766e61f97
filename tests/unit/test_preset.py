"""Settings by the name that a bench file gives them."""

import pytest

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.errors import SettingError
from hil.record.run_folder.header import read_header
from hil.session.preset import preset_names, preset_settings
from hil.session.procedure import load_procedure

pytestmark = pytest.mark.usefixtures("unprinted")

STEP = load_procedure("step_response")


@pytest.fixture
def bench(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(
        'based_on = "brevini-hpv41"\n[presets.step_response.quick]\nlevels = [0, 50]\nhold_s = "3 s"\n'
        "[presets.step_response.wrong]\nhold_s = -1\n"
    )
    return path


def test_a_preset_is_understood_as_typed_settings_are(bench):
    file = read_bench(bench)
    assert preset_names(file, STEP) == ["quick", "wrong"]
    assert preset_settings(file, STEP, "quick") == {"levels": (0.0, 50.0), "hold_s": 3.0}
    assert preset_settings(file, STEP, "") == {}
    assert preset_settings(read_bench(benches()["four-way-lab"]), load_procedure("iso_10770_1"), "") == {
        "high_hz": 50.0
    }


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("quik", "no preset 'quik' of step_response; there are: quick, wrong"),
        ("wrong", r"\[presets.step_response.wrong\]: setting hold_s"),
    ],
)
def test_a_preset_that_cannot_be_taken_names_the_file(bench, name, why):
    with pytest.raises(SettingError, match=f"{bench}: {why}"):
        preset_settings(read_bench(bench), STEP, name)


def test_run_takes_a_preset_and_what_is_typed_goes_before(bench, prints):
    out = bench.parent / "run"
    typed = ["--preset", "quick", "--set", "hold_s=2", "--out", out, "--archive", bench.parent]
    prints("run", "step_response", "--bench", bench, *typed)
    settings = read_header(out).meta["settings"]
    assert (settings["levels"], settings["hold_s"]) == ([0.0, 50.0], 2.0)


def test_check_names_a_preset_of_an_unknown_procedure(bench, command_line):
    bench.write_text('based_on = "brevini-hpv41"\n[presets.step_respnse.quick]\nlevels = [0, 50]\n')
    status, out, err = command_line("check", bench)
    assert status == 2 and "presets.step_respnse" in out + err


def test_check_names_what_a_procedure_refuses(bench, command_line):
    bench.write_text(bench.read_text() + "[acceptance.step_response]\nrize = { high = 350 }\n")
    status, out, _ = command_line("check", bench)
    assert status == 2 and len(out.splitlines()) == 2
    assert f"{bench}:6: presets.step_response.wrong.hold_s: setting hold_s: -1 s; it must be above 0" in out
    assert f"{bench}:8: acceptance.step_response.rize: limit 'rize': not measured here; measured are: onset" in out
