"""Units at the doors, and the tree of errors with its exit statuses."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys

import numpy as np
import pint
import pytest

from hil import errors
from hil.errors import HardwareError, HilError, InputError, SettingError, UnitError, UnknownNameError
from hil.session.quantity import number_in
from hil.units import check_unit, convert, scale_and_offset


@pytest.mark.parametrize(
    ("value", "unit", "to", "found"),
    [
        (50.0, "%", "1", 0.5),
        (1.0, "bar", "psi", 14.503773773),
        (3.0, "gpm", "l/min", 11.356235352),
        (1.0, "lpm", "m3/s", 1.0 / 60000.0),
        (3.0, "m3/h", "l/min", 50.0),
        (1.0, "N/mm2", "bar", 10.0),
        (1.0, "mmH2O", "Pa", 9.80665),
        (25.0, "°C", "degF", 77.0),
        (250.0, "mA", "A", 0.25),
        (1.0, "inch", "mm", 25.4),
        (3000.0, "rpm", "rad/s", 314.159265359),
        (3000.0, "1/min", "rpm", 3000.0),
        (3000.0, "rpm", "Hz", 50.0),
        (50.0, "1/s", "rpm", 3000.0),
        (60.0, "1/min", "Hz", 1.0),
        (6.0, "deg/s", "rpm", 1.0),
        (2.0, "psig", "psi", 2.0),
        (1.0, "US gal/min", "l/min", 3.785411784),
        (1.0, "cis", "l/min", 0.98322384),
        (7.0, "l/min", "l/min", 7.0),
    ],
)
def test_values_are_converted(value, unit, to, found):
    assert convert(np.array([value]), unit, to)[0] == pytest.approx(found, rel=1e-9)


@pytest.mark.parametrize(("unit", "to"), [("bar", "kPa"), ("°C", "degF"), ("%", "1"), ("mm", "inch")])
def test_there_and_back(unit, to):
    values = np.array([-3.0, 0.0, 1.0, 250.0])
    assert np.allclose(convert(convert(values, unit, to), to, unit), values, atol=1e-9)


def test_nothing_to_convert_is_the_same_array():
    values = np.array([1.0, 2.0])
    assert convert(values, "bar", "bar") is values
    assert convert(values, "1", "") is values


@pytest.mark.parametrize(("unit", "to"), [("kg", "l/min"), ("V", "A"), ("%", "bar")])
def test_what_measures_something_else_is_refused(unit, to):
    with pytest.raises(UnitError, match=f"unit '{unit}' cannot be read as '{to}': they measure different things"):
        scale_and_offset(unit, to)


@pytest.mark.parametrize("typed", ["10%%", "10 % %", "10 %*%"])
def test_a_percent_sign_typed_twice_is_no_share_of_a_share(typed):
    with pytest.raises(SettingError, match="a number in % was expected"):
        number_in(typed, "%", "limit thd")


@pytest.mark.parametrize("unit", ["blorp", "l/minn", "3 apples"])
def test_an_unknown_unit_comes_with_examples(unit):
    with pytest.raises(UnitError, match=f"unknown unit '{unit}'; examples: %, V, mA"):
        check_unit(unit)


def all_errors() -> list[type[HilError]]:
    return [found for _, found in inspect.getmembers(errors, inspect.isclass) if issubclass(found, HilError)]


def test_bad_input_is_2_and_broken_hardware_3():
    for found in all_errors():
        assert found.exit_status == (3 if issubclass(found, HardwareError) else 2)
        assert found is HilError or issubclass(found, InputError) != issubclass(found, HardwareError)


def test_the_tree_in_the_documentation_is_the_tree():
    shown = set(re.findall(r"── (\w+)", errors.__doc__ or ""))
    assert shown == {found.__name__ for found in all_errors()} - {"HilError"}


def test_an_unknown_name_lists_what_there_is():
    error = UnknownNameError("plant", "valve", ["b", "a"])
    assert str(error) == "no plant named 'valve'; known: a, b"
    assert str(UnknownNameError("plant", "valve", [])) == "no plant named 'valve'; known: none"
    assert "did you mean 'brevini'" in str(UnknownNameError("plant", "brevinni", ["brevini"]))


def test_half_a_file_in_the_cache_of_the_units_library_makes_no_unit_unknown(tmp_path):
    # Its files are written in place: whoever begins meanwhile, or after a power cut, finds half of one.
    pint.UnitRegistry(cache_folder=tmp_path / "pint")
    written = list((tmp_path / "pint").glob("*.pickle"))
    assert written
    for file in written:
        file.write_bytes(file.read_bytes()[:100])
    ask = [sys.executable, "-c", "from hil.units import check_unit; check_unit('degC')"]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    asked = subprocess.run(ask, env=environment, capture_output=True, text=True, check=False)
    assert asked.returncode == 0, asked.stderr


def test_a_message_lists_few_names_whole_and_of_many_says_how_many():
    assert errors.listed([]) == "none"
    assert errors.listed(["flow [l/min]", "command [%]"]) == "flow [l/min], command [%]"
    assert errors.listed([f"ch{k}" for k in range(400)], 2) == "ch0, ch1, … (400 in all)"
