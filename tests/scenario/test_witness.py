"""A valve that sticks open behind a real link: its register is safe, and the last word is not."""

import json

import numpy as np
import pytest

from hil.errors import NotSafeError, exit_status_of, with_notes
from tests.links import CALM, opened, served

JUDGED = ("block_s = 0.1", "block_s = 2.0")  # a busy host takes long for a sample; how long is not what is tried


def test_valve_that_sticks_open_is_not_called_safe(tmp_path):
    with (
        served("hpv41-modbus-tcp", tmp_path, *CALM, JUDGED, quirks={"io": {"sticks": True}}) as (file, _),
        pytest.raises(NotSafeError) as ended,
        opened(file, tmp_path / "run") as rig,
    ):
        flow = rig.play(np.full(30, 60.0), 20.0).values("flow")
    record = json.loads((tmp_path / "run" / "end.json").read_text(encoding="utf-8"))["outputs"]["command"]
    assert (record["state"], record["read_back"]) == ("unconfirmed", True)
    assert record["at"] == pytest.approx(0.0, abs=0.1)
    assert record["witness"]["reads"] == pytest.approx(flow[-1], abs=3.0)
    assert "NOT CONFIRMED by flow" in with_notes(ended.value) and exit_status_of(ended.value) == 3
    assert not (tmp_path / "run" / "watchdog.json").exists()  # no command can do more
