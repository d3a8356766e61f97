"""Files as scopes, panels, PLCs and simulators export them: the same numbers and times, or a refusal that says why."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_any
from hil.record.table.response_table import ResponseTable
from hil.units import convert

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

TDS_SAYS = [
    "Record Length,6.0e+01", "Sample Interval,2.0e-03", "Trigger Point,5.0e+00", ",", "Source,CH1", "Vertical Units,V",
    "Vertical Scale,2.0e-02", "Horizontal Units,s", "Probe Atten,1.0e+01", "Model Number,TDS2001C",
]  # fmt: skip
INFINIIUM = [
    "Revision:0", "Points:60", "XDispRange:1.2e-01", "XInc:2e-3", "XOrg:-1.0e-02", "XUnits:Second", "YUnits:Volt",
    "Date:12 MAY 2021", "Time:13:55:29:48", "Max Bandwidth:8e9",
]  # fmt: skip


def twice(said: str) -> str:
    label, value = said.split(":", 1)
    return f"{label}:,{value},{value}\n"


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


SAYS_ABOVE = {
    "Tektronix TDS, one channel": rows(
        lambda i, t, u, y: f"{TDS_SAYS[i] if i < len(TDS_SAYS) else ','},,{t - 0.01:017.12f},{u:10.5f},"
    ),
    "Tektronix DPO7000": rows(
        lambda i, t, u, y: (
            f"{['@Record Length@,60,@Points@', '@Sample Interval@,0.002,s', ',,'][min(i, 2)]},{t - 0.01:.4e},{u}"
        ).replace("@", '"')
    ),
    "Tektronix DPO4000": (
        "Model,DPO4034\n\nPoint Format,Y,\nHorizontal Units,S,\nSample Interval,0.002\nVertical Units,V,A\nLabel,,\n"
        "TIME,CH1,CH2\n" + rows(lambda i, t, u, y: f"{t - 0.01:.7e},{u},{y}")
    ),
    "Tektronix MDO3000": (
        "#Model,MDO3014\n#\n#Horizontal Units,s,\n#,,\n#Sample Interval,0.002,\n#Vertical Units,V,A\n#,,\n"
        "#Label,a,b\n#TIME,CH1,CH2\n" + rows(lambda i, t, u, y: f"{t - 0.01:.7e},{u},{y}")
    ),
    "Infiniium, one channel": "\n".join([*INFINIIUM, "Data:\n"]) + rows(lambda i, t, u, y: f"{t - 0.01:.6E},{u:.5E}"),
    "Infiniium, two channels": (
        ",Channel 1,Channel 2\n"
        + "".join(map(twice, INFINIIUM))
        + "Data:\n"
        + rows(lambda i, t, u, y: f"{t - 0.01:.6E},{u:.5E},{t - 0.01:.6E},{y:.5E}")
    ),
    "Infiniium without times": "\n".join([*INFINIIUM, "Data:\n"]) + rows(lambda i, t, u, y: f"{u:.5E}"),
    "Yokogawa": (
        '"Model Name","DL850"\n"TraceName","CH1","CH2"\n"VUnit","V","A"\n"HResolution",2.0E-03,2.0E-03\n'
        '"HOffset",-1.0E-02,-1.0E-02\n"HUnit","s","s"\n"Date","2021/05/12","2021/05/12"\n'
        '"Time","13:55:29.48","13:55:29.48"\n' + rows(lambda i, t, u, y: f",{u:.5E},{y:.5E},")
    ),
    "GW Instek": (
        "Memory Length,60,\nSource,CH1,\nVertical Units,V,\nHorizontal Units,S,\nSampling Period,2.0E-03,\n"
        "Time,12-May-21 13:55:29,\nMode,Detail,\nWaveform Data,\n" + rows(lambda i, t, u, y: f"{t - 0.01:.6e},{u:.5e},")
    ),
    "Hioki": (
        '"COMMENT","x"\n"TIME","15:26:55"\n"INTERVAL",2.0E-03\n"HORZ_UNITS","S"\n"VERT_UNITS","S","V","A"\n'
        '"SIGNAL","TIME","ACH1","ACH2"\n"DATA"\n' + rows(lambda i, t, u, y: f"{t:+.4E},{u:+.4E},{y:+.6E}")
    ),
    "Hantek": "#CHANNEL:CH1,CH2\n#CLOCK=2000uS\n#SIZE=60\n\n" + rows(lambda i, t, u, y: f"{u:.5f},{y:.5f}"),
    "OWON": (
        "Channel,CH1,CH2\nPK-PK,10.0V,8.0V\nTime interval,2ms\nindex,CH1_Voltage(V),CH2_Voltage(V)\n"
        + rows(lambda i, t, u, y: f"{i},{u},{y}")
    ),
    "dSPACE": (
        'version,2.0\n\ndescriptor,X,"command","flow"\nunit,s,V,A\ndevice,,P,P\ntrace_values,,,\n'
        + rows(lambda i, t, u, y: f",{t:.6f},{u},{y}")
    ),
    "SignalExpress": (
        "channel names:\nDev1_ai0\tDev1_ai1\ndt:\n0.002\t0.002\ndata:\n" + rows(lambda i, t, u, y: f"{u:.6E}\t{y:.6E}")
    ),
    "a logger that says its rate": (
        "Job: 12\nSample rate: 500 Hz\ncommand (V)\tflow (A)\n" + rows(lambda i, t, u, y: f"{u}\t{y}")
    ),
    "Rohde & Schwarz": "in s,CH1 in V,CH2 in A\n" + rows(lambda i, t, u, y: f"{t - 0.01:.6E},{u:.5E},{y:.5E}"),
    "LTspice, commas": "time,V(in),I(R1)\n" + rows(lambda i, t, u, y: f"{t:.15e},{u:.6e},{y:.6e}"),
    "panel of Siemens, one column a channel": (
        "TimeString;Time_ms;command;flow\n"
        + rows(
            lambda i, t, u, y: (
                f"25.11.2026 10:00:00;{decimal_comma(1e6 * (46_351.416 + t / 86_400.0))};"
                f"{decimal_comma(u)};{decimal_comma(y)}"
            )
        )
    ),
}
UNITS = {"SignalExpress": "1", "Hantek": "1", "Tektronix DPO7000": "1", "panel of Siemens, one column a channel": "1"}


@pytest.mark.parametrize("program", SAYS_ABOVE)
def test_what_lines_above_or_beside_the_samples_say_is_used(read_text, program):
    found = read_text(SAYS_ABOVE[program])
    assert found.time_s - found.time_s[0] == pytest.approx(TIME_S, abs=1e-5)
    command, *flow = found.channels.values()
    assert convert(command.values, command.unit, UNITS.get(program, "V")) == pytest.approx(COMMAND, abs=1e-5)
    for channel in flow:
        assert channel.values == pytest.approx(FLOW, abs=1e-5)


def test_a_scope_without_times_starts_where_it_says(read_text):
    found = read_text(SAYS_ABOVE["Yokogawa"])
    assert list(found.channels) == ["CH1", "CH2"] and found.channel("CH2").unit == "A"
    assert found.time_s[0] == pytest.approx(-0.01)
    assert found.meta["assumed"] == ["even time base of 0.002 s, as line 4 says"]


def test_numbers_of_rows_below_labels_are_no_time_where_one_is_labelled(read_text):
    head = "Operator: A\n\nChannel,Time,Command,Flow\nUnit,ms,%,l/min\nSensor,,AO1,FM2\n"
    rows = "".join(f"{k + 1},{10 * k},{k % 7},{0.1 * k:.1f}\n" for k in range(60))
    found = read_text(head + rows)
    assert found.time_s == pytest.approx(0.01 * np.arange(60))
    assert [channel.heading for channel in found.channels.values()] == ["Command [%]", "Flow [l/min]"]


@pytest.mark.parametrize("first", [lambda k: 5.0 * (k > 30), float], ids=["a command that steps up", "a row's number"])
def test_a_column_that_goes_on_otherwise_than_the_interval_above_is_no_time(read_text, first):
    rows = "".join(f"{first(k)}\t{0.1 * k:.3f}\n" for k in range(60))
    found = read_text(f"[Header]\nSamplingTime=10.000 ms\n[Data]\n{rows}", name="x.txt")
    assert found.time_s == pytest.approx(0.01 * np.arange(60))
    assert found.values("channel 1").tolist() == [first(k) for k in range(60)]
    assert found.values("channel 2")[-1] == 5.9


@pytest.mark.parametrize(
    ("above", "row"),
    [
        ("Header:,Date,Time,u,y\n", "Data:,03/04/2026,13:05:07;{ms:03d},{u},{y}"),  # Rockwell's trends
        ("NodeId,SourceTimestamp,Value,StatusCode\n",
         "u,2026-03-04T13:05:07.{ms:03d}Z,{u},Good\ny,2026-03-04T13:05:07.{ms:03d}Z,{y},Good"),  # OPC UA
        ('"report-rfile"\n"Time Step" "y etc.."\n("Time Step" "u" "y" "flow-time")\n', "{k} {u} {y} {t}"),  # Fluent
        ("Datum;Zeit;[V] u;[bar] y\n", "04.03.2026;13:05:07,{ms:03d};{u};{y}"),  # Testo
    ],
)  # fmt: skip
def test_stamps_and_names_of_a_panel_a_solver_and_a_meter_are_read(read_text, above, row):
    lines = [row.format(k=k, t=0.01 * k, ms=10 * k, u=k // 7, y=0.5 * k) for k in range(60)]
    found = read_text(above + "\n".join(lines) + "\n")
    assert list(found.channels) == ["u", "y"]
    np.testing.assert_allclose(found.time_s, 0.01 * np.arange(60), atol=1e-9)
    assert found.values("y").tolist() == [0.5 * k for k in range(60)]


@pytest.mark.parametrize("remark", ["# type: matrix", "# title = time,u,y"])
def test_words_of_a_remark_are_no_headings(read_text, remark):
    rows_of = "".join(f" {0.01 * k} {k // 7} {0.5 * k}\n" for k in range(60))
    with pytest.raises(FileError, match=r"name the 3 columns with --columns"):
        read_text(f"# Created by a program\n{remark}\n{rows_of}", name="x.txt")


def test_counts_of_a_converter_are_not_said_to_be_volts(read_text):
    fast = SAYS_ABOVE["GW Instek"].split("Waveform Data")[0].replace("Detail", "Fast") + "Waveform Data,\n"
    assert read_text(fast + rows(lambda i, t, u, y: f"{i % 50},")).meta["units_missing"] == ["CH1"]


@pytest.mark.parametrize("heading", ["V(V)", "V(mV)", "I(mA)"])
def test_a_unit_of_a_voltage_or_current_is_no_node_of_a_circuit(read_text, heading):
    (channel,) = read_text(f"time,{heading}\n0,1\n1,2\n2,3\n").channels.values()
    assert (channel.name, channel.unit) == (heading[0], heading[2:-1])


def test_a_point_among_decimal_commas_is_no_mark_of_thousands(read_text):
    found = read_text("time [s];flow [l/min]\n0,0;5,0\n0,1;5.0739\n0,2;-4.07\n")
    assert found.values("flow").tolist() == [5.0, 5.0739, -4.07]


def test_thousands_far_down_are_read(read_text):
    number = (f"{3.7 * i:,.1f}".translate(str.maketrans(",.", ".,")) for i in range(900))
    text = "".join(f"{i};{text}\n" for i, text in enumerate(number))
    assert read_text(f"time [s];flow [l/min]\n{text}").values("flow")[-1] == pytest.approx(3.7 * 899, abs=0.051)


@pytest.mark.parametrize("program", FILES)
def test_a_recording_of_another_program_has_its_numbers_and_times(read_text, program):
    found = read_text(FILES[program])
    command, flow = (found.samples(name) for name in list(found.channels))
    for one, values in ((command, COMMAND), (flow, FLOW)):
        assert one.time_s - one.time_s[0] == pytest.approx(TIME_S, abs=2e-5)
        assert one.values == pytest.approx(values, abs=1e-5)


def test_a_scope_says_its_units_and_where_its_time_starts(read_text):
    found = read_text(next(iter(FILES.values())))
    assert found.time_s[0] == pytest.approx(-0.01) and found.values("CH2", "mV") == pytest.approx(1e3 * FLOW)
    assert {c.heading for c in read_text(FILES["LTspice"]).channels.values()} == {"V(in) [V]", "I(R1) [A]"}


def test_channels_of_twincat_keep_their_own_rates_and_a_scale_is_said(read_text):
    slow = [f"{4 * i}\t{y}" if 2 * i < COUNT else "\t" for i, y in enumerate(FLOW[::2].tolist() + [""] * 30)]
    head = TWINCAT_HEAD.replace("ScaleFactor\t1\tScaleFactor\t1", "ScaleFactor\t1\tScaleFactor\t-10")
    text = head + rows(lambda i, t, u, y: f"{1e3 * t:g}\t{u:g}\t{slow[i]}")
    found = read_text(text, name="x.txt")
    assert found.samples("flow").time_s == pytest.approx(TIME_S[::2]) and len(found.samples("command").values) == COUNT
    assert any("'flow': the headings state ScaleFactor -10" in said for said in found.meta["assumed"])


def test_channels_of_a_historian_keep_how_far_their_first_stamps_lie_apart(read_text):
    lines = [f"2026-11-25 10:00:{t:06.3f};{name};{t}" for t in np.arange(8) / 2 for name in ("uy"[int(2 * t) % 2],)]
    found = read_text("\n".join(["Timestamp;Tagname;Value", *lines]))
    assert found.samples("u").time_s.tolist() == found.samples("u").values.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert found.samples("y").time_s.tolist() == found.samples("y").values.tolist() == [0.5, 1.5, 2.5, 3.5]


@pytest.mark.parametrize(("late_s", "rounded"), [(0.5, False), (0.0, False), (0.0, True)])
def test_a_date_further_on_is_a_clock_of_its_own_unless_it_says_the_same(read_text, late_s, rounded):
    def date(t, digits=3):
        return f"2026-11-25 10:00:{t:0{3 + digits if digits else 2}.{digits}f}"

    own = [date(math.floor(t), 0) if rounded else date(t + late_s) for t in np.arange(10) / 10]
    lines = [f"{date(i / 10)};{i};{one};{i}" for i, one in enumerate(own)]
    found = read_text("\n".join(["Time A;u;Time B;y", *lines]))
    for name, apart_s in (("u", 0.0), ("y", late_s)):
        samples = found.samples(name)
        assert samples.time_s == pytest.approx(samples.values / 10 + apart_s) and len(samples.values) >= 5


def test_a_bad_quality_is_left_out_and_counted(read_text):
    assert any("1 rows of bad quality left out" in said for said in read_text(FILES["historian"]).meta["assumed"])


def polar(g: complex) -> str:
    return f"({20 * np.log10(abs(g)):.14e}dB,{np.degrees(np.angle(g)):.14e}°)"


@pytest.mark.parametrize("cell", [polar, lambda g: f"{g.real},{g.imag}"])
def test_a_response_of_ltspice_is_a_table(tmp_path, cell):
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
def test_what_ltspice_exports_together_is_refused_with_what_to_export(tmp_path, text, says):
    (tmp_path / "x.txt").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=says):
        read_any(tmp_path / "x.txt")
