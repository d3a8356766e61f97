"""A bench by hand from Python: what `hil jog`, `hil watch` and `hil calibrate` do, as functions."""

import pytest

from hil import api
from hil.errors import RangeError, SettingError, UnknownNameError

BENCH = "brevini-hpv41"


@pytest.mark.parametrize(
    ("channel", "value", "for_s", "error"),
    [("flow", 5.0, 1.0, SettingError), ("command", 500.0, 1.0, RangeError), ("command", 5.0, 0.0, SettingError)],
)
def test_what_cannot_be_driven_is_refused(tmp_path, channel, value, for_s, error):
    with pytest.raises(error):
        api.jog(BENCH, channel, value, tmp_path / "run", for_s=for_s)


def test_inputs_are_read_again_and_again():
    looks = list(api.watch(BENCH, ["flow"], every_s=0.1, seconds=0.3))
    assert [[reading.name for reading in look] for look in looks] == [["flow"]] * 3


def test_an_output_is_calibrated_into_a_run_folder_alone():
    with pytest.raises(SettingError, match="a run folder is needed"):
        api.calibrate(BENCH, "command", "a gauge", lambda: 1.0)
    with pytest.raises(UnknownNameError):
        api.calibrate(BENCH, "nothing", "a gauge", lambda: 1.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [({"every_s": 0.01}, "every 0.01 s: 0.05 … 60 s is allowed"), ({"seconds": -1.0}, "seconds -1: more than 0")],
)
def test_watch_names_what_was_handed_over_and_no_option_of_the_command(wrong, said):
    with pytest.raises(SettingError) as refused:
        next(api.watch(BENCH, ["flow"], **wrong))
    assert said in str(refused.value) and "--" not in str(refused.value)


@pytest.mark.parametrize(
    ("to", "how"), [("pdf", {}), ("c", {}), ("fmu", {"out": "m.fmu", "fmi": "4"}), ("json", {"part": "x"})]
)
def test_export_names_no_option_of_the_command(to, how):
    with pytest.raises(SettingError) as refused:
        api.export(api.typical_model("brevini-hpv41"), to, **how)
    assert "--" not in str(refused.value)
