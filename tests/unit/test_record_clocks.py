"""Times that step although the samples did not, and times that contradict each other: read right, or refused."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_recording
from hil.record.reading import Reading

STEP_S, COUNT = 0.05, 120


@pytest.fixture
def read(read_text):
    """What is read of samples with these stamps."""

    def stamped(heading, stamps, reading=None):
        rows = "".join(f"{stamp},{i % 7},{i % 5}.5\n" for i, stamp in enumerate(stamps))
        return read_text(f"{heading},u (V),y (V)\n{rows}", reading)

    return stamped


def local(start: datetime, hour_at: int, hours: int) -> list[str]:
    """Stamps whose clock is put so many hours on from a sample on."""
    shown = [start + timedelta(seconds=STEP_S * i, hours=hours if i >= hour_at else 0) for i in range(COUNT)]
    return [f"{moment:%Y-%m-%d %H:%M:%S.%f}" for moment in shown]


@pytest.mark.parametrize(
    ("start", "hours", "said"),
    [(datetime(2025, 3, 30, 1, 59, 58), 1, "an hour forward"), (datetime(2026, 10, 25, 2, 59, 58), -1, "an hour back")],
)
def test_the_hour_of_changed_clocks_is_taken_out_and_said(start, hours, said, read):
    found = read("Timestamp", local(start, 40, hours))
    assert found.time_s == pytest.approx(STEP_S * np.arange(COUNT))
    assert said in " ".join(found.meta["assumed"])


def test_an_hour_without_samples_on_another_day_stays(read):
    found = read("Timestamp", local(datetime(2025, 3, 31, 1, 59, 58), 40, 1))
    assert found.time_s[-1] == pytest.approx(3600.0 + STEP_S * (COUNT - 1))


@pytest.mark.parametrize("bits", [16, 32])
def test_a_counter_that_rolls_over_goes_on(bits, read):
    counts = [(2**bits - 2000 + 50 * i) % 2**bits for i in range(COUNT)]
    found = read("time (ms)", [str(count) for count in counts])
    assert found.time_s - found.time_s[0] == pytest.approx(STEP_S * np.arange(COUNT))
    assert f"{bits} bits" in " ".join(found.meta["assumed"])


def test_a_time_that_goes_back_otherwise_is_refused(read):
    with pytest.raises(FileError, match="does not come after"):
        read("time (ms)", [str(50 * (i % 60)) for i in range(COUNT)])


def contradicting() -> tuple[str, list[str]]:
    """Milliseconds under the heading of seconds, beside stamps."""
    moments = [datetime(2025, 6, 5, 9) + timedelta(seconds=STEP_S * i) for i in range(COUNT)]
    return "Test_Time (s),DateTime", [f"{50 * i},{moment:%Y-%m-%d %H:%M:%S.%f}" for i, moment in enumerate(moments)]


def test_two_clocks_of_different_units_are_refused_until_somebody_says(read):
    heading, stamps = contradicting()
    with pytest.raises(FileError, match=r"took 5950 s.* 5.95 s; --time DateTime .*--unit 'Test_Time=UNIT'"):
        read(heading, stamps)
    for reading in (Reading(time="DateTime"), Reading(units={"Test_Time": "ms"})):
        assert read(heading, stamps, reading).duration_s == pytest.approx(5.95)


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S"])
def test_a_midnight_tells_which_number_is_the_month(read, form):
    start = datetime(2024, 6, 5, 23, 59, 55)
    stamps = [f"{start + timedelta(seconds=i):{form}}" for i in range(20)]
    assert read("DateTime", stamps).duration_s == 19.0


def test_two_clocks_without_a_sample_are_a_file_without_one(tmp_path):
    pandas = pytest.importorskip("pandas")
    empty = {"Test_Time [s]": np.zeros(0), "DateTime": np.zeros(0, dtype="M8[ns]"), "u [V]": np.zeros(0)}
    pandas.DataFrame(empty).to_parquet(tmp_path / "x.parquet")
    with pytest.raises(FileError, match="no rows"):
        read_recording(tmp_path / "x.parquet")


def test_stamps_that_are_shown_to_the_minute_contradict_nothing(read):
    start = datetime(2025, 6, 5, 9, 0, 57)
    moments = [start + timedelta(seconds=STEP_S * i) for i in range(COUNT)]
    stamps = [f"{STEP_S * i:.2f},{moment:%Y-%m-%d %H:%M}" for i, moment in enumerate(moments)]
    assert read("Test_Time (s),DateTime", stamps).duration_s == pytest.approx(STEP_S * (COUNT - 1))


@pytest.mark.parametrize(
    ("heading", "start", "form"),
    [
        ("Time", "2026-11-28T23:59:58", '"%H.%M.%S,%f"'),
        ("Time", "2026-11-28T10:59:58", "%M:%S.%f"),
        ("Time", "2026-11-28T23:59:58", "0 days %H:%M:%S.%f"),
        ("Time", "2026-11-28T10:11:12", "%Y-%m-%d-%H.%M.%S.%f"),
        ("Time", "2026-11-28T10:11:12", "%Y-%m-%d_%H:%M:%S.%f"),
        ("Time", "2026-11-28T10:11:12", "%d.%m.%Y %H.%M.%S.%f"),
        ("Time", "2026-11-28T10:11:12", "%m/%d/%Y %H:%M:%S:MS"),
        ("Timestamp", "2025-06-12T23:59:58", "%d/%m/%Y %H:%M:%S.%f"),  # a day of 13 tells which number is the month
        ("Date,Time,Millitm", "2026-11-28T10:11:12", "%m/%d/%Y,%H:%M:%S,MS"),  # as FactoryTalk writes them
    ],
)
def test_clocks_are_read_however_their_parts_are_separated(heading, start, form, read):
    moments = [datetime.fromisoformat(start) + timedelta(seconds=STEP_S * i) for i in range(COUNT)]
    stamps = [f"{moment:{form}}".replace("MS", f"{moment.microsecond // 1000:03d}") for moment in moments]
    assert read(heading, stamps).time_s == pytest.approx(STEP_S * np.arange(COUNT), abs=1e-6)


@pytest.mark.parametrize(("form", "step_s"), [("{0:02d}:{1:02d}", 60.0), ("00.{0:02d}.{1:02d}", 1.0)])
def test_clocks_without_seconds_and_with_points_are_no_days(form, step_s, read):
    found = read("Time", [form.format(*divmod(590 + i, 60)) for i in range(COUNT)])
    assert found.time_s == pytest.approx(step_s * np.arange(COUNT))
    assert ("hours and minutes" in " ".join(found.meta.get("assumed", ()))) == (step_s == 60.0)


def test_a_clock_of_minutes_beyond_a_day_counts_minutes_and_seconds(read):
    found = read("Time", [f"{i // 2}:{i % 2 * 30:02d}" for i in range(COUNT)])
    assert found.time_s == pytest.approx(30.0 * np.arange(COUNT))


@pytest.mark.parametrize("back_s", [0.2, 11 * 3600.0])
def test_only_a_step_back_of_half_a_day_is_a_midnight(back_s, read):
    begun = datetime(2026, 11, 28, 12, 59, 58)
    clocks = [begun + timedelta(seconds=STEP_S * i - (back_s if i >= COUNT // 2 else 0.0)) for i in range(COUNT)]
    with pytest.raises(FileError, match="does not come after"):
        read("Time", [f"{clock:%H:%M:%S.%f}" for clock in clocks])


def test_a_clock_may_be_written_as_one_number(read):
    begun = datetime(2026, 11, 28, 10, 59, 58)
    found = read("Time", [f"{begun + timedelta(seconds=STEP_S * i):%H%M%S.%f}" for i in range(COUNT)])
    assert found.time_s - found.time_s[0] == pytest.approx(STEP_S * np.arange(COUNT))
    assert "101159.5 is 10:11:59.5" in " ".join(found.meta["assumed"])


def test_a_pause_of_a_minute_is_none_of_a_clock(read):
    stamps = [f"{STEP_S * i + (40.0 if i > 60 else 0.0):.2f}" for i in range(COUNT)]
    assert read("Time", stamps).time_s[-1] == pytest.approx(STEP_S * (COUNT - 1) + 40.0)


@pytest.mark.parametrize(("heading", "unit_s"), [("ms", 1e-3), ("millis", 1e-3), ("micros", 1e-6)])
def test_a_column_called_by_its_unit_alone_is_the_time(heading, unit_s, read):
    found = read(heading, [f"{STEP_S * i / unit_s:.0f}" for i in range(COUNT)])
    assert found.time_s == pytest.approx(STEP_S * np.arange(COUNT))


@pytest.mark.parametrize("heading", ["seconds,milliseconds", "time [s],time [ms]", "s,ms", "Time (s),Millis"])
def test_whole_seconds_and_the_milliseconds_beside_them_are_one_time(heading, read):
    milliseconds = [round(1e3 * STEP_S * i) for i in range(COUNT)]
    found = read(heading, [f"{ms // 1000},{ms % 1000}" for ms in milliseconds])
    assert found.time_s == pytest.approx(STEP_S * np.arange(COUNT)) and list(found.channels) == ["u", "y"]


def test_milliseconds_that_go_on_beside_whole_seconds_make_no_time_of_their_own(read):
    with pytest.raises(FileError, match="time must increase"):
        read("time [s],delay [ms]", [f"{i // 20},7" for i in range(COUNT)])


@pytest.mark.parametrize("form", ['"%b %d %Y %H:%M:%S.%f"', '"%B %d, %Y %I:%M:%S.%f %p"', "%b %d %Y,%H:%M:%S.%f"])
def test_a_month_may_stand_before_its_day(form, read):
    moments = [datetime(2026, 1, 5, 23, 59, 58) + timedelta(seconds=STEP_S * i) for i in range(COUNT)]
    heading = "Date,Time" if '"' not in form else "Time"
    found = read(heading, [f"{moment:{form}}" for moment in moments])
    assert found.time_s == pytest.approx(STEP_S * np.arange(COUNT))
    assert found.meta["time counts from"].startswith("2026-01-05T23:59:58")


def test_the_distance_of_samples_is_that_between_changes_of_rounded_stamps(read):
    with pytest.raises(FileError, match=r"About 20 samples share each stamp.* here about 0\.05$"):
        read("time [s]", [str(int(STEP_S * i + 1e-9)) for i in range(7, COUNT - 3)])
