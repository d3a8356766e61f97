"""The same recording in every format, heading style and sampling of its channels gives the same model, within noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from hil.identification.grey_box.identify import GreyBoxFit, fit_plant, starting_model
from hil.identification.preparation.experiment import experiment
from hil.physics.simulate import Drive, simulate
from hil.record.read import formats, read_recording, write_recording
from hil.record.reading import Reading
from hil.record.recording import Recording, Samples, recording

INTERVAL_S, COUNT = 0.01, 1500
TRUE = {"gain": 2.0, "lag_time": 0.3, "dead_time": 0.05}
TIME_S = INTERVAL_S * np.arange(COUNT)


@cache
def made() -> Recording:
    rng = np.random.default_rng(5)
    command = np.repeat(rng.integers(-4, 5, COUNT // 100), 100).astype(float)
    plant = starting_model("transfer-function").definition
    answer = simulate(plant, plant.typical | TRUE, Drive(command[None, :], 0.0, INTERVAL_S))[0]
    flow = np.round(answer + 0.05 * rng.standard_normal(COUNT), 4)
    return recording("made", TIME_S, {"command [%]": command, "flow [l/min]": flow})


_fits: dict[str, GreyBoxFit] = {}


def identified(read: Recording) -> GreyBoxFit:
    """The fit to a recording; of those that are equal bit for bit there is one."""
    samples = [(channel.heading, read.samples(name)) for name, channel in read.channels.items()]
    told = {name: value for name, value in read.meta.items() if name != "assumed"}
    key = repr(
        (
            told,
            read.time_s.tobytes(),
            [(heading, one.time_s.tobytes(), one.values.tobytes()) for heading, one in samples],
        )
    )
    if key not in _fits:
        start = replace(starting_model("transfer-function"), origin={"structure": "1 pole, dead time"})
        _fits[key] = fit_plant(start, [experiment(read, start.definition, "command", "flow", 0.0)])
    return _fits[key]


def agrees(read: Recording) -> None:
    found = identified(read).model.parameters
    for name, value in TRUE.items():
        std = found[name].std
        assert std is not None and std < 0.05 * value
        assert abs(found[name].value - value) < 4.0 * std


def text(head: str, row: Callable[[float, float, float], str]) -> str:
    one = made()
    rows = zip(one.time_s.tolist(), one.values("command").tolist(), one.values("flow").tolist(), strict=True)
    return head + "".join(row(*values) + "\n" for values in rows)


def comma(t: float, u: float, y: float) -> str:
    return f"{t:.2f},{u},{y}"


STYLES = {
    "contract": ("time [s],command [%],flow [l/min]\n", comma, Reading()),
    "parentheses": ("Time (s),command (%),flow (l/min)\n", comma, Reading()),
    "units in a row": ("time,command,flow\ns,%,l/min\n", comma, Reading()),
    "units after a comma": ("time, s;command, %;flow, l/min\n", lambda *v: comma(*v).replace(",", ";"), Reading()),
    "decimal comma": ("time [s];command [%];flow [l/min]\n", lambda *v: comma(*v).replace(",", ";").replace(".", ","),
                      Reading()),
    "milliseconds": ("time [ms],command [%],flow [l/min]\n", lambda t, u, y: f"{1e3 * t:.0f},{u},{y}", Reading()),
    "preamble": ("#Logger\nTest,7\n\ntime [s],command [%],flow [l/min]\n", comma, Reading()),
    "time last": ("command [%],flow [l/min],time [s]\n", lambda t, u, y: f"{u},{y},{t:.2f}", Reading()),
    "index and text": (",time [s],command [%],flow [l/min],state\n",
                       lambda t, u, y: f"{t / INTERVAL_S:.0f},{comma(t, u, y)},RUN", Reading()),
    "calendar": ("timestamp,command [%],flow [l/min]\n",
                 lambda t, u, y: f"2026-01-31T23:59:{50 + t:06.3f},{u},{y}" if t < 10.0
                 else f"2026-02-01T00:00:{t - 10.0:06.3f},{u},{y}", Reading()),
    "clock": ("Clock,command [%],flow [l/min]\n",
              lambda t, u, y: f"23:59:{50 + t:06.3f},{u},{y}" if t < 10.0 else f"00:00:{t - 10.0:06.3f},{u},{y}",
              Reading()),
    "no units": ("time,command,flow\n", comma, Reading(units={"command": "%", "flow": "l/min"})),
    "no headings": ("", lambda *v: comma(*v).replace(",", "  "), Reading(columns=("time [s]", "command [%]",
                                                                               "flow [l/min]"))),
    "no time": ("command [%],flow [l/min]\n", lambda _t, u, y: f"{u},{y}", Reading(interval_s=INTERVAL_S)),
    "other names": ("t_x,u,y\n", comma, Reading(time="t_x", renamed={"u": "command", "y": "flow"},
                                               units={"command": "%", "flow": "l/min"})),
    "two times": ("time command [s],command [%],time flow [s],flow [l/min]\n",
                  lambda t, u, y: f"{t:.2f},{u},{t:.2f},{y}", Reading()),
}  # fmt: skip


@pytest.mark.parametrize("style", STYLES)
def test_in_every_heading_style(read_text, style):
    head, row, reading = STYLES[style]
    found = read_text(text(head, row), reading)
    assert found.time_s - found.time_s[0] == pytest.approx(TIME_S, abs=1e-9)
    assert np.array_equal(found.values("command", "%"), made().values("command"))
    assert np.array_equal(found.values("flow", "l/min"), made().values("flow"))


@pytest.mark.parametrize("ending", sorted({m.SUFFIXES[0] for m in formats().values() if hasattr(m, "write")}))
@pytest.mark.parametrize("sampling", ["slow output", "on change", "late output", "gaps"])
def test_in_every_format_and_sampling_of_its_channels(tmp_path, ending, sampling):
    whole = made()
    flow, command = whole.values("flow"), whole.values("command")
    changes = np.concatenate(([0], np.flatnonzero(np.diff(command)) + 1))
    own = {
        "slow output": {"flow": Samples(TIME_S[::5], flow[::5])},
        "on change": {"command": Samples(TIME_S[changes], command[changes])},
        "late output": {"flow": Samples(TIME_S[7::3], flow[7::3])},
        "gaps": {"flow": Samples(np.delete(TIME_S, slice(500, 520)), np.delete(flow, slice(500, 520)))},
    }[sampling]
    write_recording(replace(whole, own=own), tmp_path / f"x{ending}")
    agrees(read_recording(tmp_path / f"x{ending}", Reading(gaps=sampling == "gaps")))


def test_the_whole_recording_gives_what_is_true():
    agrees(made())


Columns = dict[str, tuple[str, np.ndarray, np.ndarray]]  # by name: unit, stamps, values
CLOCKS = ("one clock", "command on change", "response slow and late")


def columns(clock: str) -> Columns:
    whole = made()
    command, flow = whole.values("command"), whole.values("flow")
    changes = np.concatenate(([0], np.flatnonzero(np.diff(command)) + 1))
    given, answered = {
        "one clock": (slice(None), slice(None)),
        "command on change": (changes, slice(None)),
        "response slow and late": (slice(None), slice(105, None, 3)),
    }[clock]
    return {"command": ("%", TIME_S[given], command[given]), "flow": ("l/min", TIME_S[answered], flow[answered])}


def frame(told: Columns, gap: str = " [{}]") -> pd.DataFrame:
    one = [
        pd.Series(values, index=stamps, name=name + gap.format(unit)) for name, (unit, stamps, values) in told.items()
    ]
    return pd.concat(one, axis=1).sort_index().rename_axis("time" + gap.format("s")).reset_index()


def by_pandas(told: Columns, folder: Path) -> Path:
    frame(told, " ({})").to_csv(folder / "x.csv", sep=";", decimal=",", index=False, na_rep="NaN")
    return folder / "x.csv"


def by_pandas_long(told: Columns, folder: Path) -> Path:
    long = [pd.DataFrame({"time [s]": t, "name": name, "value": v, "unit": u}) for name, (u, t, v) in told.items()]
    pd.concat(long).sort_values("time [s]", kind="stable").to_csv(folder / "x.csv", index=False)
    return folder / "x.csv"


def by_pyarrow(told: Columns, folder: Path) -> Path:
    frame(told).to_parquet(folder / "x.parquet", engine="pyarrow")
    return folder / "x.parquet"


def by_h5py(told: Columns, folder: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "x.h5", "w") as file:
        for name, (unit, stamps, values) in told.items():
            group = file.create_group(f"daq {name}")
            group["time"], group[name] = stamps, values
            group["time"].attrs["unit"], group[name].attrs["unit"] = "s", unit
    return folder / "x.h5"


def by_nptdms(told: Columns, folder: Path) -> Path:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(folder / "x.tdms") as file:
        for name, (unit, stamps, values) in told.items():
            even = {"wf_increment": stamps[1] - stamps[0], "wf_start_offset": stamps[0], "unit_string": unit,
                    "wf_start_time": np.datetime64("2026-11-25T10:00:00")}  # fmt: skip
            file.write_segment([nptdms.ChannelObject(name, name, values, even)])
    return folder / "x.tdms"


def by_asammdf(told: Columns, folder: Path) -> Path:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for name, (unit, stamps, values) in told.items():
            file.append([asammdf.Signal(values, stamps, unit, name)])
        file.save(folder / "x.mf4")
    return folder / "x.mf4"


def by_scipy(told: Columns, folder: Path) -> Path:
    named = {n: {"time": t, "signals": {"values": v, "label": n}} for n, (_, t, v) in told.items()}
    savemat(folder / "x.mat", named, oned_as="column")
    return folder / "x.mat"


WRITERS = (by_pandas, by_pandas_long, by_pyarrow, by_h5py, by_nptdms, by_asammdf, by_scipy)


# A waveform of TDMS has an even clock.
WRITTEN = [(w, clock) for w in WRITERS for clock in CLOCKS if w is not by_nptdms or clock != "command on change"]


@pytest.mark.parametrize(("writer", "clock"), WRITTEN)
def test_as_other_libraries_write_it(tmp_path, writer, clock):
    units = {"command": "%", "flow": "l/min"} if writer is by_scipy else {}
    agrees(read_recording(writer(columns(clock), tmp_path), Reading(gaps=clock != "one clock", units=units)))


def test_in_lvm(read_text):
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
        "Multi_Headings\tNo\nX_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t2\t\n"
        f"Samples\t{COUNT}\t{COUNT}\nY_Unit_Label\t%\tl/min\nX0\t0\t0\nDelta_X\t0,01\t0,01\n"
        "***End_of_Header***\t\t\nX_Value\tcommand\tflow\n"
    )
    rows = text(head, lambda t, u, y: f"{t:.2f}\t{u}\t{y}".replace(".", ","))
    agrees(read_text(rows, name="x.lvm"))


def test_in_mdf_3(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    one = made()
    changes = np.concatenate(([0], np.flatnonzero(np.diff(one.values("command"))) + 1))
    with asammdf.MDF(version="3.30") as file:
        file.append([asammdf.Signal(one.values("command")[changes], one.time_s[changes], "%", "command")])
        file.append([asammdf.Signal(one.values("flow"), one.time_s, "l/min", "flow")])
        file.save(tmp_path / "x.mdf")
    agrees(read_recording(tmp_path / "x.mdf"))
