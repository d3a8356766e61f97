"""Processes of our own execute nothing that lies in the working folder."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import wait
from pathlib import Path

import pytest

from hil.child import child, over_processes
from hil.console.process import start

_NAMES = ("typer", "can", "serial", "numpy", "json", "multiprocessing", "socket", "pickle", "sitecustomize")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder: whatever is imported from it leaves a file."""
    for name in _NAMES:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'a').write({name!r} + '\\n')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", f":{os.environ.get('PYTHONPATH', '')}:")
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    return tmp_path


def _executed(folder: Path) -> str:
    path = folder / "executed"
    return path.read_text() if path.exists() else ""


def test_a_child_executes_nothing_of_the_working_folder(folder):
    process = child("hil", ["list", "plants"], stdout=subprocess.PIPE, text=True)
    assert "brevini-hpv41" in process.communicate()[0]
    assert process.returncode == 0
    assert not _executed(folder)


def test_a_run_from_a_page_executes_nothing_of_the_working_folder(folder):
    started = start("list", ["list", "drivers"], folder / "logs/list.log")
    assert started.process.wait(600) == 0
    assert started.lines
    assert not _executed(folder)


def test_workers_execute_nothing_of_the_working_folder(folder):
    before = dict(os.environ)
    assert sorted(over_processes(abs, [-1, -2, -3], lambda: 2, lost=abs)) == [1, 2, 3]
    assert not _executed(folder)
    assert dict(os.environ) == before


def test_a_lost_process_costs_one_item_and_a_sentence():
    told = []
    killed = "__import__('os').abort()"  # by a function that imports nothing of the tests
    found = list(
        over_processes(
            eval, ["0", "1", killed, "3", "4", "5"], lambda: 2, lost=lambda item: -len(item), tell=told.append
        )
    )
    assert sorted(found) == [-len(killed), 0, 1, 3, 4, 5]
    assert len(told) == 1 and "a process was lost" in told[0]


def test_items_are_taken_as_processes_come_free():
    taken = []
    answers = over_processes(abs, (taken.append(k) or k for k in range(50)), lambda: 1, lost=abs)
    assert next(answers) < 10  # two may be finished when it is looked
    assert len(taken) < 10
    answers.close()


def test_python_m_hil_executes_nothing_of_the_working_folder(folder):
    (folder / "typer.py").rename(folder / "click.py")  # of those that `runpy` does not need itself
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    for name in set(_NAMES) - {"typer"}:
        (folder / f"{name}.py").unlink()
    done = subprocess.run([sys.executable, "-m", "hil", "list", "plants"], env=environment, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert not _executed(folder)


def test_numba_takes_no_folder_of_compiled_code_from_the_working_folder(folder):
    for name in _NAMES:
        (folder / f"{name}.py").unlink()
    (folder / ".numba_config.yaml").write_text(f"cache_dir: {folder / 'planted'}\n")
    program = "import hil.kernel, numba.core.config as config; print('cache:', config.CACHE_DIR)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "cache: \n", done.stderr


def test_a_picture_is_drawn_alike_whatever_matplotlibrc_lies_in_the_working_folder(folder):
    for name in _NAMES:
        (folder / f"{name}.py").unlink()
    program = (
        "from hil.report.figure import drawn\n"
        "print(drawn('p', 1.0, lambda figure: figure.subplots().plot([1, 2], label='a')).svg)"
    )

    def picture():
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    plain = picture()
    (folder / "matplotlibrc").write_text("text.usetex: True\nlines.linewidth: 20\nbackend: module://planted\n")
    assert picture() == plain


@pytest.mark.parametrize("killed", [-1, 3])
def test_every_item_is_answered_on_a_busy_machine(killed, monkeypatch):
    """All that was at work is finished, or lost, before anybody looks or while an answer is written."""
    monkeypatch.setattr("hil.child.wait", lambda *of, **how: time.sleep(0.3) or wait(*of, **how))
    asked = ["__import__('os').abort()" if k == killed else str(k) for k in range(10)]
    found = []
    for answer in over_processes(eval, asked, lambda: 1, lost=lambda _: killed):
        found.append(answer)
        time.sleep(0.3)
    assert sorted(found) == list(range(10))
