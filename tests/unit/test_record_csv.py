"""CSV: the contract's format, the dialects of spreadsheets, and errors that name line and column."""

import gzip

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_recording, write_recording
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.table.frame import from_memory

PLAIN = "time [s],command [%],flow [l/min]\n0,1.5,10\n0.011,2.5,-20\n0.02,3.5,30.25\n"
FRAMES = "".join(f"10:11:{k // 25:02d}:{k % 25:02d},{k}\n" for k in range(60))  # of a film, behind seconds


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
def test_every_dialect_says_the_same(read_text, text):
    found = read_text(text)
    assert found.time_s == pytest.approx([0, 0.011, 0.02])
    assert list(found.channels) == ["command", "flow"]
    assert found.channels["flow"].unit == "l/min"
    assert found.channels["flow"].values.tolist() == [10, -20, 30.25]


def test_a_degree_sign_of_a_western_spreadsheet_is_understood(read_text):
    found = read_text("time [s];oil [°C]\n0;40,5\n1;41\n".encode("cp1252"))
    assert found.channels["oil"].unit == "°C"
    assert found.channels["oil"].values.tolist() == [40.5, 41.0]


def test_a_sample_column_is_an_even_time_base(read_text):
    found = read_text("sample [1],flow [l/min]\n5,1\n6,2\n7,3\n")
    assert found.time_s.tolist() == [0, 1, 2]
    assert any("1 s per sample" in sentence for sentence in found.meta["assumed"])


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
        (b"\x00\x01\x02\x7f" * 100, "bytes that no text has"),
        (PLAIN.encode() + b"\0" * 50, r"line 5 is no row of numbers: '\x00.*--gaps leaves such lines out"),
        (
            "time [s],a [V],b [V]\n0,0x0A,0x1B\n1,0x0C,0x1D\n",
            "no column beside the time holds one number per sample: 'a .V.', 'b .V.'; 'a .V.' begins with '0x0A'; 'b",
        ),
        (
            "time [s],flow [l/min]\n" + "0,1\n" * 20,
            "time must increase. If the samples are evenly spaced, --interval S",
        ),
        (PLAIN.replace("2.5", "-1e308"), r"line 3, channel 'command \[%\]': -1e\+308 is beyond ±1e\+150"),
        (PLAIN.replace("0.02,", "1e300,"), r"line 4, channel 'time': 1e\+300 is beyond ±1e\+150"),
        (PLAIN.replace("0.011,", "1e-300,"), "line 3: time 1e-300 s does not come after 0 s"),
        ("time [s],a [V],b [V],c [V]\n0,1,2\n1,2,3\n", "line 2 has 3 values, the header names 4 columns"),
        (
            "Time,u [V],y [V]\n" + "".join(f"14 Lenz 2026 10:11:{k:02d},{k},{2 * k}\n" for k in range(30)),
            "'Time' is called a time, but '14 Lenz 2026 10:11:00' is no number, date",
        ),
        ("Time,y [V]\n" + FRAMES, "is no date or time of the day"),
        ("Time,y [V]\n" + FRAMES.replace("10:", "2026-11-28 10:"), "is no date or time of the day"),
        ("9.16,0.24\n9.18,0.21\n9.20,0.19\n", "as in (--columns|columns=).*time,flow"),
    ],
)
def test_errors_name_the_place(read_text, text, message):
    with pytest.raises(FileError, match=rf"x.csv: .*({message})"):
        read_text(text)


def test_a_broken_archive_is_named(read_text):
    with pytest.raises(FileError, match=r"x.csv.gz: cannot be unpacked"):
        read_text(gzip.compress(PLAIN.encode())[:-9], name="x.csv.gz")


SOME = "time [s],flow [l/min]\n" + "".join(f"{0.1 * i:.1f},{i}.5\n" for i in range(40))


