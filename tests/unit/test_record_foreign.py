"""Files as other programs write them."""

from __future__ import annotations

import sys
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from hil.errors import FileError, UnitError
from hil.record.read import formats, read_recording, write_recording
from hil.record.reading import Reading
from hil.record.recording import Channel, Recording, recording

TIME = np.array([0.0, 0.1, 0.25, 0.3, 0.4])
RAMP = np.arange(5.0)


def write_mdf(path: Path, *groups: list) -> Path:
    from asammdf import MDF

    with MDF(version="4.10") as file:
        for group in groups:
            file.append(group, common_timebase=True)
        file.save(path)
    return path


def signal(name: str, values: np.ndarray, time_s: np.ndarray, unit: str = "", **more: object):
    from asammdf import Signal

    return Signal(samples=values, timestamps=time_s, name=name, unit=unit, **more)


def write_tdms(path: Path, *channels: tuple[str, str, np.ndarray, dict]) -> Path:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject(*channel) for channel in channels])
    return path


def write_mat(path: Path, **variables: object) -> Path:
    from scipy.io import savemat

    savemat(path, variables, oned_as="column")
    return path


def write_hdf5(path: Path, fill) -> Path:
    import h5py

    with h5py.File(path, "w", track_order=True) as file:
        fill(file)
    return path


def write_parquet(path: Path, **columns: object) -> Path:
    import pyarrow as pa
    from pyarrow import parquet

    parquet.write_table(pa.table(columns), path)
    return path


class TestMdf4:
    def test_groups_of_different_rates_are_joined_on_the_fastest(self, tmp_path):
        fast, slow = np.arange(100) / 100.0, np.arange(8) / 10.0 + 0.05
        found = read_recording(write_mdf(
            tmp_path / "bench.mf4",
            [signal("flow", np.sin(fast), fast, "l/min"), signal("command", fast, fast, "%")],
            [signal("oil", 40.0 + slow, slow, "°C")],
            [signal("state", np.arange(8), slow)],
        ))  # fmt: skip
        assert found.time_s[0] == pytest.approx(0.05)
        assert found.time_s[-1] == pytest.approx(0.84)  # the last slow sample holds for an interval
        assert np.array_equal(found.values("flow"), np.sin(found.time_s))  # the fastest is as it was
        assert set(found.values("oil")) <= set(40.0 + slow)  # nothing is invented between samples
        assert found.values("state")[found.time_s < 0.149].tolist() == [0.0] * 10
        assert found.channels["oil"].unit == "°C"
        assert np.array_equal(found.own["oil"].time_s, slow)
        assert np.array_equal(found.samples("oil", "K").values, 40.0 + slow + 273.15)
        assert any("oil: 8 samples every 0.1 s" in sentence for sentence in found.meta["assumed"])
        assert found.meta["units_missing"] == ["state"]

    def test_equal_names_in_two_groups_stay_apart(self, tmp_path):
        path = write_mdf(tmp_path / "x.mf4", [signal("p", RAMP, TIME, "bar")], [signal("p", -RAMP, TIME, "bar")])
        found = read_recording(path)
        assert [values.values[1] for values in found.channels.values()] == [1.0, -1.0]
        assert next(iter(found.channels)) == "p"
        assert found.meta["assumed"] == ["another channel is called 'p'; this one is 'p (group 1)'"]
        assert not found.own  # one time base

    def test_text_is_left_out(self, tmp_path):
        text = np.array([b"a", b"b", b"c", b"d", b"e"])
        path = write_mdf(
            tmp_path / "x.mf4", [signal("p", RAMP, TIME, "bar")], [signal("remark", text, TIME, encoding="utf-8")]
        )
        assert list(read_recording(path).channels) == ["p"]

    def test_bases_without_common_time_are_refused(self, tmp_path):
        path = write_mdf(tmp_path / "x.mf4", [signal("p", RAMP, TIME, "bar")], [signal("q", RAMP, TIME + 9, "bar")])
        with pytest.raises(FileError, match=r"x.mf4: its time bases have no time in common"):
            read_recording(path)


