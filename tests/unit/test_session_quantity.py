"""Numbers with units as people type them, in settings and limits."""

from typing import Annotated

import pytest
from annotated_types import Unit

from hil.catalog import entries
from hil.errors import SettingError
from hil.record.measurement import Limit, Measurement
from hil.session.limit import checked_limits, split_limits
from hil.session.procedure import load_procedure
from hil.session.quantity import number_in
from hil.session.setting import Setting


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("20s", "s", 20.0), ("200 ms", "s", 0.2), ("0.2s", "ms", 200.0), ("10 %", "%", 10.0), ("3", "Hz", 3.0),
        ("-1.5e2", "s", -150.0), ("1.5 kHz", "Hz", 1500.0), (" 4 bar ", "psi", 58.0150950921), (".5", "", 0.5),
    ],
)  # fmt: skip
def test_number_is_brought_to_the_declared_unit(text, unit, value):
    assert number_in(text, unit, "setting x") == pytest.approx(value, rel=1e-11)


@pytest.mark.parametrize(
    ("text", "unit", "said"),
    [
        ("4 kg", "s", "setting x: '4 kg': a number in s was expected"),
        ("soon", "s", "'soon' is not a number in s"),
        ("4 parsnips", "s", "a number in s was expected"),
        ("0,2s", "s", "numbers are typed with a point"),
        ("4 l/min", "", "its unit is that of the bench; give the number alone"),
    ],
)
def test_wrong_unit_is_said(text, unit, said):
    with pytest.raises(SettingError, match=said):
        number_in(text, unit, "setting x")


def test_sequence_may_have_a_unit_on_each_number():
    setting = Setting("frequencies", tuple[Annotated[float, Unit("Hz")], ...], (), "of the sines")
    assert setting.unit == "Hz"
    assert setting.parsed("500 mHz, 1, 0.002kHz") == (0.5, 1.0, 2.0)
    assert setting.echoed((0.5, 1.0)) == "frequencies = 0.5,1 Hz"


def test_text_and_words_are_left_alone():
    assert Setting("poles", int | None, 3, "of the function").parsed("none") is None
    assert Setting("rate_hz", float | None, None, "").parsed("none") is None
    assert Setting("rate_hz", float | None, None, "").parsed("2 kHz") == 2000.0


def test_limit_takes_the_unit_of_what_it_limits():
    measured = [Measurement("rise", "ms", "time"), Measurement("gain", "", "ratio")]
    given = split_limits(["rise=100..0.2s", "gain=0.8.."])
    assert checked_limits(measured, given) == {"rise": Limit(100.0, 200.0), "gain": Limit(0.8, None)}
    with pytest.raises(SettingError, match="limit rise: '3 bar'"):
        checked_limits(measured, split_limits(["rise=..3 bar"]))
    with pytest.raises(SettingError, match="200 is above 100"):
        checked_limits(measured, split_limits(["rise=0.2s..100"]))


def test_our_settings_with_decimals_state_their_unit():
    known_by_the_bench = {"full_command", "top_current", "value"}
    for entry in entries("procedures"):
        for setting in load_procedure(entry.name).settings.values():
            if setting.type in (float, float | None) and setting.name not in known_by_the_bench:
                assert setting.unit, f"{entry.name}: {setting.name}: {setting.meaning}"


def test_a_choice_of_words_has_no_unit():
    settings = load_procedure("step_response").settings
    assert settings["sequence"].described().startswith("sequence: paper | small")
    assert settings["levels"].described().startswith("levels [%]: float, … | none = none")
