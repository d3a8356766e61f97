"""A run stands in the audit trail: that it drives, what it resets, and what stopped it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from audit_trail import read_audit

from hil.bench.audit import ACCOUNT, Audit, on_the_trail
from hil.bench.find import benches
from hil.bench.lease import leased
from hil.bench.read import BenchFile, read_bench
from hil.errors import FileError, InUseError, StorageError
from hil.safety.interrupt import Halted, Terminated
from hil.session.procedure import load_procedure
from hil.session.run import run_procedure

pytestmark = pytest.mark.usefixtures("unprinted")

SIMULATED, LINKED = "brevini-hpv41", "hpv41-modbus-tcp"


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("HIL_STATE_DIR", str(tmp_path / "state"))
    return tmp_path / "state"


def bench(name: str) -> BenchFile:
    return read_bench(benches()[name])


def test_a_run_that_drives_and_resets_is_named_by_account_and_operator(monkeypatch):
    monkeypatch.setenv(ACCOUNT, "otto")
    about = {"procedure": "flow_curve", "operator": "Eva", "limits given": {"lag": {"low": None, "high": 2.0}}}
    with on_the_trail(bench(SIMULATED), Path("runs/one"), about, ["over-pressure"]) as begins:
        assert not Audit().path.exists(), "nothing has happened yet"
        begins()
    reset, drives = read_audit(Audit().path)
    assert (reset["act"], reset["account"], reset["operator"]) == ("reset", "otto", "Eva")
    assert (drives["act"], drives["account"], drives["operator"]) == ("drives", "otto", "Eva")
    assert reset["details"]["interlock"] == "over-pressure" and drives["details"]["procedure"] == "flow_curve"
    assert drives["details"]["limits given"] == about["limits given"]
    assert drives["details"]["run"] == str(Path("runs/one").absolute())


@pytest.mark.parametrize(
    ("stopped", "how", "account"),
    [(KeyboardInterrupt(), "Ctrl-C", "labuser"), (Terminated(), "SIGTERM", ""), (Halted(), "stop was pressed", "")],
)
def test_what_stopped_a_run_is_on_the_trail_and_who_only_where_it_is_known(stopped, how, account, monkeypatch):
    monkeypatch.setattr("getpass.getuser", lambda: "labuser")
    stopped.add_note("outputs are safe (read back)")

    def drive():
        with on_the_trail(bench(SIMULATED), Path("run"), {"operator": "Eva"}) as begins:
            begins()
            raise stopped

    with pytest.raises(KeyboardInterrupt):
        drive()
    *_, last = read_audit(Audit().path)
    assert (last["act"], last["account"], last["operator"]) == ("stop", account, "Eva" if account else "")
    assert last["details"]["how"] == how and last["details"]["outputs"] == "outputs are safe (read back)"


def test_run_that_did_not_get_the_bench_drove_nothing_and_stopped_nothing():
    with pytest.raises(KeyboardInterrupt), on_the_trail(bench(SIMULATED), Path("run"), {}):
        raise KeyboardInterrupt
    assert not Audit().path.exists()


def test_nothing_moves_that_cannot_be_written_down(state):
    state.write_text("no folder", encoding="utf-8")
    with on_the_trail(bench(LINKED), Path("run"), {}) as begins, pytest.raises(StorageError, match="audit trail"):
        begins()
    with on_the_trail(bench(SIMULATED), Path("run"), {}) as begins:
        begins()


def test_start_that_is_refused_the_bench_writes_no_line(tmp_path):
    file = bench(LINKED)
    with leased(file), pytest.raises(InUseError):
        run_procedure(load_procedure("jog"), file, {"value": 0.0}, tmp_path / "run")
    assert not Audit().path.exists()


def test_a_trail_of_others_is_read_within_limits(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="pipe: is a pipe; only regular files"):
        list(read_audit(tmp_path / "pipe"))
    Audit(tmp_path / "trail").write("otto", "drives", {})
    sound = (tmp_path / "trail").read_bytes()
    for text, says in ((b"[" * 100_000, "line 2 is none"), (b"a" * (1 << 24), "a line of more than 16777216 bytes")):
        (tmp_path / "trail").write_bytes(sound + text + b"\n")
        with pytest.raises(FileError, match=says):
            list(read_audit(tmp_path / "trail"))