@pytest.mark.parametrize("name", ["x.csv", "x.csv.gz"])
@pytest.mark.parametrize("packed", [False, True])
def test_a_file_is_unpacked_where_its_bytes_say_so_whatever_its_name_says(read_text, name, packed):
    assert len(read_text(gzip.compress(SOME.encode()) if packed else SOME, name=name)) == 40


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_wide_texts_are_read_with_and_without_their_mark(read_text, encoding):
    assert read_text(SOME.encode(encoding)).values("flow")[39] == 39.5


TEXTS = [("# range changed", False), ("time [s],flow [l/min]", True), ("stopped", True)]


@pytest.mark.parametrize(("line", "gaps"), TEXTS)
def test_a_line_of_text_among_the_samples_is_left_out_and_said(read_text, line, gaps):
    lines = SOME.splitlines()
    lines.insert(20, line)
    if gaps:
        with pytest.raises(FileError, match=r"line 21 is no row of numbers: .*--gaps leaves such lines out"):
            read_text("\n".join(lines))
    found = read_text("\n".join(lines), Reading(gaps=gaps))
    assert len(found) == 40
    assert any(text.startswith(f"line 21, no row of numbers, left out: '{line}") for text in found.meta["assumed"])


def test_what_is_wrong_behind_a_remark_is_named_by_its_own_line(read_text):
    lines = SOME.splitlines()
    lines[30] = "2.9,"
    lines.insert(20, "# a remark")
    with pytest.raises(FileError, match=r"line 32, channel 'flow': no value"):
        read_text("\n".join(lines))


@pytest.mark.parametrize(("factor", "words"), [(1.0, "s since 1970"), (1e3, "ms since 1970"), (1e9, "ns since 1970")])
def test_stamps_since_1970_are_known_by_their_size(read_text, factor, words):
    rows = "".join(f"{round((1.7e9 + 0.5 * i) * factor) if factor > 1 else 1.7e9 + 0.5 * i},{i}\n" for i in range(20))
    found = read_text("timestamp,flow [l/min]\n" + rows)
    assert found.duration_s == pytest.approx(9.5, abs=1e-6)
    assert any(words in text for text in found.meta["assumed"])


def test_ticks_of_a_device_are_no_seconds(read_text):
    ticks = 112_540_231 + np.cumsum(4000 + np.random.default_rng(0).integers(-30, 30, 40))
    text = "timestamp,flow [l/min]\n" + "".join(f"{t},{t % 7}\n" for t in ticks)
    with pytest.raises(FileError, match=r"'timestamp' has no unit, and its samples lie about [34]\d{3} apart"):
        read_text(text)
    assert read_text(text, Reading(units={"timestamp": "us"})).duration_s == pytest.approx(0.156, abs=0.002)
    hours = read_text("time,flow [l/min]\n" + "".join(f"{3600 * i},{i}\n" for i in range(40)))
    assert hours.duration_s == 39 * 3600.0  # whole hours may well be seconds


def test_rows_out_of_order_are_said_to_be_so(read_text):
    with pytest.raises(FileError, match=r"line 3: time 0.1 s does not come after 0.3 s.*sort them by it$") as told:
        read_text("time [s],flow [l/min]\n0.3,1\n0.1,2\n0.2,3\n0,1\n")
    assert "--interval" not in str(told.value)


@pytest.mark.parametrize("name", ["\x1b]0;a\x07\x1b[2Jflow", "fl\now", "\u202eflow", "AI[0]", "flow]["])
def test_name_of_a_column_is_one_line_that_is_written_and_read(tmp_path, name):
    found = from_memory({"time [s]": np.arange(3.0), f"{name} [l/min]": np.arange(3.0)})
    assert isinstance(found, Recording)
    (channel,) = found.channels.values()
    assert channel.heading.isprintable() and channel.unit == "l/min"
    write_recording(found, tmp_path / "made.csv")
    assert list(read_recording(tmp_path / "made.csv").channels) == [channel.name]
