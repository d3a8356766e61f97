"""Settings that cannot be: refused with one clear line before the rig is asked for anything that moves."""

import math
import re

import numpy as np
import pytest

from hil.bench.read import read_bench
from hil.catalog import entries
from hil.cli import error_message
from hil.errors import SettingError
from hil.rig import RoleChannel
from hil.session.procedure import load_procedure
from hil.session.run import rehearse_procedure
from hil.session.setting import parse_settings
from tests.bench_files import bench_file
from tests.still_rig import Refusing, Still

BOTH_WAYS = RoleChannel("command", "%", -100.0, 100.0)
ONE_WAY = RoleChannel("current", "A", 0.0, 2.2)
FLOWING = RoleChannel("flow", "l/min", -100.0, 100.0)
TRAVELLING = RoleChannel("position", "mm", -130.0, 130.0, integrates=True)


LAB = "four-way-lab"
SINES, MULTISINE, FLOW, STEP, LARGE = (
    "frequency_response", "multisine_response", "flow_curve", "step_response", "large_sine",
)  # fmt: skip


def asked(name, rig, settings):
    """Begin a procedure as `hil run` does."""
    procedure = load_procedure(name)
    procedure.run(rig, **parse_settings(procedure.settings, settings))


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        (SINES, {"frequencies": ()}, "frequencies: none given"),
        (SINES, {"frequencies": (1.0, 0.5)}, "0.5 Hz must come before 1 Hz; sort them"),
        (SINES, {"frequencies": (-1.0, 0.5)}, "setting frequencies: -1 Hz; it must be above 0"),
        (SINES, {"frequencies": (math.nan,)}, "setting frequencies: nan Hz; it must be above 0"),
        (SINES, {"rate_hz": 90.0}, "90 Hz is below 20 × the top frequency 4.9 Hz; at least 98 Hz"),
        (
            SINES,
            {"amplitudes": (5.0, 60.0)},
            "setting amplitudes: 60 % about 50 % is -10 … 110 %, outside the range of",
        ),
        (SINES, {"amplitudes": (0.0,)}, "setting amplitudes: 0 %; it must be above 0"),
        (SINES, {"amplitudes": ()}, "at least one of each is needed"),
        (SINES, {"amplitudes": (math.nan,)}, "setting amplitudes: nan %"),
        (SINES, {"biases": (130.0,)}, "setting biases: 130 % is outside the range of 'command', -100 … 100 %"),
        (SINES, {"measure_periods": 1}, "setting measure_periods: 1; allowed are 2 to 10000"),
        (SINES, {"tolerance": 0.0}, "setting tolerance: 0 %; it must be above 0"),
        (SINES, {"longest_wait_s": -1.0}, "setting longest_wait_s: -1 s; it must be at least 0"),
        (SINES, {"measure_s": math.inf}, "setting measure_s: inf s"),
        (SINES, {"full_command": -5.0}, "setting full_command: -5; it must be above 0"),
        (SINES, {"poles": 6}, "setting poles: 6; allowed are 1 to 5"),
        (SINES, {"poles": 2, "zeros": 3}, "setting zeros: 3; allowed are 0 to 2"),
        (MULTISINE, {"high_hz": 0.05}, "setting high_hz: 0.05 Hz; it must be above low_hz, 0.1 Hz"),
        (MULTISINE, {"base_hz": 0.0}, "setting base_hz: 0 Hz; it must be above 0"),
        (MULTISINE, {"base_hz": 0.3}, "one period must be whole samples at 1000 Hz"),
        (MULTISINE, {"rate_hz": 90.0}, "90 Hz is below 20 × the top frequency"),
        (MULTISINE, {"periods": 1}, "setting periods: 1; allowed are 2 to 10000"),
        (MULTISINE, {"amplitudes": (51.0,)}, "51 % about 50 % is -1 … 101 %, outside"),
        (FLOW, {"low": 50.0, "high": 40.0}, "from 50 % to 40 %; high must be above low"),
        (FLOW, {"high": 120.0}, "setting high: 120 % is outside the range of 'command', -100 … 100 %"),
        (FLOW, {"cycle_s": 5.0}, "setting cycle_s: 5 s; it must be at least 8"),
        (FLOW, {"cycles": 0}, "setting cycles: 0; allowed are 1 to 10000"),
        (STEP, {"levels": (0.0,)}, "setting levels: 1 given; a step needs at least two"),
        (STEP, {"levels": (0.0, 101.0)}, "setting levels: 101 % is outside"),
        (STEP, {"hold_s": 0.0}, "setting hold_s: 0 s; it must be above 0"),
        (STEP, {"band": 60.0}, "setting band: 60 %; it must be above 0 and below 50"),
        (LARGE, {"amplitude": 101.0}, "setting amplitude: 101 % about 0 % is -101 … 101 %, outside"),
        (LARGE, {"bias": 100.0}, "setting bias: 100 % is an end of the range"),
        (LARGE, {"frequencies": (0.5, 0.1)}, "0.1 Hz must come before 0.5 Hz"),
        (LARGE, {"rate_hz": 5.0}, "5 Hz is below 20 × the top frequency 0.5 Hz"),
    ],
)
def test_refused_before_anything_moves(name, settings, says):
    with pytest.raises(SettingError) as refused:
        asked(name, Still(BOTH_WAYS, FLOWING), settings)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        (
            SINES,
            {"amplitudes": (60.0,)},
            "60 % about 50 % is -0.22 … 2.42 A, outside the range of 'current', 0 … 2.2 A (100 % is 2.2 A from",
        ),
        (STEP, {"sequence": "small"}, "setting sequence: -10 % is -0.22 A, outside"),
        (LARGE, {"amplitude": 51.0}, "51 % about 50 % is -0.022 … 2.222 A, outside"),
    ],
)
def test_a_command_that_goes_one_way_is_asked_in_its_own_unit(name, settings, says):
    with pytest.raises(SettingError) as refused:
        asked(name, Still(ONE_WAY, FLOWING), settings)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        (FLOW, {}, "a flow curve needs a response that comes to stand; 'position' moves on for as long as"),
        (STEP, {}, "a step response needs a response that comes to stand"),
        (LARGE, {}, "is off neutral: give an amplitude, or run sine_position"),
        (LARGE, {"amplitude": 5.0, "bias": 20.0}, "setting bias: 20 %; 'position' moves on"),
        (SINES, {"biases": (0.0, 30.0)}, "setting biases: 30 %; 'position' moves on"),
        (MULTISINE, {"biases": (-30.0,)}, "so only 0 % is allowed: sine_position and velocity_steps"),
    ],
)
def test_a_response_that_moves_on_is_not_driven_to_its_end(name, settings, says):
    with pytest.raises(SettingError) as refused:
        asked(name, Still(BOTH_WAYS, TRAVELLING), settings)
    assert says in str(refused.value)


