"""Another program that moves an output is an error within two seconds, whatever the protocol.

What was driven meets what the device holds in one place, `hil.daq.device_link.stands_as_driven`; where that finds
nothing, no driver does. The board of NI is in tests/unit/test_driver_ni.py.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from hil.bench.read import read_bench
from hil.bench.twin import subject
from hil.daq import device_link
from hil.errors import LinkError
from tests.contract.test_drivers import CASES, bench_of
from tests.unit.test_description_can import AMPLIFIER, DBC
from tests.waits import side_by_side

pytestmark = pytest.mark.xdist_group("waits for twins")  # for clocks: on one worker, beside others that compute

DRIVERS = [case for case in CASES if case not in ("ascii inputs", "modbus outputs alone")]
IN_TURN_S, PATIENCE_S = 0.02, 60.0
TURNS = 1000


def moved_by_another(case: str, folder: Path, turns: int, another: bool) -> str:
    """What the driver says of an output at which another program pulls; empty where it says nothing."""
    path = bench_of(case, folder)
    if case == "can":
        told_to_say_where_it_stands(path)
    with subject(read_bench(path), folder, CASES[case][0]) as driver, driver.link() as link, ExitStack() as others:
        other: Any = None
        if another:
            own = {"source": 0x27} if hasattr(driver.settings, "source") else {}
            other = driver.module.open_link(driver.settings.model_copy(update=own), driver.wiring)
            others.callback(other.close)
        begun_s, told = time.monotonic(), driver.levels(0.5)
        while turns and time.monotonic() - begun_s < PATIENCE_S:
            turns -= 1
            try:
                link.drive(told)
                if other is not None:
                    other.drive(driver.safe())
                link.read()
            except LinkError as error:  # of a device that two masters set up, or a busy computer: the run would end too
                if "as it was driven: " in str(error):
                    return str(error)
            time.sleep(IN_TURN_S)
    return ""


def told_to_say_where_it_stands(path: Path) -> None:
    """A device on CAN of which a message says where its output stands."""
    (path.parent / "amplifier.dbc").write_text(DBC, encoding="utf-8")
    (path.parent / "patient.toml").write_text(AMPLIFIER.replace("time_s = 0.3", "time_s = 4.0"), encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    for old, new in (("flow command", "set"), ("estimated flow", "measured")):
        assert f'terminal = "{old}"\n' in text
        text = text.replace(f'terminal = "{old}"\n', f'terminal = "{new}"\ncalibration = {{ slope = 10.0 }}\n')
    path.write_text(text, encoding="utf-8")


def said_of_all(tmp_path: Path, turns: int, another: bool) -> dict[str, str]:
    def said(case: str) -> str:
        folder = tmp_path / f"{case.replace(' ', '-')}-{another}"
        folder.mkdir()
        return moved_by_another(case, folder, turns, another)

    return dict(zip(DRIVERS, side_by_side(said, DRIVERS), strict=True))


def test_another_program_that_moves_an_output_is_noticed_by_every_driver(tmp_path):
    said = said_of_all(tmp_path, TURNS, another=True)
    assert {case for case, text in said.items() if "as it was driven: " not in text} == set(), said


def test_nobody_is_suspected_where_nobody_else_drives(tmp_path):
    assert set(said_of_all(tmp_path, 60, another=False).values()) == {""}


def test_the_comparison_stands_in_one_place(tmp_path, monkeypatch):
    monkeypatch.setattr(device_link, "stands_as_driven", lambda *_: True)
    said = said_of_all(tmp_path, 60, another=True)
    assert not any("as it was driven: " in text for text in said.values()), said
