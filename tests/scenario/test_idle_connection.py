"""A coupler that closes a connection on which nothing was said for a while is connected again, at rest alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from hil.errors import HardwareError
from hil.rig import Rig
from tests.driven import silent_rig
from tests.links import served
from tests.observer import Line
from tests.recorded_line import recorded

UNWATCHED = ("block_s = 0.1", "block_s = 0.1\nwatchdog_s = 0")


@contextmanager
def behind_a_relay(tmp_path: Path) -> Iterator[tuple[Rig, Line]]:
    with served("hpv41-modbus-tcp", tmp_path, ("watchdog_s = 1.0\n", ""), UNWATCHED) as (file, _):
        port = int(str(file.bench.devices["io"].settings["address"]).rpartition(":")[2])
        with recorded(file, port) as (through, relay), silent_rig(through, tmp_path / "run") as rig:
            yield rig, relay


def play(rig: Rig, level: float) -> None:
    rig.play(np.full(round(0.2 * rig.rate_hz), level))


def test_hung_up_at_rest_is_connected_again(tmp_path):
    with behind_a_relay(tmp_path) as (rig, relay):
        play(rig, 20.0)
        play(rig, 0.0)
        before = relay.taken
        relay.hang_up()
        play(rig, 20.0)
        assert relay.taken == before + 1


def hang_up_away_from_rest(tmp_path: Path) -> None:
    with behind_a_relay(tmp_path) as (rig, relay):
        play(rig, 20.0)
        relay.hang_up()
        play(rig, 20.0)


def test_hung_up_while_driven_ends_the_run(tmp_path):
    with pytest.raises(HardwareError):
        hang_up_away_from_rest(tmp_path)
