"""Spreadsheets and sound files are read; what nobody reads says what it is and what to export instead."""

from __future__ import annotations

import json
import re
import struct
import zipfile
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from hil.errors import FileError
from hil.record.read import read_any, read_recording, write_recording
from hil.record.reading import Reading
from hil.record.recording import recording
from hil.record.table.response_table import ResponseTable

HEAD = ("time [s]", "u [V]", "y [bar]")
ROWS = [(0.01 * k, float(k % 7), 0.25 * k) for k in range(40)]


def sheet(path: Path, *rows, first=(1, 1), other=()) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    book = openpyxl.Workbook()
    for at, row in enumerate(rows):
        for column, cell in enumerate(row):
            book.active.cell(first[0] + at, first[1] + column, cell)
    if other:
        for row in (extra := book.create_sheet("notes")).iter_rows(max_row=1, max_col=len(other)):
            for cell, text in zip(row, other, strict=True):
                extra[cell.coordinate] = text
    book.save(path)
    return path


class TestSpreadsheets:
    @pytest.mark.parametrize(
        ("above", "first"),
        [
            ([HEAD], (1, 1)),
            ([("Bench 3",), (), ("Time", "u", "y"), ("s", "V", "bar")], (1, 1)),
            ([HEAD], (5, 3)),
        ],
    )
    def test_a_sheet_is_read_as_a_text_file_would_be(self, tmp_path, above, first):
        found = read_recording(sheet(tmp_path / "x.xlsx", *above, *ROWS, first=first))
        assert [channel.heading for channel in found.channels.values()] == ["u [V]", "y [bar]"]
        assert found.name == str(tmp_path / "x.xlsx")
        np.testing.assert_allclose(found.time_s, [row[0] for row in ROWS], rtol=1e-15)
        np.testing.assert_array_equal(found.values("y"), [row[2] for row in ROWS])

    def test_stamps_of_a_calendar_are_the_time(self, tmp_path):
        start = datetime(2026, 3, 1, 12)
        rows = [(start + timedelta(seconds=time), *values) for time, *values in ROWS]
        found = read_recording(sheet(tmp_path / "x.xlsx", ("Stamp", "u [V]", "y [bar]"), *rows))
        np.testing.assert_allclose(found.time_s, [row[0] for row in ROWS], atol=1e-6)

    @pytest.mark.parametrize(("form", "shown"), [("0.00%", 100.0), ("General", 1.0)])
    def test_a_column_in_percent_is_read_as_the_sheet_shows_it(self, tmp_path, form, shown):
        path = sheet(tmp_path / "x.xlsx", ("time [s]", "u [%]", "y"), *((t, u / 100.0, y) for t, u, y in ROWS))
        openpyxl = pytest.importorskip("openpyxl")
        book = openpyxl.load_workbook(path)
        for column in "BC":
            for cell in book.active[column][1:]:
                cell.number_format = form
        book.save(path)
        found = read_recording(path)
        np.testing.assert_allclose(found.values("u"), [shown * u / 100.0 for _, u, _ in ROWS], rtol=1e-15)
        np.testing.assert_array_equal(found.values("y"), [y for _, _, y in ROWS])

    def test_the_sheet_with_the_most_rows_is_read_and_others_are_named(self, tmp_path):
        found = read_recording(sheet(tmp_path / "x.xlsx", HEAD[:2], *(r[:2] for r in ROWS), other=("a",)))
        assert any("not read: notes" in note for note in found.meta["assumed"])

    def test_a_longer_sheet_of_remarks_is_not_read(self, tmp_path):
        remarks = [("operator", "me")] * 200
        path = sheet(tmp_path / "x.xlsx", *remarks)
        openpyxl = pytest.importorskip("openpyxl")
        book = openpyxl.load_workbook(path)
        for row in [HEAD, *ROWS]:
            (book["data"] if "data" in book.sheetnames else book.create_sheet("data")).append(row)
        book.save(path)
        assert read_recording(path).values("y", "bar").tolist() == [row[2] for row in ROWS]

    def test_a_mean_below_an_empty_row_is_named_by_its_row(self, tmp_path):
        path = sheet(tmp_path / "x.xlsx", HEAD, *ROWS, (), ("Mean", 3.0, 5.0))
        with pytest.raises(FileError, match=r"line 43, column 1 .*: 'Mean' is not a number"):
            read_recording(path)

    def test_a_cell_that_is_no_number_is_named_by_sheet_and_row(self, tmp_path):
        rows = [*ROWS[:20], (0.2, "bad", 5.0), *ROWS[21:]]
        path = sheet(tmp_path / "x.xlsx", HEAD, *rows)
        with pytest.raises(FileError, match=r"x\.xlsx, sheet 'Sheet': line 22, column 2 .*: 'bad' is not a number"):
            read_recording(path)
        assert np.isnan(read_recording(path, Reading(gaps=True)).own["u"].values).sum() == 0

    def test_libreoffice_is_read_too(self, tmp_path):
        pytest.importorskip("python_calamine")
        spaces = " ".join(
            f'xmlns:{short}="urn:oasis:names:tc:opendocument:xmlns:{name}:1.0"'
            for short, name in (("office", "office"), ("table", "table"), ("text", "text"))
        )
        texts = "".join(f'<table:table-cell office:value-type="string"><text:p>{heading}</text:p></table:table-cell>'
                        for heading in ("time [s]", "u [V]"))  # fmt: skip
        rows = "".join(
            "<table:table-row>"
            + "".join(f'<table:table-cell office:value-type="float" office:value="{v}"/>' for v in row[:2])
            + "</table:table-row>"
            for row in ROWS
        )
        content = (
            f'<?xml version="1.0"?><office:document-content {spaces}><office:body><office:spreadsheet>'
            f'<table:table table:name="S"><table:table-row>{texts}</table:table-row>{rows}</table:table>'
            "</office:spreadsheet></office:body></office:document-content>"
        )
        manifest = '<m:manifest xmlns:m="urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"/>'
        with zipfile.ZipFile(tmp_path / "x.ods", "w") as file:
            file.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
            file.writestr("META-INF/manifest.xml", manifest)
            file.writestr("content.xml", content)
        np.testing.assert_array_equal(read_recording(tmp_path / "x.ods").values("u"), [row[1] for row in ROWS])

    def test_nothing_in_it_is_said(self, tmp_path):
        with pytest.raises(FileError, match=r"x\.xlsx: no sheet holds anything"):
            read_recording(sheet(tmp_path / "x.xlsx"))


