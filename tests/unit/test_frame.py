"""Recordings from memory, and errors of the Python interface in its own words."""

from __future__ import annotations

import re
from dataclasses import replace
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import hil
from hil import api
from hil.errors import HilError, option, options_of
from hil.record.recording import Recording

TIME = np.arange(400) * 0.01
COMMAND = 60.0 * np.sign(np.sin(2.0 * np.pi * 0.4 * TIME))
UNITS = {"time [s]": TIME, "command [%]": COMMAND}
MEASURED = {**UNITS, "flow [l/min]": np.zeros(400)}


def measured() -> dict[str, Any]:
    flow = hil.simulate(hil.typical_model("brevini-hpv41"), MEASURED).values("flow")
    return {**UNITS, "flow [l/min]": flow + np.random.default_rng(1).normal(0.0, 0.3, 400)}


def test_identify_takes_arrays_a_frame_and_its_index_alike():
    given = measured()
    frame = pd.DataFrame(given)
    kinds = [given, frame, frame.set_index("time [s]"), [frame], hil.read(frame)]
    found = [hil.identify(one, "brevini-hpv41").model for one in kinds]
    assert {one.values["full_flow"] for one in found} == {found[0].values["full_flow"]}
    true = hil.typical_model("brevini-hpv41").values["full_flow"]
    assert found[0].values["full_flow"] == pytest.approx(true, rel=0.02)


def test_read_takes_numbers_that_are_objects_and_tables_of_others():
    frame = pd.DataFrame(MEASURED)
    objects = frame.astype(object)
    objects["flow [l/min]"] = [Decimal(0), None, *[0.0] * 398]
    for one in (objects.dropna(), {name: frame[name].astype(object) for name in frame}, pa.Table.from_pandas(frame)):
        read = hil.read(one)
        assert isinstance(read, Recording) and set(read.channels) == {"command", "flow"}


@pytest.mark.parametrize(
    ("given", "kind"),
    [(np.zeros((3, 400)), "ndarray"), ((TIME, COMMAND), "ndarray"), (5, "int"), (None, "NoneType"),
     (pd.Series(COMMAND), "float")],
    ids=["matrix", "tuple", "number", "nothing", "series"],
)  # fmt: skip
def test_identify_says_how_arrays_are_given(given, kind):
    with pytest.raises(HilError, match=rf"^a {kind}: a recording is a path, a DataFrame, or arrays by name and unit: "):
        hil.identify(given, "brevini-hpv41")


def test_read_takes_what_a_frame_does_not_say():
    frame = pd.DataFrame({"ch1": COMMAND, "flow": np.arange(400.0)})
    units = {"command": "%", "flow": "l/min"}
    read = hil.read(frame, interval_s=0.01, renamed={"ch1": "command"}, units=units)
    assert isinstance(read, Recording)
    assert read.channels["flow"].heading == "flow [l/min]"
    np.testing.assert_allclose(read.time_s, TIME)
    dated = frame.set_index(pd.date_range("2026-11-26", periods=400, freq="10ms"))
    np.testing.assert_allclose(hil.read(dated).time_s, TIME, atol=1e-9)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"command [%]": COMMAND, "flow [l/min]": COMMAND}, r"the arrays: .*hil\.read\(…, time=NAME\).*interval_s=S"),
        ({**UNITS, "flow": COMMAND}, r"no unit is stated for channel 'flow'.*hil\.read\(…, units=\{'flow': 'l/min'\}"),
        (UNITS, r"no channel 'flow', the output of brevini-hpv41; it has: command \[%\]; name its .* output=NAME$"),
        ({**UNITS, "flow [l/min]": COMMAND[:-1]}, r"2 different lengths: .*'flow \[l/min\]' 399"),
        ({**UNITS, "flow [l/min]": np.zeros((400, 2))}, r"'flow \[l/min\]' is 400×2; a channel is an array"),
    ],
    ids=["no time", "no unit", "no output", "lengths", "matrix"],
)  # fmt: skip
def test_identify_says_what_is_missing_in_words_of_python(given, said):
    for one in (given, pd.DataFrame(given)) if said.startswith(("no ", "the")) else (given,):
        with pytest.raises(HilError) as raised:
            hil.identify(one, "brevini-hpv41")
        assert re.search(said.replace("the arrays", "the (arrays|DataFrame)"), str(raised.value)), raised.value
        assert "--" not in str(raised.value)


def test_notes_and_warnings_name_arguments_too(tmp_path):
    notes: list[str] = []
    model = hil.typical_model("brevini-hpv41")
    given = {name.replace(" [s]", ""): values for name, values in measured().items()}
    given["flow [l/min]"] = np.roll(given["flow [l/min]"][::-1], 50)  # nothing explains that at once
    found = hil.diagnose(model, given, budget_s=1e-6, out=tmp_path / "d", notes=notes.append)
    assert any("units={'time': 'ms'}" in note for note in notes)
    assert any("a larger budget may find more" in text for text in found.diagnosis.warnings)
    assert "--" not in "".join((*notes, *found.diagnosis.warnings))


def test_a_bench_that_is_driven_by_hand_names_arguments_in_its_errors(tmp_path):
    bench = tmp_path / "bench.toml"
    bench.write_text('based_on = "brevini-hpv41"\n[valve]\nserial = "ask"\n', encoding="utf-8")
    with pytest.raises(HilError, match="say which unit this is with serial=SN"):
        hil.run("step_response", bench, tmp_path / "run")
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "file").touch()
    with pytest.raises(HilError, match="name another folder with out, or remove it"):
        api.demo(tmp_path / "demo")


def test_an_option_is_called_as_at_the_outermost_door():
    assert option("gaps") == "--gaps" and option("unit", "flow rate=l/min") == "--unit 'flow rate=l/min'"
    assert option("time", "my clock") == "--time 'my clock'" and option("input", "NAME") == "--input NAME"
    with options_of("python"):
        assert option("gaps") == "hil.read(…, gaps=True)" and option("columns", "A,B") == "hil.read(…, columns=A,B)"
        assert option("rename", "time=frequency") == "hil.read(…, renamed={'time': 'frequency'})"
        assert (option("bench-budget"), option("input", "NAME")) == ("bench_budget_s", "inputs=NAME")
    with options_of("prompt"), options_of("python"):
        assert option("gaps") == "--gaps"


def test_the_command_line_keeps_its_options(tmp_path, refused):
    path = str(tmp_path / "one.csv")
    pd.DataFrame({**UNITS, "flow": COMMAND}).to_csv(path, index=False)
    said = refused("identify", path, "--plant", "brevini-hpv41", "--out", tmp_path / "m")
    assert "--unit 'flow=l/min'" in said
    with pytest.raises(HilError, match=r"units=\{'flow': 'l/min'\}"):
        hil.identify(path, "brevini-hpv41")


def test_a_fit_is_never_above_what_noise_allows_and_no_lag_is_minus_nothing():
    (found,) = hil.compare(hil.typical_model("brevini-hpv41"), measured())
    assert found.fit is not None and found.ceiling is not None and found.fit <= found.ceiling
    assert "-0.0 ms" not in replace(found, lag_s=-2e-6).as_text()
