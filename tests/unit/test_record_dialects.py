"""Text files as loggers, scopes and spreadsheets write them: read with the same numbers, or refused with what helps."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.reading import Reading
from hil.record.recording import Recording
from hil.record.table.missing_values import is_stand_in

COUNT, INTERVAL_S = 80, 0.025
TIME_S = INTERVAL_S * np.arange(COUNT)
COMMAND = np.round(30.0 * np.sin(3.0 * TIME_S) - 5.0, 2)
FLOW = np.round(0.7 * COMMAND + 0.1 * np.cos(40.0 * TIME_S), 3)

Row = Callable[[float, float, float], str]


def text(head: str, row: Row) -> str:
    values = zip(TIME_S.tolist(), COMMAND.tolist(), FLOW.tolist(), strict=True)
    return head + "".join(row(*one) + "\n" for one in values)


def comma(t: float, u: float, y: float) -> str:
    return f"{t:.3f},{u},{y}"


def semicolon(t: float, u: float, y: float) -> str:
    return f"{t:.3f};{u};{y}"


def is_as_written(found: Recording, time_s: np.ndarray = TIME_S, flow: np.ndarray = FLOW) -> None:
    flow_samples = found.samples("flow")
    assert flow_samples.time_s - flow_samples.time_s[0] == pytest.approx(time_s - time_s[0], abs=2e-5)
    assert found.values("flow", "l/min") == pytest.approx(flow, abs=1e-9)
    assert found.values("command", "%")[0] == pytest.approx(COMMAND[0])


def clock(t: float, mark: str) -> str:
    seconds = 86_399.0 + t
    whole = int(seconds + 1e-9)
    return f"{whole // 3600 % 24:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}{mark}{round(1e3 * (seconds - whole)):03d}"


def dated(t: float) -> str:
    return f"{46_023 + t / 86_400:.12f}"


HEADINGS = {
    "after a slash": ("t/s;command/%;flow/(l/min)\n", semicolon),
    "after a colon": ("time: s;command: %;flow: l/min\n", semicolon),
    "after a dash": ("time - s,command - %,flow - l/min\n", comma),
    "after a blank": ("Time s,command %,flow l/min\n", comma),
    "in curly brackets": ("time {s},command {%},flow {l/min}\n", comma),
    "in angle brackets": ("time <s>,command <%>,flow <l/min>\n", comma),
    "capitals in a row": ("Time,command,flow\nSEC,PERCENT,L/MIN\n", comma),
    "powers in a row": ("Time,command,flow\nSek.,Prozent,l min-1\n", comma),
    "a row above the names": ("s,%,l/min\nTime,command,flow\n", comma),
    "behind a remark's sign": ("# rig 7\n#time [s],command [%],flow [l/min]\n", comma),
    "in quotes behind blanks": ('"time [s]", "command [%]", "flow [l/min]"\n',
                                lambda *values: comma(*values).replace(",", ", ")),
    "below empty lines": ("\n\n\ntime [s],command [%],flow [l/min]\n", comma),
    "behind each number": ("time,command,flow\n", lambda t, u, y: f"{t:.3f} s,{u} %,{y} l/min"),
}  # fmt: skip


@pytest.mark.parametrize("style", HEADINGS)
def test_units_are_read_however_they_stand_in_headings(read_text, style):
    is_as_written(read_text(text(*HEADINGS[style])))


def test_a_name_that_ends_like_a_unit_is_no_unit_where_others_have_brackets(read_text):
    found = read_text(text("time [s],command [%],Sensor A\n", comma))
    assert list(found.channels) == ["command", "Sensor A"]


TIMES = {
    "a column of milliseconds beside a clock": ("Time,ms,command [%],flow [l/min]\n", lambda t, u, y:
                                                f"{clock(t, ',')},{u},{y}"),
    "parts of a second behind a colon": ("Time,command [%],flow [l/min]\n", lambda t, u, y: f"{clock(t, ':')},{u},{y}"),
    "days of a spreadsheet": ("time,command [%],flow [l/min]\n", lambda t, u, y: f"{dated(t)},{u},{y}"),
    "months by name": ("Date,command [%],flow [l/min]\n", lambda t, u, y: f"01-Jan-2026 10:00:0{t:.3f},{u},{y}"),
    "known by its unit": ("X [s],command [%],flow [l/min]\n", comma),
    "a compound word": ("SimTime,command [%],flow [l/min]\n", comma),
    "another language's second": ("Laufzeit [Sek.],command [%],flow [l/min]\n", comma),
}  # fmt: skip


@pytest.mark.parametrize("kind", TIMES)
def test_the_time_is_found_however_it_is_written(read_text, kind):
    is_as_written(read_text(text(*TIMES[kind])))


def test_two_columns_of_time_without_the_name_time_each_keep_their_samples(read_text):
    """The second was taken for a channel, and the flow cut to the samples of the slower command."""
    rows = [
        f"{TIME_S[4 * i]:.3f};{COMMAND[4 * i]};{TIME_S[i]:.3f};{FLOW[i]}" if 4 * i < COUNT
        else f";;{TIME_S[i]:.3f};{FLOW[i]}" for i in range(COUNT)
    ]  # fmt: skip
    found = read_text("\n".join(["t_cmd [s];command [%];t_flow [s];flow [l/min]", *rows]))
    is_as_written(found)
    assert found.samples("command").values.tolist() == COMMAND[::4].tolist()
    turned = [
        ";".join((*row.split(";")[2:], *row.split(";")[:2])) for row in rows
    ]  # the slower one last, in a row of units
    found = read_text("\n".join(["time;flow;time;command", "s;l/min;s;%", *turned]))
    is_as_written(found)
    assert found.samples("command").values.tolist() == COMMAND[::4].tolist()


NUMBERS = {
    "decimal commas in quotes": lambda t, u, y: ",".join(f'"{v}"'.replace(".", ",") for v in (f"{t:.3f}", u, y)),
    "decimal commas in quotes beside points": lambda t, u, y: f"{t:.3f}," + f'"{u}","{y}"'.replace(".", ","),
    "a typographic minus": lambda *values: comma(*values).replace("-", "\u2212"),
    "exponents after D": lambda t, u, y: f"{t:.6e},{u:.6e},{y:.6e}".replace("e", "D"),
}  # fmt: skip


@pytest.mark.parametrize("kind", NUMBERS)
def test_numbers_are_read_however_they_are_written(read_text, kind):
    is_as_written(read_text(text('"time [s]","command [%]","flow [l/min]"\n', NUMBERS[kind])))


@pytest.mark.parametrize("mark", ["'", "\u2019", "\u00a0", ","])
def test_thousands_are_read_whatever_stands_between_them(read_text, mark):
    rows = text("time [s];command [%];flow [ml/min]\n",
                lambda t, u, y: f"{t:.3f};{u};{f'{1e3 * y:,.1f}'.replace(',', mark)}")  # fmt: skip
    is_as_written(read_text(rows))


HEAD = "time [s],command [%],flow [l/min]\n"


def test_a_reading_at_the_end_of_its_range_is_no_number_that_loggers_write():
    assert [is_stand_in(value) for value in (math.inf, -math.inf, math.nan, 1000.0, 99.9)] == [False] * 5
    assert all(map(is_stand_in, (999.0, -9999.0, 9999.99, -999.25, 99999999.0, 9.91e37)))


@pytest.mark.parametrize("token", ["---", "OL", "#VALUE!", "Bad", "1.#INF", "inf", "-9999", "99999999", "9.91e37"])
def test_what_stands_for_no_value_is_refused_by_line_and_left_out_with_gaps(read_text, token):
    rows = text(HEAD, comma).splitlines()
    for line in (17, 40):
        rows[line] = rows[line].rpartition(",")[0] + f",{token}"
    content = "\n".join(rows)
    with pytest.raises(FileError, match=r"line 18, .*flow.*--gaps"):
        read_text(content)
    found = read_text(content, Reading(gaps=True))
    kept = np.delete(np.arange(COUNT), [16, 39])
    assert found.samples("flow").time_s == pytest.approx(TIME_S[kept])
    assert found.samples("flow").values == pytest.approx(FLOW[kept])
    assert any("flow" in sentence and "2 of 80 rows" in sentence for sentence in found.meta["assumed"])


def test_a_large_number_among_states_is_a_state(read_text):
    rows = text("time [s],command [%],flow [l/min],fault\n", lambda t, u, y: f"{comma(t, u, y)},{9999 * (t > 1.0):g}")
    assert read_text(rows).values("fault").max() == 9999.0


def test_a_stamp_that_repeats_is_refused_and_left_out_with_gaps(read_text):
    rows = text(HEAD, comma).splitlines()
    rows.insert(30, rows[29])
    with pytest.raises(FileError, match=r"line 31: .* 1 of 81 samples have the stamp of the one before; --gaps"):
        read_text("\n".join(rows))
    is_as_written(read_text("\n".join(rows), Reading(gaps=True)))


def test_rows_from_the_newest_to_the_oldest_are_turned_round_and_their_lines_named(read_text):
    rows = text(HEAD, comma).splitlines()
    found = read_text("\n".join([rows[0], *rows[:0:-1]]))
    is_as_written(found)
    assert any("newest" in sentence for sentence in found.meta["assumed"])
    rows[2] = rows[2].rpartition(",")[0] + ","  # the second oldest, so the line before the last
    with pytest.raises(FileError, match=r"line 80, channel 'flow': no value"):
        read_text("\n".join([rows[0], *rows[:0:-1]]))


def segment(first: int, count: int, clock_text: str, start_s: float, names: str = "command\tflow") -> str:
    head = (
        f"Channels\t2\t\t\nSamples\t{count}\t{count}\t\nDate\t2026/01/01\t2026/01/01\t\nTime\t{clock_text}\t{clock_text}"
        f"\t\nY_Unit_Label\t%\tl/min\t\nX0\t{start_s}\t{start_s}\t\nDelta_X\t0.01\t0.01\t\n***End_of_Header***\t\t\t\n"
        f"X_Value\t{names}\tComment\n"
    )
    return head + "".join(f"{start_s + 0.01 * k:.2f}\t{first + k}\t{0.5 * k}\n" for k in range(count))


LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\nMulti_Headings\tYes\nX_Columns\tOne\nDate\t2026/01/01\nTime\t10:00:00.0\n"
    "***End_of_Header***\t\n\t\n"
)


@pytest.mark.parametrize(("clock_text", "start_s"), [("10:00:00.5", 0.0), ("10:00:00.0", 0.5)])
def test_segments_of_an_lvm_stand_at_their_times(read_text, clock_text, start_s):
    content = f"{LVM}{segment(0, 20, '10:00:00.0', 0.0)}\n{segment(20, 10, clock_text, start_s)}"
    found = read_text(content, name="x.lvm")
    assert found.values("command", "%").tolist() == list(range(30))
    assert found.time_s == pytest.approx(np.concatenate((0.01 * np.arange(20), 0.5 + 0.01 * np.arange(10))))
    assert found.meta["assumed"] == ["2 segments joined at their times"]


def test_segments_of_an_lvm_that_cannot_be_joined_are_said(read_text):
    content = (
        f"{LVM}{segment(0, 20, '10:00:00.0', 0.0)}\n{segment(20, 10, '10:00:01.0', 0.0, names='a' + chr(9) + 'b')}"
    )
    found = read_text(content, name="x.lvm")
    assert len(found) == 20
    assert found.meta["assumed"] == ["only the first of 2 recordings in the file is read"]


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("\t7\t3.5\n", r"sample 7, channel 'flow': no value \(1 such of 20\); with --gaps"),
        ("\t19\t9.5\n", r"line \d+: 'lost' is no number"),  # the last one
    ],
)
def test_a_text_among_the_numbers_of_an_lvm_is_told(read_text, row, says):
    lost = f"{row.rpartition(chr(9))[0]}\tlost\n"
    with pytest.raises(FileError, match=says):
        read_text(LVM + segment(0, 20, "10:00:00.0", 0.0).replace(row, lost), name="x.lvm")


CURRENT = "time (s),{},flow (l/min)\n"


@pytest.fixture
def powers(read_text):
    """What a column of such cells reads."""

    def read(heading, cells, reading=None):
        rows = "".join(f"{0.1 * i:.1f},{cell},{i}.5\n" for i, cell in enumerate(cells.split()))
        found = read_text(CURRENT.format(heading) + rows, reading)
        return found.channel(heading.split(" ")[0]).values.tolist()

    return read


def test_letters_behind_numbers_are_powers_of_ten(powers):
    assert powers("current (mA)", "25.1m 1.2 959.5n 1k 3") == [0.0251, 1.2, 959.5e-9, 1000.0, 3.0]
    assert powers("u", "25.1m 1.2 2k 1M 3") == [0.0251, 1.2, 2000.0, 1e6, 3.0]
    assert powers("x (m)", "25.1m 26.0m 27m") == [25.1, 26.0, 27.0], "the unit once more"


def test_an_m_without_a_unit_is_asked_about(powers):
    with pytest.raises(FileError, match="milli, metre or minute; say its unit"):
        powers("x", "25.1m 26m 27m")
    assert powers("x", "25.1m 26m 1", Reading(units={"x": "A"})) == [0.0251, 0.026, 1.0]
    assert powers("x", "25.1m 26m 27m", Reading(units={"x": "mm"})) == [0.0251, 0.026, 0.027]
    assert powers("x", "25.1m 26m 1", Reading(units={"x": "m"})) == [25.1, 26.0, 1.0]


def test_a_letter_after_a_blank_is_a_power_of_ten_where_it_is_no_unit_of_the_heading(read_text):
    def read(heading, behind):
        rows = "".join(f"{0.1 * i:.1f},{2.5 + i} {behind},{i}.5\n" for i in range(5))
        channel = read_text(CURRENT.format(heading) + rows).channel("p")
        return channel.values[0], channel.unit

    assert read("p (Pa)", "k") == (2500.0, "Pa")
    assert read("p (V)", "m") == (0.0025, "V")
    assert read("p", "m") == (2.5, "m")
    assert read("p (l/min)", "L/min") == (2.5, "l/min")


@pytest.mark.parametrize(("said", "behind"), [("Pa", "kPa"), ("mA", "A"), ("degC", "K")])
@pytest.mark.parametrize("blank", ["", " "])
def test_another_unit_behind_the_numbers_than_in_the_heading_is_asked_about(read_text, said, behind, blank):
    rows = "".join(f"{0.1 * i:.1f},{2.5 + i}{blank}{behind},{i}.5\n" for i in range(5))
    content = CURRENT.format(f"p ({said})") + rows
    with pytest.raises(FileError, match=f"its heading says '{said}', behind its numbers stands '{behind}'"):
        read_text(content)
    channel = read_text(content, Reading(units={"p": behind})).channel("p")
    assert (channel.values[0], channel.unit) == (2.5, behind)


def test_a_unit_behind_some_numbers_is_refused_with_its_place(powers):
    with pytest.raises(FileError, match=r"line 2, column 2 \('x'\): '2bar' is not a number"):
        powers("x", "2bar 3 4 5 6")


def test_a_short_list_beside_the_samples_is_left_out(read_text):
    head, *rows = text("time (s),command (%),flow (l/min),F names,F values\n", comma).splitlines()
    listed = [f"{row},Var {i},{i}.25" if i < 9 else f"{row},," for i, row in enumerate(rows)]
    found = read_text("\n".join([head, *listed]))
    is_as_written(found)
    assert list(found.channels) == ["command", "flow"]
    assert "left out, 9 samples beside 80 of command: F values" in found.meta["assumed"]


def test_texts_where_numbers_begin_are_refused_with_their_place(read_text):
    head, *rows = text("time (s),command,flow\n", comma).splitlines()
    late = [f"{row.rpartition(',')[0]},OFF" if i < 9 else row for i, row in enumerate(rows)]
    with pytest.raises(FileError, match=r"line 2, column 3 \('flow'\): 'OFF' is not a number"):
        read_text("\n".join([head, *late]))
    assert len(read_text("\n".join([head, *late]), Reading(gaps=True)).samples("flow").time_s) == COUNT - 9


@pytest.mark.parametrize(
    ("head", "row", "time"),
    [
        ("% Robot (25)\n% 1 time 0.025\n", lambda t, u, y: f"{t:.3f} {u} {y}", "time [s]"),  # a remark
        ("", lambda t, u, y: f"2025-06-05,{clock(t - 80_000.0, '.')},{u},{y}", "time"),  # a day and a time: one column
    ],
)
def test_columns_without_headings_are_asked_for(read_text, head, row, time):
    with pytest.raises(FileError, match="name the 3 columns with --columns"):
        read_text(text(head, row), name="x.txt")
    named = Reading(columns=(time, "command [%]", "flow [l/min]"))
    is_as_written(read_text(text(head, row), named, name="x.txt"))


def test_units_of_toa5_stand_though_cells_between_them_are_blank(read_text):
    head = (
        '"TOA5","x"\n"TIMESTAMP","RECORD","battery","PTemp","note"\n"TS","RN","Volts","oC",""\n"","","Min","Smp",""\n'
    )
    found = read_text(head + "".join(f'\n"2021-06-19 00:00:{i:02d}",{i},12.9{i},20.{i},' for i in range(9)))
    assert {name: one.unit for name, one in found.channels.items()} == {"battery": "Volts", "PTemp": "oC"}


@pytest.mark.parametrize(
    ("head", "rule", "mark"),
    [
        ("| time [s] | u [V] |", "|----------|-------|", "| {} | {} |"),
        (" time [s] | u [V] ", "----------+-------", " {} | {}"),
        ("time u", "==== ====", "{} {}"),
    ],
)
def test_the_rule_of_a_printed_table_is_no_row_of_units(read_text, head, rule, mark):
    rows = "".join(mark.format(k, 2 * k) + "\n" for k in range(5))
    assert read_text(f"{head}\n{rule}\n{rows}", name="x.txt").values("u").tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]


@pytest.mark.parametrize(
    ("encoding", "names", "is_said"),
    [
        ("shift_jis", "圧力,流量", True), ("gb18030", "压力,流量", True), ("cp1251", "Давление,Расход", True),
        ("cp1252", "Überdruck °C,Durchfluß µm²", False), ("utf-8", "圧力,流量", False),
    ],
)  # fmt: skip
def test_headings_in_another_encoding_are_said_to_look_wrong(read_text, encoding, names, is_said):
    text = f"time [s],{names}\n" + "".join(f"{k},{2 * k},{3 * k}\n" for k in range(5))
    found = read_text(text.encode(encoding))
    assert any("neither UTF-8 nor Western" in note for note in found.meta.get("assumed", ())) is is_said
    named = read_text(text.encode(encoding), Reading(columns=("time", "p", "q")))
    assert list(named.channels) == ["p", "q"] and not any("UTF-8" in note for note in named.meta.get("assumed", ()))
