"""A run stands in the audit trail: that it drives, what it resets, and what stopped it."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.bench.audit import Audit, on_the_trail, read_audit
from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.errors import StorageError
from hil.safety.interrupt import Halted, Terminated

SIMULATED, LINKED = "brevini-hpv41", "hpv41-modbus-tcp"


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "state"))
    return tmp_path / "state"


def bench(name: str) -> BenchFile:
    return read_bench(benches()[name])


def test_a_run_that_drives_and_resets_is_named_before_it_does() -> None:
    about = {"procedure": "flow_curve", "operator": "Eva", "limits given": {"lag": {"low": None, "high": 2.0}}}
    with on_the_trail(bench(SIMULATED), Path("runs/one"), about, ["over-pressure"]):
        reset, drives = read_audit(Audit().path)
    assert (reset["act"], reset["who"], reset["details"]["interlock"]) == ("reset", "Eva", "over-pressure")
    assert (drives["act"], drives["who"], drives["details"]["procedure"]) == ("drives", "Eva", "flow_curve")
    assert drives["details"]["limits given"] == about["limits given"]
    assert drives["details"]["run"] == str(Path("runs/one").absolute())
    assert len(list(read_audit(Audit().path))) == 2  # an end as planned is no act


@pytest.mark.parametrize(
    ("stopped", "how"),
    [(KeyboardInterrupt(), "Ctrl-C"), (Terminated(), "SIGTERM"), (Halted(), "stop was pressed")],
)
def test_what_stopped_a_run_is_on_the_trail(stopped: KeyboardInterrupt, how: str) -> None:
    stopped.add_note("outputs are safe (read back)")
    with pytest.raises(KeyboardInterrupt), on_the_trail(bench(SIMULATED), Path("run"), {"operator": "Eva"}):
        raise stopped
    *_, last = read_audit(Audit().path)
    assert (last["act"], last["who"], last["details"]["how"]) == ("stop", "Eva", how)
    assert last["details"]["outputs"] == "outputs are safe (read back)"


def test_nothing_moves_that_cannot_be_written_down(state: Path) -> None:
    state.write_text("no folder", encoding="utf-8")
    moved = []
    with pytest.raises(StorageError, match="audit trail"), on_the_trail(bench(LINKED), Path("run"), {}):
        moved.append("real")
    with on_the_trail(bench(SIMULATED), Path("run"), {}):
        moved.append("simulated")
    assert moved == ["simulated"]


def test_without_an_operator_it_is_who_is_logged_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("getpass.getuser", lambda: "labuser")
    with on_the_trail(bench(SIMULATED), Path("run"), {}):
        (line,) = read_audit(Audit().path)
    assert line["who"] == "labuser"
