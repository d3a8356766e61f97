"""Whatever a recording holds comes back from every format that is installed."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hil.record.read import formats, read_recording, write_recording
from hil.record.recording import Channel, Recording
from hil.record.table.missing_values import is_stand_in

# One ending of each format that is written; "" is the run folder.
ENDINGS = sorted({module.SUFFIXES[0] for module in formats().values() if hasattr(module, "write")} | {".csv.gz", ""})
KEEPS_META = [ending for ending in ENDINGS if not ending.startswith(".csv")]

names = st.text(
    st.characters(blacklist_categories=("Cs", "Cc", "Zl", "Zp"), blacklist_characters="[]"), min_size=1, max_size=80
).map(str.strip).filter(lambda text: bool(text) and text != "time" and not text.startswith("\ufeff"))  # fmt: skip
units = st.sampled_from(["%", "V", "l/min", "bar", "°C", "1", "mm/s", "µm", "N·m"])
# Numbers by which loggers say that nothing was measured are refused, whoever wrote them.
values = st.floats(-1e149, 1e149).filter(lambda value: not is_stand_in(value))
json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | values | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


# Names that mean something to one of the formats.
AWKWARD = Recording("awkward", np.array([0.0, 1.0]), {
    name: Channel(name, "V", np.zeros(2))
    for name in ("valve-hil", "valve_hil", "channels", "t", "#refs#", "a/b", "a∕b", "a.b", ".", "flow (l)", "x / V",
                 'a; "b", c')
})  # fmt: skip


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    count = draw(st.integers(2, 40))
    steps = draw(arrays(np.float64, count, elements=st.floats(1e-5, 10.0)))
    time_s = draw(st.floats(-1e3, 1e6)) + np.cumsum(steps)
    time_s = np.unique(time_s)
    channels = {
        name: Channel(
            name,
            draw(units),
            draw(arrays(np.float64, len(time_s), elements=values)),
            draw(st.sampled_from(["", "flow meter 3"])),
            draw(st.sampled_from([{}, {"slope": 10.0, "date": "2026-01-31"}])),
        )
        for name in draw(st.lists(names, min_size=1, max_size=4, unique=True))
    }
    meta = draw(st.dictionaries(st.sampled_from(["procedure", "settings", "sampling"]), json_values, max_size=3))
    meta = {
        name: str(value) if name == "procedure" else value if isinstance(value, dict) else {"is": value}
        for name, value in meta.items()
    }
    return Recording("made", time_s, channels, meta)


def round_trip(made: Recording, ending: str) -> Recording:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"recording{ending}"
        write_recording(made, path)
        return read_recording(path)


@pytest.mark.parametrize("ending", ENDINGS)
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@example(made=AWKWARD)
@given(made=recordings().filter(lambda made: len(made) >= 2))
def test_every_format_gives_back_what_it_got(ending, made):
    found = round_trip(made, ending)
    assert np.array_equal(found.time_s, made.time_s)
    assert list(found.channels) == list(made.channels)
    for name, channel in made.channels.items():
        assert found.channels[name].unit == channel.unit
        assert np.array_equal(found.channels[name].values, channel.values)
    if ending in KEEPS_META:
        assert {name: found.meta[name] for name in made.meta} == made.meta
        for name, channel in made.channels.items():
            assert found.channels[name].source == channel.source
            assert found.channels[name].calibration == channel.calibration