class TestTdms:
    def test_units_may_stand_where_daq_assistants_put_them(self, tmp_path):
        path = write_tdms(tmp_path / "x.tdms", ("g", "Time", TIME, {}), ("g", "p", RAMP, {"NI_UnitDescription": "bar"}))
        found = read_recording(path)
        assert np.array_equal(found.time_s, TIME)
        assert found.channels["p"].unit == "bar"
        (said,) = found.meta["assumed"]
        assert said.startswith("no unit is stated for 'Time'; taken as seconds, --unit 'Time=ms'")

    def test_dates_are_counted_in_seconds(self, tmp_path):
        stamps = np.datetime64("2026-01-31T12:00:00") + (TIME * 1e6).astype("m8[us]")
        path = write_tdms(tmp_path / "x.tdms", ("g", "stamp", stamps, {}), ("g", "p", RAMP, {"unit_string": "bar"}))
        found = read_recording(path)
        assert found.time_s == pytest.approx(TIME)
        assert "counts from 2026-01-31T12:00" in found.meta["assumed"][0]

    def test_channels_a_block_apart_are_cut(self, tmp_path):
        path = write_tdms(tmp_path / "x.tdms", ("g", "time", TIME, {"unit_string": "s"}), ("g", "p", RAMP[:4], {}))
        found = read_recording(path)
        assert found.values("p").tolist() == [0, 1, 2, 3]
        assert "have 4 to 5 samples; cut to the shortest" in found.meta["assumed"][0]

    def test_without_a_time_it_says_what_there_is(self, tmp_path):
        path = write_tdms(tmp_path / "x.tdms", ("g", "ai0", RAMP, {}))
        with pytest.raises(
            FileError, match=r"x.tdms: no signal with a time was found, but 'ai0'; .* --time NAME.* --interval S"
        ):
            read_recording(path)


class TestMatlab:
    def test_plain_vectors(self, tmp_path):
        found = read_recording(write_mat(tmp_path / "x.mat", t=TIME, u=RAMP, y=-RAMP))
        assert np.array_equal(found.time_s, TIME)
        assert np.array_equal(found.values("y"), -RAMP)
        assert found.meta["units_missing"] == ["u", "y"]
        with pytest.raises(UnitError, match=r"no unit is stated for channel 'u', .* --unit 'u=l/min'"):
            found.values("u", "l/min")

    @pytest.mark.parametrize(("name", "value"), [("Ts", 0.01), ("fs", 100.0), ("dt", 0.01)])
    def test_an_interval_instead_of_a_time(self, tmp_path, name, value):
        found = read_recording(write_mat(tmp_path / "x.mat", **{name: value}, u=RAMP, y=RAMP))
        assert found.time_s == pytest.approx(0.01 * np.arange(5))
        assert found.meta["assumed"] == [f"even time base from {name} = {value:g}"]

    def test_a_struct(self, tmp_path):
        found = read_recording(write_mat(tmp_path / "x.mat", run={"time": TIME, "flow": RAMP}, operator="me"))
        assert list(found.channels) == ["flow"]

    def test_signals_that_state_their_names_and_units(self, tmp_path):
        kinds = [("Name", object), ("Data", object), ("Unit", object)]
        signals = np.array([("cmd", RAMP, "%"), ("flow", 2 * RAMP, "l/min")], dtype=kinds)
        clock = np.array([("HostService", TIME, "s")], dtype=kinds)
        found = read_recording(
            write_mat(tmp_path / "x.mat", rec001={"X": clock, "Y": signals, "Description": "dSPACE"})
        )
        assert [(c.name, c.unit) for c in found.channels.values()] == [("cmd", "%"), ("flow", "l/min")]
        assert np.array_equal(found.time_s, TIME)

    def test_structures_whose_signals_are_called_data(self, tmp_path):
        command, flow = ({"data": k * RAMP, "unit": unit} for k, unit in ((1, "%"), (2, "l/min")))
        found = read_recording(write_mat(tmp_path / "x.mat", t=TIME, command=command, flow=flow))
        assert [(c.name, c.unit) for c in found.channels.values()] == [("command", "%"), ("flow", "l/min")]

    def test_a_matrix_becomes_numbered_channels(self, tmp_path):
        found = read_recording(write_mat(tmp_path / "x.mat", t=TIME, y=np.column_stack([RAMP, -RAMP])))
        assert found.values("y 2").tolist() == (-RAMP).tolist()

    def test_version_73_is_hdf5_inside(self, tmp_path):
        def fill(file) -> None:
            file["t"], file["y"] = TIME[None, :], RAMP[None, :]
            file["remark"] = np.frombuffer(b"hello", np.uint8).astype(np.uint16)
            file["remark"].attrs["MATLAB_class"] = np.bytes_("char")

        path = tmp_path / "x.mat"
        header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
        body = write_hdf5(tmp_path / "body.h5", lambda file: None).read_bytes()
        assert body[:4] == b"\x89HDF"
        import h5py

        with h5py.File(path, "w", userblock_size=512) as file:
            fill(file)
        with path.open("r+b") as raw:
            raw.write(header)
        found = read_recording(path)
        assert list(found.channels) == ["y"]
        assert np.array_equal(found.values("y"), RAMP)

    def test_what_matlab_could_not_read_is_not_written(self, tmp_path):
        long = np.broadcast_to(0.0, 300_000_000)  # takes no memory
        with pytest.raises(FileError, match=r"x.mat: 300000000 samples; MATLAB 5 holds 2 GB per channel at most"):
            write_recording(Recording("long", long, {"y": Channel("y", "V", long)}), tmp_path / "x.mat")
        assert list(tmp_path.iterdir()) == []

    def test_a_variable_of_a_name_of_ours(self, tmp_path):
        found = read_recording(write_mat(tmp_path / "x.mat", t=TIME, channels=RAMP))
        assert np.array_equal(found.values("channels"), RAMP)