NO_FLOW = {"flow": {"role": None}, "spool position": {"role": "response"}, "command": {"witness": None}}
BY_HAND = {"low": 0.0, "high": 210.0, "usual": 100.0, "tolerance": 2.0}


@pytest.mark.parametrize(
    ("name", "bench", "channels", "given", "says"),
    [
        ("proof_pressure", LAB, {}, {"pressure": "400"}, "280 bar is outside the range of 'supply setting'"),
        ("load_step", LAB, {}, {"load": "100"}, "setting load: 100 % is where 'load orifice' stands already"),
        ("load_step", LAB, {}, {"load": "120"}, "120 % is outside the range of 'load orifice', 0 … 100 %"),
        ("load_step", LAB, {}, {"commands": "0"}, "setting commands: each must differ from 0 %"),
        ("load_step", "brevini-hpv41", {"supply pressure": {"role": "load orifice", "by_hand": BY_HAND}}, {},
         "a load step needs an output that steps the load; 'supply pressure' is set"),
        ("null_shift", LAB, {}, {"supply_change": "250"},
         "setting supply_change: -105 bar is outside the range of 'supply setting', 0 … 210 bar"),
        ("null_shift", LAB, {}, {"temperature_change": "50"}, "setting temperature_change: -10 degC"),
        ("null_shift", LAB, {}, {"conditions": "supply pressure,supply pressure"}, "each once"),
        ("limiting_power", LAB, {}, {"supplies": "50,100"}, "supplies: 2 given; a limiting power needs 3 at least"),
        ("limiting_power", LAB, NO_FLOW, {}, "'spool position' is in %; a limiting power needs a flow"),
    ],
)  # fmt: skip
def test_what_the_bench_cannot_do_is_refused_in_the_rehearsal(name, bench, channels, given, says, tmp_path):
    file = read_bench(bench_file(tmp_path / "bench.toml", bench, channels=channels))
    with pytest.raises(SettingError, match=re.escape(says)):
        rehearse_procedure(load_procedure(name), file, given)


@pytest.mark.parametrize("name", [SINES, MULTISINE])
def test_a_response_that_moves_on_is_tried_about_neutral(name):
    rig = Refusing(BOTH_WAYS, TRAVELLING)
    with pytest.raises(SettingError, match="checked"):
        load_procedure(name).run(rig)
    assert abs(rig.path.max() + rig.path.min()) < 1.0


def test_everything_that_is_checked_by_nothing_but_the_rig_is_checked_whole_and_first():
    for name in (SINES, MULTISINE, FLOW, STEP, LARGE):
        rig = Refusing(BOTH_WAYS, FLOWING)
        with pytest.raises(SettingError, match="checked"):
            load_procedure(name).run(rig)
        assert rig.path[-1] == 0.0
        assert np.ptp(rig.path) >= 80.0
        assert len(rig.path) > 10_000


def test_a_range_is_shown_described_and_checked_from_one_place():
    settings = load_procedure(STEP).settings
    assert (settings["repeats"].allowed, settings["band"].allowed, settings["hold_s"].allowed) == (
        "1 … 10000", "> 0, < 50", "> 0",
    )  # fmt: skip
    assert settings["beside"].allowed == ""
    assert settings["repeats"].described().startswith("repeats: int (1 … 10000) = 1")
    assert settings["hold_s"].parsed("none") is None
    with pytest.raises(SettingError, match="setting repeats: 0; allowed are 1 to 10000"):
        settings["repeats"].parsed("0")


def test_an_angular_frequency_is_no_time():
    setting = load_procedure("sine_position").settings["frequency_rad_s"]
    assert (setting.unit, setting.parsed("2")) == ("rad/s", 2.0)


def test_each_number_of_a_list_is_held_against_the_range():
    with pytest.raises(SettingError, match="setting frequencies: -2 Hz; it must be above 0"):
        load_procedure(SINES).settings["frequencies"].parsed("1,-2,3")


@pytest.mark.parametrize("entry", sorted(one.name for one in entries("procedures")))
def test_every_default_is_within_its_own_range(entry):
    for setting in load_procedure(entry).settings.values():
        assert setting.parsed(setting.default) == setting.default


def test_say_memory_that_is_not_there_is_one_line(capfd):
    assert error_message.say(MemoryError("Unable to allocate 7.11 PiB")) == 2
    told = capfd.readouterr().err
    assert told.startswith("hil: more memory is needed than there is: Unable to allocate 7.11 PiB; a shorter test")
