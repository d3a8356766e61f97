"""CSV: the contract's format, the dialects of spreadsheets, and errors that name line and column."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_recording, write_recording
from hil.record.recording import recording

PLAIN = "time [s],command [%],flow [l/min]\n0,1.5,10\n0.011,2.5,-20\n0.02,3.5,30.25\n"


def read_text(tmp_path: Path, text: str | bytes, name: str = "made.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_recording(path)


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        PLAIN.replace("\n", ",\n"),
        PLAIN.replace("30.25\n", "30.25"),
        PLAIN.replace("0.011", "\n0.011"),
        PLAIN.replace("time [s]", '"time [s]"').replace("10", '"10"'),
        PLAIN.replace("time [s]", "Time [s]"),
        PLAIN.replace(",", ";").replace(".", ","),
        "sep=;\n" + PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";").replace("\n", ";\r\n"),
        PLAIN.encode("utf-16"),
        PLAIN.replace("time [s]", "time [ms]").replace("0.011", "11").replace("0.02", "20"),
    ],
)
def test_every_dialect_says_the_same(tmp_path: Path, text: str | bytes) -> None:
    found = read_text(tmp_path, text)
    assert found.time_s == pytest.approx([0, 0.011, 0.02])
    assert list(found.channels) == ["command", "flow"]
    assert found.channels["flow"].unit == "l/min"
    assert found.channels["flow"].values.tolist() == [10, -20, 30.25]


def test_compressed_is_the_same(tmp_path: Path) -> None:
    assert read_text(tmp_path, gzip.compress(PLAIN.encode()), "made.csv.gz").values("flow").tolist() == [10, -20, 30.25]


def test_a_degree_sign_of_a_western_spreadsheet_is_understood(tmp_path: Path) -> None:
    found = read_text(tmp_path, "time [s];oil [°C]\n0;40,5\n1;41\n".encode("cp1252"))
    assert found.channels["oil"].unit == "°C"
    assert found.channels["oil"].values.tolist() == [40.5, 41.0]


def test_a_name_may_hold_a_separator(tmp_path: Path) -> None:
    made = recording("made", np.array([0.0, 1.0]), {'a; "b", c [V]': np.array([1.0, 2.0])})
    write_recording(made, tmp_path / "made.csv")
    assert list(read_recording(tmp_path / "made.csv").channels) == ['a; "b", c']


def test_a_sample_column_is_an_even_time_base(tmp_path: Path) -> None:
    found = read_text(tmp_path, "sample [1],flow [l/min]\n5,1\n6,2\n7,3\n")
    assert found.time_s.tolist() == [0, 1, 2]
    assert any("1 s per sample" in sentence for sentence in found.meta["assumed"])


def test_stamps_of_a_fast_long_run_stay_apart(tmp_path: Path) -> None:
    time_s = 1e5 + np.arange(1000) / 31_250.0
    write_recording(recording("made", time_s, {"flow [l/min]": time_s}), tmp_path / "made.csv")
    assert np.array_equal(read_recording(tmp_path / "made.csv").time_s, time_s)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("time [s],flow [l/min]\n", "no rows after the header"),
        ("time [s],flow [l/min]\n0,1\n", "1 samples; at least 2 are needed"),
        ("time,flow\n0,1\n", "1 samples; at least 2 are needed"),
        ("time [kg],flow [l/min]\n0,1\n1,2\n", r"time column 'time \[kg\]': unit 'kg' cannot .* --unit 'time=s'"),
        ("a [V],b [V]\n0,1\n1,2\n", "no signal with a time was found, but 'a .V.', 'b .V.'; .* --time .* --interval"),
        (PLAIN.replace("-20", "inf"), r"line 3, channel 'flow \[l/min\]': inf is not a number"),
        (PLAIN.replace("0.02", "\n\n0.011"), r"line 6: time 0.011 s does not come after 0.011 s.* --interval"),
        (PLAIN.replace("-20", "abc"), r"line 3, column 3 \('flow \[l/min\]'\): 'abc' is not a number; .* --columns"),
        (PLAIN.replace("-20", "-20,7"), "line 3 has 4 values, the header names 3 columns"),
        (PLAIN.replace("-20", ""), "line 3, channel 'flow': no value .1 such of 3.; with --gaps .* --columns"),
        (PLAIN.replace("-20", "nan"), "line 3, channel 'flow': no value .1 such of 3.; with --gaps .* --columns"),
        (PLAIN.replace("0.011,2.5,-20", "0.011,2.5"), "line 3 has 2 values, the header names 3 columns; --gaps"),
        (PLAIN.replace(",30.25", ""), "line 4 has 2 values, the header names 3 columns; --gaps"),
        (PLAIN.replace("\n0.02", "\n\n\n0.02").replace("30.25", "x"), "line 6, column 3 .*: 'x' is not a number"),
        ("time [s],flow [l/min]\n0,0,1,5\n1,0,2,5\n", "line 2 has 4 values.*put semicolons between the columns"),
        (b"time [s],flow [l/min]\n0,1\n1,\xff\n", "line 3, column 2 .* is not a number"),
        ("1;2\n3;4\n", "the columns have no headings; name the 2 columns with --columns.*--interval"),
        ("hello\nworld\n", "no rows of numbers were found"),
    ],
)
def test_errors_name_the_place(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(FileError, match=rf"made.csv: .*({message})"):
        read_text(tmp_path, text)


def test_a_broken_archive_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"made.csv.gz: cannot be read as CSV"):
        read_text(tmp_path, gzip.compress(PLAIN.encode())[:-9], "made.csv.gz")