class TestHdf5:
    def test_units_in_headings_or_attributes(self, tmp_path):
        def fill(file) -> None:
            file["time [ms]"] = TIME * 1000
            file["flow (l/min)"] = RAMP
            file["valve (left)"] = RAMP
            file["p"] = RAMP
            file["p"].attrs["units"] = "bar"

        found = read_recording(write_hdf5(tmp_path / "x.h5", fill))
        assert found.time_s == pytest.approx(TIME)
        assert [channel.heading for channel in found.channels.values()] == [
            "flow [l/min]",
            "valve (left) [1]",
            "p [bar]",
        ]
        assert found.meta["units_missing"] == ["valve (left)"]

    def test_signals_in_a_group_beside_the_time(self, tmp_path):
        def fill(file) -> None:
            file["time"] = TIME
            file["time"].attrs["unit"] = "s"
            file["inputs/flow [l/min]"] = RAMP

        assert np.array_equal(read_recording(write_hdf5(tmp_path / "x.h5", fill)).time_s, TIME)

    def test_a_compound_table(self, tmp_path):
        table = np.zeros(5, dtype=[("time [s]", "f8"), ("flow [l/min]", "f4"), ("name", "S3")])
        table["time [s]"] = TIME

        def fill(file) -> None:
            file["table"] = table

        found = read_recording(write_hdf5(tmp_path / "x.h5", fill))
        assert list(found.channels) == ["flow"]
        assert found.meta["assumed"] == ["left out, not one number per sample: name"]

    @pytest.mark.parametrize("ending", [".nc", ".mat"])
    def test_packed_values_and_times_of_netcdf_under_any_ending(self, ending, tmp_path):
        def fill(file) -> None:
            file["time"] = 1000.0 * TIME
            file["time"].attrs["units"] = "milliseconds since 2026-11-28 10:11:12"
            file["flow"] = np.array([0, 10, -99, 30, 40], dtype=np.int16)
            file["flow"].attrs.update({"scale_factor": [0.5], "add_offset": [2.0], "_FillValue": [-99], "units": "bar"})
            file["command"] = RAMP

        path = write_hdf5(tmp_path / f"x{ending}", fill)
        found = read_recording(path, Reading(gaps=True))
        assert found.samples("flow").values.tolist() == [2.0, 7.0, 17.0, 22.0]
        assert found.time_s == pytest.approx(TIME)

    @pytest.mark.parametrize("name", ["sample_rate", "Sample Rate (Hz)"])
    def test_a_rate_as_attribute(self, name, tmp_path):
        def fill(file) -> None:
            file["y"] = RAMP
            file.attrs[name] = 50.0

        assert read_recording(write_hdf5(tmp_path / "x.h5", fill)).time_s == pytest.approx(0.02 * np.arange(5))