class TestSound:
    @pytest.mark.parametrize(
        ("kind", "scale", "offset"), [("f4", 1.0, 0), ("i2", 2.0**15, 0), ("i4", 2.0**31, 0), ("u1", 128.0, 128)]
    )
    def test_channels_are_shares_of_full_scale_at_the_stated_rate(self, tmp_path, kind, scale, offset):
        from scipy.io import wavfile

        shares = np.array([[0.0, 0.5], [0.25, -0.5], [-0.75, 0.125], [0.5, 0.0]])
        wavfile.write(tmp_path / "x.wav", 200, (shares * scale + offset).astype(kind))
        found = read_recording(tmp_path / "x.wav")
        np.testing.assert_array_equal(found.time_s, 0.005 * np.arange(4))
        np.testing.assert_array_equal([c.values for c in found.channels.values()], shares.T)
        assert any("200 Hz" in note for note in found.meta["assumed"])


DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 256 Valve: 8 A
 SG_ command : 0|16@1- (0.01,0) [-100|100] "%" A
 SG_ flow : 16|16@1- (0.01,0) [-100|100] "l/min" A
BO_ 2566914048 Pump: 2 A
 SG_ pressure : 7|16@0+ (0.1,-5) [0|400] "bar" A
"""


def can_log(path: Path, dbc: str = "") -> Path:
    can = pytest.importorskip("can")
    writer = can.Logger(path)
    for k in range(40):
        sent = {"timestamp": 1.7e9 + 0.01 * k}
        writer(can.Message(arbitration_id=0x100, is_extended_id=False, data=struct.pack("<hhI", -k, 9 * k, k), **sent))
        if k % 4 == 0:
            writer(can.Message(arbitration_id=0x19000000, data=struct.pack(">H", 1000 + k), **sent))
        writer(can.Message(arbitration_id=0x333, is_extended_id=False, data=b"\1", **sent))
    writer.stop()
    if dbc:
        (path.parent / dbc).write_text(DBC.replace("2566914048", str(0x19000000 + 2**31)))
    return path


class TestCanLogs:
    @pytest.mark.parametrize("ending", [".asc", ".blf", ".trc", ".log"])
    @pytest.mark.parametrize("dbc", ["x.dbc", "bench.dbc"])
    def test_signals_are_read_by_the_dbc_beside_the_log(self, tmp_path, ending, dbc):
        found = read_recording(can_log(tmp_path / f"x{ending}", dbc))
        assert [c.heading for c in found.channels.values()] == ["command [%]", "flow [l/min]", "pressure [bar]"]
        np.testing.assert_allclose(found.time_s, 0.01 * np.arange(len(found)), atol=1e-6)
        np.testing.assert_allclose(found.values("flow"), 0.09 * np.arange(len(found)))
        np.testing.assert_allclose(found.own["pressure"].values, 95.0 + 0.4 * np.arange(10))
        assert any(dbc in note and "1 identifiers are not in it" in note for note in found.meta["assumed"])

    def test_a_log_without_its_dbc_says_so(self, tmp_path):
        with pytest.raises(FileError, match=r"x\.asc: is a CAN log, and its signals need a DBC file: .* as x\.dbc"):
            read_recording(can_log(tmp_path / "x.asc"))

    def test_a_dbc_of_another_bus_says_which_identifiers_there_are(self, tmp_path):
        path = can_log(tmp_path / "x.blf", "x.dbc")
        (tmp_path / "x.dbc").write_text(DBC.replace("256", "257"))
        with pytest.raises(FileError, match=r"no frame of the log is in x\.dbc; its identifiers: 0x100, 0x333"):
            read_recording(path)


def comtrade(folder: Path, kind: str) -> Path:
    pytest.importorskip("comtrade")
    lines = ["BENCH,1,1999", "3,2A,1D",
             "1,u,,,V,0.01,0.5,0,-32767,32767,1,1,P", "2,y,,,bar,0.02,0,0,-32767,32767,1,1,P",
             "1,open,,,0", "50", "1", f"100,{len(ROWS)}", *["01/03/2026,12:00:00.000000"] * 2, kind, "1"]  # fmt: skip
    (folder / "x.cfg").write_text("\r\n".join(lines) + "\r\n")
    rows = [(k + 1, 10_000 * k, 3 * k, -5 * k, k % 2) for k in range(len(ROWS))]
    if kind == "ASCII":
        (folder / "x.dat").write_text("".join(",".join(map(str, row)) + "\r\n" for row in rows))
    else:
        (folder / "x.dat").write_bytes(b"".join(struct.pack("<IIhhH", *row) for row in rows))
    return folder / "x.cfg"


class TestComtrade:
    @pytest.mark.parametrize("kind", ["ASCII", "BINARY"])
    def test_channels_are_scaled_and_digital_ones_are_numbers(self, tmp_path, kind):
        found, k = read_recording(comtrade(tmp_path, kind)), np.arange(len(ROWS))
        assert [c.heading for c in found.channels.values()] == ["u [V]", "y [bar]", "open [1]"]
        np.testing.assert_allclose(found.time_s, 0.01 * k, atol=1e-12)
        np.testing.assert_allclose(found.values("u"), 0.03 * k + 0.5, rtol=1e-12)
        np.testing.assert_allclose(found.values("y"), -0.1 * k, rtol=1e-12)
        np.testing.assert_array_equal(found.values("open"), k % 2)

    def test_one_half_names_the_other(self, tmp_path):
        described = comtrade(tmp_path, "BINARY")
        with pytest.raises(FileError, match=r"x\.dat: holds the samples of a COMTRADE recording; give x\.cfg"):
            read_recording(tmp_path / "x.dat")
        (tmp_path / "x.dat").unlink()
        with pytest.raises(FileError, match=r"whose samples, x\.dat, are not beside it"):
            read_recording(described)


def universal(path: Path, *functions, binary: int = 0) -> Path:
    pyuff = pytest.importorskip("pyuff")
    sets = []
    for node, (name, x, data, unit) in enumerate(functions, 1):
        over_frequency = np.iscomplexobj(data)
        sets.append({
            "type": 58, "binary": binary, "func_type": 4 if over_frequency else 1, "rsp_node": node, "rsp_dir": 3,
            "ref_node": 1, "ref_dir": 1, "id1": name, "id2": "", "id3": "", "id4": "", "id5": "", "ver_num": 0,
            "load_case_id": 0, "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "num_pts": len(x), "x": x, "data": data,
            "ord_data_type": 6 if over_frequency else 4, "abscissa_spacing": 1, "abscissa_min": float(x[0]),
            "abscissa_inc": float(x[1] - x[0]), "z_axis_value": 0.0, "abscissa_axis_lab": "",
            "abscissa_spec_data_type": 18 if over_frequency else 17, "abscissa_axis_units_lab": "",
            "ordinate_spec_data_type": 0, "ordinate_axis_lab": "", "ordinate_axis_units_lab": unit,
            "orddenom_spec_data_type": 0,
        })  # fmt: skip
    pyuff.UFF(path).write_sets(sets, "add")
    return path


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # pyuff's writer leaves files open
class TestUniversalFiles:
    @pytest.mark.parametrize("binary", [0, 1])
    def test_signals_are_read_at_their_times(self, tmp_path, binary):
        time_s, u, y = (np.array(column) for column in zip(*ROWS, strict=True))
        path = universal(tmp_path / "x.uff", ("u", time_s, u, "V"), ("NONE", time_s, y, "bar"), binary=binary)
        found = read_recording(path)
        assert [c.heading for c in found.channels.values()] == ["u [V]", "2+Z [bar]"]
        np.testing.assert_allclose(found.time_s, time_s, atol=1e-6)
        np.testing.assert_allclose(found.values("2+Z"), y, rtol=1e-6)

    def test_a_frequency_response_is_one(self, tmp_path):
        at_hz = np.linspace(1.0, 50.0, 50)
        response = 0.7 / (1.0 + 2j * np.pi * at_hz * 0.1)
        found = read_any(universal(tmp_path / "x.unv", ("H", at_hz, response, "")))
        assert isinstance(found, ResponseTable)
        np.testing.assert_allclose(found.response, response, rtol=1e-5)
        both = universal(tmp_path / "y.unv", ("H", at_hz, response, ""), ("G", at_hz, response, ""))
        with pytest.raises(FileError, match="holds 2 functions of frequency; export one frequency response"):
            read_any(both)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("x.pdf", b"%PDF-1.7", "is a PDF, which is not read; it shows samples"),
        ("x.dat", b"|CF,2,1,1;", "is a FAMOS file of imc, which is not read; export CSV or MDF4"),
        ("x.trc", b"#9000000346WAVEDESC", "is a waveform of LeCroy, which is not read; save it as ASCII"),
        ("x.dxd", b"\0\1\2", "is a recording of Dewesoft, which is not read; export CSV, MAT or MDF4"),
        ("x.feather", b"ARROW1\0\0", "is an Arrow or Feather file, which is not read; write Parquet, or export CSV"),
        ("x.tdm", b"<usi:tdm", "is a recording of DIAdem, which is not read; save it as TDMS"),
        ("x.zip", b"PK\x03\x04broken", "is a damaged ZIP archive"),
        ("x.xyz", b"\0\1\2", "unknown kind of recording; known endings: .asc, .asc.gz, .blf"),
        ("x.log", b"***BUSMASTER Ver 2.4.0***\n", "is a CAN log of BUSMASTER, which is not read; convert it to ASC"),
        ("x.trc", b"@ TEXT @ 2 @ 64 @", "is a trace of CarBus Analyzer, which is not read; save the log as ASC"),
        ("x.trc", b"PathFileType\t4\t(X/Y/Z)\n", "is a table of marker positions, which is not read"),
        ("x.EW", b"Origin Time       2018/01/24\n", "is an accelerogram of K-NET, several samples on a line"),
        ("x.ascii", b"TIMESERIES XX, 12 samples, 40 sps, 2008, SLIST, FLOAT\n1 2 3\n", "is a list of samples without"),
        ("x.csv", b"Time Stamp,ID,Extended,Bus,LEN,D1\n1,0,0,0,8,10\n2,0,0,0,8,10\n", "holds frames of a CAN bus"),
        ("x.s2p", b"# GHZ S MA R 50\n1 0 0 0 0\n", "is a table of scattering parameters, which is not read"),
        ("x.vcd", b"$date\n$end\n", "is a dump of logic signals (VCD), which is not read"),
        ("x.las", b"~VERSION INFORMATION\n", "is a well log over depth (LAS), which is not read"),
        ("x.cnv", b"* Sea-Bird SBE 21 Data File:\n", "is a recording of Sea-Bird (CNV), which is not read"),
        ("x.log", b"V3.1\n\nFMT, 128, 89, FMT, BBnNZ,\n", "is a flight log of ArduPilot, which is not read"),
    ],
)
def test_what_is_not_read_says_what_it_is(read_text, name, content, said):
    with pytest.raises(FileError, match=re.escape(f"{name}: {said}")):
        read_text(content, name=name)


def test_an_archive_is_named_with_what_it_holds(tmp_path):
    with zipfile.ZipFile(tmp_path / "x.zip", "w") as archive:
        for name in ("a.csv", "b.csv", "c.csv", "d.csv"):
            archive.writestr(name, "time [s]\n")
    with pytest.raises(FileError, match=r"is a ZIP archive of a\.csv, b\.csv, c\.csv and 1 more; unpack it"):
        read_recording(tmp_path / "x.zip")


FRF = """    -1
    58
{name}
NONE
23-Mar-17 19:02:23
NONE
NONE
    4         0    0         0 NONE               0   0 NONE               0   0
         5         2         1 1.00000e+00  1.00000e+00  0.00000e+00
        18    0    0    0 NONE                 Hz
         1    0    0    0 NONE                 {above}
         0    0    0    0 NONE                 {below}
         0    0    0    0 NONE                 NONE
 4.00000e-01  0.00000e+00 -5.00000e-02 -5.00000e-02
    -1
