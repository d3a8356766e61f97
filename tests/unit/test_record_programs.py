"""Files as scopes, panels, PLCs and simulators export them: the same numbers and times, or a refusal that says why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_any, read_recording
from hil.record.response_table import ResponseTable

COUNT, STEP_S = 60, 0.002
TIME_S = STEP_S * np.arange(COUNT)
COMMAND = np.repeat([0.0, 3.5, -2.25, 5.0], COUNT // 4)
FLOW = np.round(2.0 * np.sin(9.0 * TIME_S) - 1.0, 5)


def rows(row: Callable[[int, float, float, float], str]) -> str:
    each = zip(range(COUNT), TIME_S.tolist(), COMMAND.tolist(), FLOW.tolist(), strict=True)
    return "".join(row(*one) + "\n" for one in each)


def decimal_comma(value: float) -> str:
    return f"{value:.5f}".replace(".", ",")


def two_lines(row: Callable[[str, float, float], str]) -> str:
    return rows(lambda _, t, u, y: f"{row('command', t, u)}\n{row('flow', t, y)}")


def panel_row(name: str, t: float, value: float) -> str:
    day = f"{1e6 * (46_351.416_666 + t / 86_400.0):.4f}".replace(".", ",")
    return f'"{name}";"25.11.2026 10:00:00";{decimal_comma(value)};1;{day}'


TWINCAT_HEAD = (
    "Name\tScope\nFile\tC:\\Scope.csv\nStarttime of export\t132959733843760000\tMontag, 2. Mai 2022\t15:56:24.376\n"
    "Endtime of export\t132959733853750000\tMontag, 2. Mai 2022\t15:56:25.375\n\n\n"
    "Name\tcommand\tName\tflow\nSymbolComment\t\tSymbolComment\t\nData-Type\tREAL32\tData-Type\tREAL64\n"
    "SampleTime[ms]\t2\tSampleTime[ms]\t2\nPort\t851\tPort\t851\nOffset\t0\tOffset\t0\nScaleFactor\t1\tScaleFactor\t1\n"
    "Unit\tV (Voltage)\tUnit\t(None)\n\n"
)

FILES = {
    "Rigol, start and increment beside the headings": (
        "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e-02,2.000000e-03\n"
        + rows(lambda i, t, u, y: f"{i},{u},{y},")
    ),
    "Rigol, t0 and tInc in the heading": (
        "CH1(V),CH2(V),t0 =-1.0e-02, tInc = 2.000000e-03,\n" + rows(lambda i, t, u, y: f"{u},{y},,")
    ),
    "Keysight": "x-axis,1,2\nsecond,Volt,Volt\n" + rows(lambda i, t, u, y: f"{t - 0.01:+.6E},{u:+.4E},{y:+.6E}"),
    "Siglent": (
        "Record Length,Analog:60,\nSample Interval,Analog:2.0E-03,\nVertical Units,CH1:V,CH2:V,,\n"
        "Vertical Scale,CH1:1.00E+00,CH2:2.00E+00,,\nHorizontal Units,s,\nModel Number,SDS2104X Plus,\n"
        "Source,CH1,CH2,\nSecond,Volt,Volt\n" + rows(lambda i, t, u, y: f"{t - 0.01:+.6E},{u:+.4E},{y:+.6E}")
    ),
    "TwinCAT Scope": (
        TWINCAT_HEAD
        + rows(lambda i, t, u, y: f"{1e3 * t:g}\t{decimal_comma(u)}\t{1e3 * t:g}\t{decimal_comma(y)}") + "EOF\n"
    ),
    "LTspice": "time\tV(in)\tI(R1)\n" + rows(lambda i, t, u, y: f"{t:.15e}\t{u:.6e}\t{y:.6e}"),
    "database, one row per channel and stamp": (
        "time [s],name,value,unit\n" + two_lines(lambda name, t, v: f"{t:.4f},{name},{v},V")
    ),
    "historian": (
        "Timestamp;Tagname;Value;Quality\n"
        + two_lines(lambda name, t, v: f"25.11.2026 10:00:{t:06.3f};{name};{decimal_comma(v)};192")
        + "25.11.2026 10:00:09.000;flow;99,0;0\n"
    ),
    "panel of Siemens": (
        '"VarName";"TimeString";"VarValue";"Validity";"Time_ms"\n' + two_lines(panel_row)
        + '"$RT_OFF$";"25.11.2026 10:01:00";0;2;46351417361,1\n'
    ),
    "data log of a PLC": (
        '"Record";"Date";"UTC Time";"command";"flow"\n'
        + rows(lambda i, t, u, y: f"{i + 1};2026-11-25;10:00:{t:06.3f};{u:.4f};{y:.6f}") + "//END\n"
    ),
}  # fmt: skip


@pytest.mark.parametrize("program", FILES)
def test_a_recording_of_another_program_has_its_numbers_and_times(tmp_path: Path, program: str) -> None:
    (tmp_path / "x.csv").write_text(FILES[program], encoding="utf-8")
    found = read_recording(tmp_path / "x.csv")
    command, flow = (found.samples(name) for name in list(found.channels))
    for one, values in ((command, COMMAND), (flow, FLOW)):
        assert one.time_s - one.time_s[0] == pytest.approx(TIME_S, abs=2e-5)
        assert one.values == pytest.approx(values, abs=1e-5)


def test_a_scope_says_its_units_and_where_its_time_starts(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(next(iter(FILES.values())), encoding="utf-8")
    found = read_recording(tmp_path / "x.csv")
    assert found.time_s[0] == pytest.approx(-0.01) and found.values("CH2", "mV") == pytest.approx(1e3 * FLOW)
    (tmp_path / "y.csv").write_text(FILES["LTspice"], encoding="utf-8")
    assert {c.heading for c in read_recording(tmp_path / "y.csv").channels.values()} == {"V(in) [V]", "I(R1) [A]"}


def test_channels_of_twincat_keep_their_own_rates_and_a_scale_is_said(tmp_path: Path) -> None:
    slow = [f"{4 * i}\t{y}" if 2 * i < COUNT else "\t" for i, y in enumerate(FLOW[::2].tolist() + [""] * 30)]
    head = TWINCAT_HEAD.replace("ScaleFactor\t1\tScaleFactor\t1", "ScaleFactor\t1\tScaleFactor\t-10")
    text = head + rows(lambda i, t, u, y: f"{1e3 * t:g}\t{u:g}\t{slow[i]}")
    (tmp_path / "x.txt").write_text(text, encoding="utf-8")
    found = read_recording(tmp_path / "x.txt")
    assert found.samples("flow").time_s == pytest.approx(TIME_S[::2]) and len(found.samples("command").values) == COUNT
    assert any("'flow': the headings state ScaleFactor -10" in said for said in found.meta["assumed"])


def test_a_bad_quality_is_left_out_and_counted(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(FILES["historian"], encoding="utf-8")
    assert any("1 rows of bad quality left out" in said for said in read_recording(tmp_path / "x.csv").meta["assumed"])


def polar(g: complex) -> str:
    return f"({20 * np.log10(abs(g)):.14e}dB,{np.degrees(np.angle(g)):.14e}°)"


@pytest.mark.parametrize("cell", [polar, lambda g: f"{g.real},{g.imag}"])
def test_a_response_of_ltspice_is_a_table(tmp_path: Path, cell: Callable[[complex], str]) -> None:
    hz = np.geomspace(0.1, 100.0, 30)
    response = 2.0 / (1.0 + 2j * np.pi * hz * 0.02)
    text = "Freq.\tV(out)/V(in)\n" + "".join(f"{f:.14e}\t{cell(g)}\n" for f, g in zip(hz, response, strict=True))
    (tmp_path / "x.txt").write_bytes(text.encode("cp1252"))
    found = read_any(tmp_path / "x.txt")
    assert isinstance(found, ResponseTable)
    np.testing.assert_allclose(found.response, response, rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time\tV(out)\nStep Information: R=1K  (Run: 1/2)\n0\t0\n1\t1\n2\t1\n", "holds 2 runs of a parameter"),
        ("Freq.\tV(in)\tV(out)\n1\t1,0\t1,0\n2\t1,0\t1,0\n", r"2 traces over frequency, V\(in\), V\(out\); .*export"),
        ("Freq.\tV(out)\n1\t1,0\n2\tabc\n3\t1,0\n", "row 2: 'abc' is no complex number"),
    ],
)
def test_what_ltspice_exports_together_is_refused_with_what_to_export(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "x.txt").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=says):
        read_any(tmp_path / "x.txt")