class TestParquet:
    def test_headings(self, tmp_path):
        path = write_parquet(
            tmp_path / "x.parquet", **{"time [s]": TIME, "flow [l/min]": RAMP, "remark": list("abcde")}
        )
        found = read_recording(path)
        assert found.channels["flow"].unit == "l/min"
        assert found.meta["assumed"] == ["left out, not one number per sample: remark"]

    def test_decimals_of_a_database_are_numbers(self, tmp_path):
        exact = [None, *(Decimal(f"{value:.1f}") for value in RAMP[1:])]
        path = write_parquet(tmp_path / "x.parquet", **{"time [s]": TIME, "flow [l/min]": exact, "u [V]": RAMP})
        found = read_recording(path, Reading(gaps=True)).samples("flow")
        assert (found.time_s.tolist(), found.values.tolist()) == (TIME[1:].tolist(), RAMP[1:].tolist())

    def test_a_table_of_pandas_with_dates(self, tmp_path):
        import pandas as pd

        index = pd.to_datetime("2026-01-31") + pd.to_timedelta(TIME, unit="s")
        pd.DataFrame({"flow [l/min]": RAMP}, index=index).to_parquet(tmp_path / "x.parquet")
        assert read_recording(tmp_path / "x.parquet").time_s == pytest.approx(TIME)

    def test_a_missing_value_is_a_sample_that_was_not_taken_if_its_user_says_so(self, tmp_path):
        path = write_parquet(tmp_path / "x.parquet", **{"time [s]": TIME, "flow [l/min]": [1.0, None, 3.0, 4.0, 5.0],
                                                        "u [V]": RAMP})  # fmt: skip
        with pytest.raises(
            FileError, match=r"x.parquet: sample 1, channel 'flow': no value \(1 such of 5\); with --gaps"
        ):
            read_recording(path)
        found = read_recording(path, Reading(gaps=True))
        assert found.samples("flow").time_s.tolist() == [0.0, 0.25, 0.3, 0.4]
        assert found.values("flow").tolist() == [1.0, 1.0, 3.0, 4.0, 5.0]  # held
        assert found.meta["assumed"][0] == "'flow' has no value in 1 of 5 rows, the first at sample 1"

    def test_a_time_in_another_quantity_is_refused(self, tmp_path):
        path = write_parquet(tmp_path / "x.parquet", **{"time [kg]": TIME, "flow [l/min]": RAMP})
        with pytest.raises(FileError, match=r"x.parquet: time column 'time \[kg\]': unit 'kg' cannot be read as 's'"):
            read_recording(path)


TEXT = [ending for ending, form in formats().items() if form is formats()[".csv"] or hasattr(form, "OR_TEXT")]
BINARY = sorted(ending for ending in formats() if ending not in TEXT)


@pytest.mark.parametrize("ending", sorted(formats()))
def test_an_empty_file_is_named(tmp_path, ending):
    (tmp_path / f"x{ending}").touch()
    with pytest.raises(FileError, match=rf"x{ending}: the file is empty"):
        read_recording(tmp_path / f"x{ending}")


@pytest.mark.parametrize("written", [".mat", ".tdms", ".h5", ".mf4", ".parquet", ".mcap"])
@pytest.mark.parametrize("called", [".csv", ".bin"])
def test_a_binary_file_is_known_by_its_first_bytes(tmp_path, written, called):
    write_recording(recording("made", TIME, {"flow [l/min]": RAMP}), tmp_path / f"x{written}")
    (tmp_path / f"x{written}").rename(tmp_path / f"x{called}")
    assert read_recording(tmp_path / f"x{called}").values("flow").tolist() == RAMP.tolist()


@pytest.mark.parametrize("ending", BINARY)
def test_garbage_is_named(tmp_path, ending):
    path = tmp_path / f"x{ending}"
    path.write_bytes(b"not what the name says" * 100)
    with pytest.raises(FileError, match=rf"x{ending}: cannot be read as"):
        read_recording(path)


