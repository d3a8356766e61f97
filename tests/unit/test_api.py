"""The public interface for Python: complete, lazy, and the same as the command line."""

import importlib
import inspect
import pkgutil
import subprocess
import sys

import numpy as np
import pytest

import hil
from hil import api
from hil.errors import InputError
from hil.record.recording import Channel, Recording

pytestmark = pytest.mark.xdist_group("api")  # on one worker: its run is made once


def test_every_public_name_is_there_after_every_module_was_imported():
    for found in pkgutil.walk_packages(hil.__path__, "hil."):
        if not found.name.startswith(("hil.__main__", "hil.archive.migrations", "hil.session.pytest_plugin")):
            importlib.import_module(found.name)
    for name in hil.__all__:
        assert getattr(hil, name) is getattr(api, name), name
        assert not inspect.ismodule(getattr(hil, name)), name
    assert 10 <= len(hil.__all__) <= 28
    assert set(hil.__all__) <= set(dir(hil))


def test_name_that_is_not_public_is_refused_with_those_that_are():
    with pytest.raises(AttributeError, match="public are: Model"):
        hil.nothing_of_that_name  # noqa: B018


def test_importing_hil_imports_nothing_else():
    code = "import hil, sys; print([m for m in ('numpy', 'scipy', 'pydantic', 'hil.api') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.fixture(scope="module")
def response(tmp_path_factory):
    folder = tmp_path_factory.mktemp("api") / "run"
    return hil.run("step_response", "brevini-hpv41", folder, levels=(0, 80), limits=["change=10.."])


def test_run_returns_what_the_folder_holds(response):
    assert response.findings.verdict == "pass"
    found = hil.results(response.folder)
    assert found.verdict == "pass"
    frame = found.to_pandas()
    assert frame.loc[found.values[0].name, "value"] == found.values[0].value
    assert found.curves[0].to_pandas().shape == (len(found.curves[0].rows), len(found.curves[0].columns))
    assert "<table>" in found._repr_html_()
    assert found.plot().axes


def test_ten_lines_from_a_recording_to_a_picture(response):
    recording = hil.read(response.folder)
    model = hil.typical_model("brevini-hpv41")
    (comparison,) = hil.compare(model, [recording])
    simulated = hil.simulate(model, recording)
    assert comparison.fit > 95.0
    assert len(simulated) == len(recording)
    assert simulated.plot("flow").axes[0].get_ylabel() == "l/min"


def test_recording_hands_over_to_pandas_and_xarray(response):
    xarray = pytest.importorskip("xarray")
    recording = hil.read(response.folder)
    frame = recording.to_pandas()
    np.testing.assert_array_equal(frame["flow [l/min]"], recording.values("flow"))
    dataset = recording.to_xarray()
    assert isinstance(dataset, xarray.Dataset)
    assert dataset["flow"].attrs["units"] == "l/min"


def test_a_frequency_response_shows_itself_and_is_handed_over():
    pytest.importorskip("xarray")
    table, other = hil.read("hpv41-plus-5"), hil.read("hpv41-minus-5")
    figure = table.plot(other)
    assert [line.get_label() for line in figure.axes[0].lines] == ["hpv41-plus-5.csv", "hpv41-minus-5.csv"]
    frame, dataset = table.to_pandas(), table.to_xarray()
    np.testing.assert_allclose(frame["gain [1]"], np.abs(table.response))
    np.testing.assert_allclose(dataset["phase"], frame["phase [deg]"])
    assert dataset["phase"].attrs["units"] == "deg"
    assert table._repr_html_().count("<tr>") == len(table) + 1


def test_curves_and_models_are_handed_over(response):
    pytest.importorskip("xarray")
    curve = hil.results(response.folder).curves[0]
    dataset = curve.to_xarray()
    column = curve.columns[1]
    assert dataset[column.name].attrs["units"] == column.unit
    np.testing.assert_array_equal(dataset[column.name].values.astype(float), np.array(curve.column(column.name), float))
    model = hil.typical_model("brevini-hpv41")
    assert model.to_pandas().loc["full_flow", "value"] == model.values["full_flow"]


def test_html_of_a_recording_escapes_what_a_file_says():
    channels = {"<b>": Channel("<b>", "V", np.arange(3.0), "<script>")}
    html = Recording("<i>", np.arange(3.0), channels)._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html


def test_package_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    found = Recording("x", np.arange(3.0), {"u": Channel("u", "V", np.arange(3.0))})
    with pytest.raises(InputError, match=r"to_xarray needs the package 'xarray'.*pip install 'valve-hil\[notebook\]'"):
        found.to_xarray()


def test_bench_is_driven_by_hand_and_recorded(tmp_path):
    with hil.open_bench("brevini-hpv41", tmp_path / "run") as rig:
        answer = rig.play(np.full(200, 0.0))
    assert len(answer) == 200
    assert len(hil.read(tmp_path / "run")) >= 200


def test_every_function_says_what_it_does():
    for name in api.__all__:
        assert inspect.getdoc(getattr(api, name)), name


def test_one_recording_or_name_by_itself_is_meant_as_just_that_one(response, tmp_path):
    path = tmp_path / "one.csv"
    hil.write(hil.read(response.folder), path)
    (alone,) = hil.compare(hil.typical_model("brevini-hpv41"), str(path), inputs="command", output="flow")
    (listed,) = hil.compare(hil.typical_model("brevini-hpv41"), [path], inputs=["command"], output="flow")
    assert alone.as_dict() == listed.as_dict()
    with pytest.raises(InputError, match="limit 'nothing': not measured here"):
        hil.run("step_response", "brevini-hpv41", tmp_path / "run", limits="nothing=1..2")


@pytest.mark.parametrize(
    "asked",
    [
        lambda: hil.identify([], "brevini-hpv41"), lambda: hil.compare("hpv41-mean", []),
        lambda: hil.diagnose("hpv41-mean", []), lambda: hil.average([]), lambda: hil.flow_curve([]),
        lambda: hil.frequency_response([]), lambda: hil.issue_passport([], "x.pdf"),
    ],
)  # fmt: skip
def test_nothing_can_be_made_of_no_recording(asked):
    with pytest.raises(InputError, match="none is given; at least one"):
        asked()


@pytest.mark.parametrize("interval_s", [-1.0, float("nan"), float("inf")])
def test_an_interval_that_is_none_is_refused_before_the_file_is_read(interval_s):
    with pytest.raises(InputError, match=rf"interval_s={interval_s}\): seconds"):
        hil.read("nowhere.csv", interval_s=interval_s)
