"""Rooms of identification: a stranger's package finds modules under the names of before, and they are the same."""

import subprocess
import sys

import pytest

_OLD = """
import hil.identification.step_response as old
from hil.identification.grey_box import fit_plant
from hil.identification.plausibility.look import implausible
from hil.identification import noise
import hil.identification.step.step_response as new
import hil.identification.uncertainty.noise as room
assert old is new and noise is room and new.__spec__.name == "hil.identification.step.step_response"
assert new.__name__ == "hil.identification.step.step_response"
"""


def test_modules_are_found_under_their_names_of_before():
    subprocess.run([sys.executable, "-c", _OLD], check=True)


def test_what_never_stood_there_is_not_found():
    with pytest.raises(ModuleNotFoundError, match=r"hil\.identification\.nothing"):
        __import__("hil.identification.nothing")