"""


@pytest.mark.parametrize(
    ("above", "below", "said"),
    [("m/s²", "NONE", ["m/s²"]), ("m/s²", "N", ["m/s² / N"]), ("NONE", "NONE", [])],
)
def test_the_unit_of_a_response_in_a_universal_file_is_said(tmp_path, above, below, said):
    pytest.importorskip("pyuff")
    lines = FRF.format(name="H1", above=above, below=below).splitlines()
    (tmp_path / "x.uff").write_bytes("".join(f"{line:80}\n" for line in lines).encode())
    notes = [str(note) for note in read_any(tmp_path / "x.uff").meta.get("assumed", ())]
    assert notes == [f"the file states the gain in {one}; taken as 1, --unit re=… says otherwise" for one in said]
    stated = read_any(tmp_path / "x.uff", Reading(units={"re": "m/s^2", "im": "m/s^2"}))
    assert isinstance(stated, ResponseTable) and stated.unit == "m/s^2"


def test_a_log_of_a_german_can_program_is_one(tmp_path):
    pytest.importorskip("can")
    frames = "".join(f"   {k}.000000 1  180             Tx   d 8 0{k} 00 00 00 00 00 00 00\n" for k in (1, 2, 3))
    (tmp_path / "x.asc").write_text(
        "date Sam Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\n"
        f"Begin Triggerblock\n{frames}End TriggerBlock\n"
    )
    (tmp_path / "x.dbc").write_text(
        'VERSION ""\nBU_: X\nBO_ 384 M: 8 X\n SG_ Pressure : 0|8@1+ (0.5,0) [0|0] "bar" X\n'
    )
    assert read_recording(tmp_path / "x.asc").values("Pressure", "bar").tolist() == [0.5, 1.0, 1.5]


def lines(count: int, row: Callable[[int], str]) -> str:
    return "".join(row(k) + "\n" for k in range(count))


NINE, ALARMS = [2.0 * k for k in range(9)], (
    "Vendor,GRAPHTEC Corporation\nSampling interval,100ms\nNumber,Date&Time,ms,CH1,CH2,Alarm1-10\n"
    "NO.,Time,ms,V,bar,A1234567890\n"
)  # fmt: skip
TABLES = {  # ending, text, its last channel and what that reads at each of its times
    "an ending that says nothing": (
        ".vo2", "secs, rf\n2.5, 26.7\n5.0, 23.0\n8.2, 21.1\n", [0.0, 2.5, 5.7], "rf [1]", [26.7, 23.0, 21.1]),
    "more lines above than rows": (
        ".csv", lines(30, lambda k: f"Field {k}:,{k}") + "time [s],step,a [V],b [A],c [W]\n"
        + lines(5, lambda k: f"{k},Idle,{2 * k},{3 * k},{4 * k}"), range(5), "c [W]", [0.0, 4.0, 8.0, 12.0, 16.0]),
    "settings that name a time": (
        ".DTA", "EXPLAIN\nDELAY\tTime(s)\tStab\n\nPt\tT\tVf\n#\ts\tV\n"
        + lines(6, lambda k: f"{k}\t{0.5 * k}\t{2.0 * k}"), [0.5 * k for k in range(6)], "Vf [V]", NINE[:6]),
    "a quoted hint of the separator and no units": (
        ".csv", '"sep=\t"\nUnix_CAL\tPPG\t\nms\tno_units\t\n' + lines(4, lambda k: f"{1.5e12 + 2 * k}\t{2 * k}\t"),
        [0.0, 0.002, 0.004, 0.006], "PPG [1]", NINE[:4]),
    "letters of a complex number": (
        ".z", "Time(Sec)\tZ'(a)\n1.0\t5\n2.0\t7\n", [0.0, 1.0], "Z'(a) [1]", [5.0, 7.0]),
    "a row of units that holds what is none": (
        ".csv", ALARMS + lines(30, lambda k: f"{k + 1},2026/11/28 10:11:{12 + k // 10},{100 * k % 1000},+{0.5 * k},"
                               f"+{2 * k},LLLL"),
        [0.1 * k for k in range(30)], "CH2 [bar]", [2.0 * k for k in range(30)]),
    "a sentence with commas where units may stand": (
        ".csv", "version=1,,,\nUnits are S.I. units (second, meters, Newtons, ...)\nendheader,,,\ntime,tilt,list,tx\n"
        + lines(9, lambda k: f"{k},{k},{3 * k},{2 * k}"), range(9), "tx [1]", NINE),
    **{f"a spreadsheet of LabVIEW called {ending}": (
        ending, "X_Value\tu\ty\n" + lines(9, lambda k: f"{k}\t{k % 7}\t{2 * k}"), range(9), "y [1]", NINE)
       for ending in (".lvm", ".xls")},
    "thousands that are no decimals": (
        ".txt", "time [s]\tcommand [%]\tcount\n" + lines(60, lambda k: f"{0.004 * k:.3f}\t{k % 7}\t{1000 + 37 * k:,}"),
        [0.004 * k for k in range(60)], "count [1]", [1000.0 + 37 * k for k in range(60)]),
    "a day that never changes": (
        ".csv", "Date,u [V],Elapsed [s],y [bar]\n" + lines(9, lambda k: f"2026-11-28,{k % 7},{0.1 * k:.1f},{2 * k}"),
        [0.1 * k for k in range(9)], "y [bar]", NINE),
    "a stamp that names UTC": (
        ".csv", "Time,y [bar]\n" + lines(9, lambda k: f"2026-11-28 10:11:{k:02d}.5 UTC,{2 * k}"),
        range(9), "y [bar]", NINE),
    **{f"{end!r} at the end": (
        ".csv", "time [s],y [bar]\n" + lines(9, lambda k: f"{k},{2 * k}") + end, range(9), "y [bar]", NINE)
       for end in ("EOF\n", "\x1a")},
}  # fmt: skip


@pytest.mark.parametrize("kind", TABLES)
def test_a_text_is_read_as_its_program_means_it(kind, read_text):
    ending, text, time_s, heading, values = TABLES[kind]
    found = read_text(text, name=f"x{ending}")
    *_, last = found.channels.values()
    assert (last.heading, last.values.tolist()) == (heading, values)
    assert found.time_s - found.time_s[0] == pytest.approx(list(time_s), abs=1e-6)


class TestTexts:
    """Text tables as programs write them, under any ending."""

    def test_a_table_over_a_frequency_asks_which_parts_it_holds(self, tmp_path):
        (tmp_path / "x.txt").write_text("Frequency\tZre\tZimg\n0.1\t4.0\t-1.0\n0.2\t3.0\t-2.0\n0.4\t2.0\t-2.5\n")
        with pytest.raises(FileError, match="a table over a frequency, with Zre, Zimg; say which of them are real"):
            read_any(tmp_path / "x.txt")
        reading = Reading(renamed={"Zre": "re", "Zimg": "im"}, units={"Frequency": "Hz"})
        assert read_any(tmp_path / "x.txt", reading).response[0] == 4.0 - 1.0j

    def test_an_example_of_many_names_is_short(self, read_text):
        with pytest.raises(FileError, match="name the 400 columns") as caught:
            read_text(lines(4, lambda k: ",".join(f"{k + 0.5 * i}" for i in range(400))))
        assert len(str(caught.value)) < 300

    def test_fields_of_a_time_series_database_are_channels(self, read_text):
        above = "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string\n"
        rows = [
            f",,{n},2026-11-28T10:00:00Z,2026-11-28T11:00:00Z,2026-11-28T10:11:{12 + k}Z,{k + 100 * n},{name}\n"
            for n, name in enumerate(("command", "flow")) for k in range(20)
        ]  # fmt: skip
        found = read_text(f"{above},result,table,_start,_stop,_time,_value,_field\n{''.join(rows)}")
        assert found.time_s.tolist() == list(range(20))
        assert found.values("flow").tolist() == [100.0 + k for k in range(20)]

    @pytest.mark.parametrize("heading", ["T", "T_oil", "clock"])
    def test_what_only_sounds_like_a_time_is_a_signal(self, heading, read_text):
        values = [k % 2 if heading == "clock" else 40.0 + 0.5 * k for k in range(30)]
        rows = "".join(f"{0.1 * k:.1f},{k % 7},{value},{2 * k}\n" for k, value in enumerate(values))
        found = read_text(f"t,u,{heading},y\n{rows}")
        assert found.values(heading).tolist() == values and not found.own
        assert found.time_s == pytest.approx(0.1 * np.arange(30))

    def test_samples_of_another_form_above_are_not_dropped(self, read_text):
        rows = "".join(f"{k} {k % 7} {2 * k}{' 9' if k < 5 else ''}\n" for k in range(60))
        with pytest.raises(FileError, match="line 5 has 4 values, those below 3"):
            read_text(rows, Reading(columns=("time", "u", "y")))


class TestMcap:
    def test_topics_in_json_are_tables_and_others_are_named(self, tmp_path):
        mcap = pytest.importorskip("mcap.writer")
        with (tmp_path / "x.mcap").open("wb") as file:
            writer = mcap.Writer(file)
            writer.start()
            topics = {name: writer.register_channel(name, kind, 0) for name, kind in
                      (("/valve", "json"), ("/camera", "cdr"))}  # fmt: skip
            for k in range(40):
                stamp_ns = 1_700_000_000_000_000_000 + 10_000_000 * k
                fields = {"spool": {"position": 0.5 * k, "limits": [k, -k]}, "state": "on"}
                writer.add_message(topics["/valve"], stamp_ns, json.dumps(fields).encode(), stamp_ns)
                writer.add_message(topics["/camera"], stamp_ns, b"\x00\x01", stamp_ns)
            writer.finish()
        found = read_recording(tmp_path / "x.mcap")
        assert list(found.channels) == ["spool.position", "spool.limits.0", "spool.limits.1"]
        np.testing.assert_allclose(found.time_s, 0.01 * np.arange(40), atol=1e-9)
        np.testing.assert_array_equal(found.values("spool.position"), 0.5 * np.arange(40))
        assert any("not JSON are left out: /camera" in str(note) for note in found.meta["assumed"])

    def test_a_log_without_json_names_its_topics(self, tmp_path):
        mcap = pytest.importorskip("mcap.writer")
        with (tmp_path / "x.mcap").open("wb") as file:
            writer = mcap.Writer(file)
            writer.start()
            writer.add_message(writer.register_channel("/imu", "cdr", 0), 1, b"\x00", 1)
            writer.finish()
        with pytest.raises(
            FileError, match=r"x.mcap: has no messages in JSON, which are read; its topics: /imu \(cdr\)"
        ):
            read_recording(tmp_path / "x.mcap")

    def test_viewers_find_stamps_of_the_calendar_and_units(self, tmp_path):
        mcap = pytest.importorskip("mcap.reader")
        made = recording("run", np.array([-0.5, 0.0, 0.5]), {"flow [l/min]": np.arange(3.0)},
                         {"started_utc": "2026-11-28T10:00:00+00:00"})  # fmt: skip
        write_recording(made, tmp_path / "x.mcap")
        with (tmp_path / "x.mcap").open("rb") as file:
            messages = list(mcap.make_reader(file).iter_messages())
        began_ns = round(datetime.fromisoformat("2026-11-28T10:00:00+00:00").timestamp() * 1e9)
        assert [message.log_time - began_ns for _, _, message in messages] == [0, 500_000_000, 1_000_000_000]
        assert json.loads(messages[0][0].data)["properties"]["flow"]["unit"] == "l/min"
        assert json.loads(messages[2][2].data) == {"time": 0.5, "flow": 2.0}


def modelica(path: Path, transposed: bool, kind: str = "Atrajectory") -> Path:
    """A result as Dymola and OpenModelica lay it out: constants in `data_1`, what changes in `data_2`."""
    names = ["time", "mass", "tank.level", "flow", "x[1]", "x[2]"]
    texts = ["Time in [s]", "[kg]", "Level [m|mm]", "Flow out of it [m3/s] :#(type=Real)", "", ""]
    info = np.array([[0, 1, 0, -1], [1, 2, 0, 0], [2, 2, 0, -1], [2, -2, 0, -1], [2, 3, 0, -1], [2, 4, 0, -1]])
    time_s = np.array([0.0, 1.0, 2.0, 2.0, 3.0])  # the model jumps at 2 s
    data = np.array([time_s, 10.0 * time_s, [0.0, 0.0, 0.0, 5.0, 5.0], -time_s])
    constant = np.array([[0.0, 3.0], [80.0, 80.0]])

    def characters(rows: list[str]) -> np.ndarray:
        wide = max(map(len, rows))
        return np.array([row.ljust(wide) for row in rows])

    def turned(rows: list[str]) -> np.ndarray:
        return characters(["".join(row) for row in zip(*characters(rows), strict=True)] if transposed else rows)

    content = {
        "Aclass": characters([kind, "1.1", "", "binTrans" if transposed else "binNormal"]),
        "name": turned(names), "description": turned(texts),
        "dataInfo": info.T if transposed else info,
        "data_1": constant if transposed else constant.T, "data_2": data if transposed else data.T,
    }  # fmt: skip
    savemat(path, content, format="4")
    return path


class TestModelica:
    @pytest.mark.parametrize("transposed", [True, False])
    def test_variables_have_names_units_and_signs(self, tmp_path, transposed):
        found = read_recording(modelica(tmp_path / "x.mat", transposed))
        assert [c.heading for c in found.channels.values()] == ["tank.level [m]", "flow [m3/s]", "x[1] [1]", "x[2] [1]"]
        assert found.time_s.tolist() == [0.0, 1.0, 2.0, 3.0]
        assert found.values("tank.level").tolist() == [0.0, 10.0, 20.0, 30.0]
        assert found.values("flow").tolist() == [0.0, -10.0, -20.0, -30.0]
        assert found.values("x[1]").tolist() == [0.0, 0.0, 5.0, 5.0]
        said = " ".join(map(str, found.meta["assumed"]))
        assert "no unit is stated for 2 of 4 variables" in said
        assert "1 rows before a jump" in said

    def test_another_kind_of_result_is_named(self, tmp_path):
        with pytest.raises(FileError, match=r"x.mat: is a file of AlinearSystem 1.1; results of a simulation"):
            read_recording(modelica(tmp_path / "x.mat", True, "AlinearSystem"))