@pytest.mark.parametrize("ending", [ending for ending in BINARY if hasattr(formats()[ending], "write")])
def test_a_truncated_file_is_named(tmp_path, ending):
    path = tmp_path / f"x{ending}"
    write_recording(recording("made", np.arange(5000.0), {"flow [l/min]": np.arange(5000.0)}), path)
    content = path.read_bytes()
    for share in (0.002, 0.05, 0.3):
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(FileError, match=rf"x{ending}: "):
            read_recording(path)


@pytest.mark.parametrize(
    ("ending", "package"), [(".h5", "h5py"), (".mf4", "asammdf"), (".tdms", "nptdms"), (".pq", "pyarrow")]
)
def test_a_missing_library_is_named(tmp_path, ending, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)  # what python does for a package that is not there
    made = recording("made", TIME, {"flow [l/min]": RAMP})
    with pytest.raises(
        FileError, match=rf"'{ending}' files need the package '{package}'.*pip install 'valve-hil\[formats\]'"
    ):
        write_recording(made, tmp_path / f"x{ending}")


def test_a_folder_that_is_no_run_is_named(tmp_path):
    with pytest.raises(FileError, match=r"run.json: cannot be read: No such file or directory; a run folder needs it"):
        read_recording(tmp_path)


def test_rates_of_groups_and_of_channels_are_used(tmp_path):
    nptdms, h5py = pytest.importorskip("nptdms"), pytest.importorskip("h5py")
    with nptdms.TdmsWriter(tmp_path / "x.tdms") as file:
        channels = [nptdms.ChannelObject("g", "flow", RAMP, {}), nptdms.ChannelObject("g", "u", RAMP, {})]
        file.write_segment([nptdms.GroupObject("g", {"SampleRate": 200.0}), *channels])
    assert read_recording(tmp_path / "x.tdms").time_s == pytest.approx(0.005 * np.arange(5))
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file.create_dataset("command", data=np.arange(3.0)).attrs["dt"] = 0.02
        flow = file.create_dataset("flow", data=np.arange(8.0))
        flow.attrs["sample_rate"], flow.attrs["t0"] = 200.0, 0.01
    found = read_recording(tmp_path / "x.h5")
    assert found.samples("flow").time_s == pytest.approx(0.01 + 0.005 * np.arange(8))
    assert found.samples("command").time_s == pytest.approx(0.02 * np.arange(3))


def test_a_named_time_of_words_is_refused_with_its_first_word(tmp_path):
    path = write_parquet(tmp_path / "x.parquet", **{"Date": list("abcde"), "flow [l/min]": RAMP})
    with pytest.raises(FileError, match=r"'Date' is called a time, but 'a' is no number, date or clock .* --interval"):
        read_recording(path, Reading(time="Date"))


def test_samples_without_a_time_of_as_many_are_left_out_and_said(tmp_path):
    found = read_recording(write_mat(tmp_path / "x.mat", time=TIME, command=RAMP, flow=RAMP[:-1]))
    assert list(found.channels) == ["command"]
    assert "left out, 4 samples and no time of as many: flow" in found.meta["assumed"]


def test_numbers_and_stamps_that_are_texts_are_read(tmp_path):
    stamps = [f"2026-01-01T10:00:00.{k}00" for k in range(5)]
    path = write_parquet(tmp_path / "x.parquet", **{"time": stamps, "flow [l/min]": ["1,5", "2", "-3", "4", "5e1"]})
    found = read_recording(path)
    assert found.time_s == pytest.approx(0.1 * np.arange(5))
    assert found.values("flow").tolist() == [1.5, 2.0, -3.0, 4.0, 50.0]


def test_samples_that_cannot_be_scaled_name_the_file(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    scaled = {"NI_Number_Of_Scales": 2, "NI_Scaling_Status": "unscaled", "NI_Scale[1]_Scale_Type": "Linear",
              "NI_Scale[1]_Linear_Slope": 0.1, "NI_Scale[1]_Linear_Y_Intercept": 0.0,
              "NI_Scale[1]_Linear_Input_Source": 0, "wf_increment": 0.1}  # fmt: skip
    with nptdms.TdmsWriter(tmp_path / "x.tdms") as file:
        file.write_segment([nptdms.ChannelObject("g", "flow", np.arange(5, dtype=np.int16), scaled)])
    with pytest.raises(FileError, match=r"x.tdms: cannot be read as TDMS"):
        read_recording(tmp_path / "x.tdms")
