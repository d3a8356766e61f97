"""Work that is spread over cores is done once, in order, at any depth."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from hil import cores
from hil.cores import parallel_map
from hil.errors import SettingError


@pytest.fixture
def three_cores(monkeypatch):
    idle = threading.Semaphore(2)
    monkeypatch.setattr(cores, "_idle", idle)
    with ThreadPoolExecutor(3) as threads:
        monkeypatch.setattr(cores, "_threads", lambda: threads)
        yield idle


def permits(idle: threading.Semaphore) -> int:
    """How many cores are idle."""
    count = 0
    while idle.acquire(blocking=False):
        count += 1
    return count


def test_results_come_in_the_order_of_what_was_given(three_cores):
    def late_first(k):
        time.sleep(0.002 * (10 - k))
        return k * k

    assert parallel_map(late_first, range(10)) == [k * k for k in range(10)]
    assert parallel_map(late_first, []) == []
    assert permits(three_cores) == 2


def test_idle_cores_help_and_no_more_than_there_are(three_cores):
    at_work, most, lock = 0, 0, threading.Lock()

    def watched(k):
        nonlocal at_work, most
        with lock:
            at_work += 1
            most = max(most, at_work)
        time.sleep(0.01)
        with lock:
            at_work -= 1
        return k

    def nested(k):
        return sum(parallel_map(watched, range(k, k + 4)))

    assert parallel_map(nested, range(5)) == [4 * k + 6 for k in range(5)]
    assert most == 3
    assert permits(three_cores) == 2


def test_without_an_idle_core_the_caller_does_it_all(monkeypatch):
    monkeypatch.setattr(cores, "_idle", threading.Semaphore(0))
    assert set(parallel_map(lambda _: threading.get_ident(), range(6))) == {threading.get_ident()}


def test_depth_beyond_the_number_of_threads_ends(three_cores):
    def deep(depth):
        return sum(parallel_map(deep, [depth - 1] * 3)) if depth else 1

    assert deep(7) == 3**7
    assert permits(three_cores) == 2


@pytest.mark.parametrize("failing", [0, 7])
def test_the_first_failure_ends_it_and_is_raised(three_cores, failing):
    begun = []

    def fails(k):
        begun.append(k)
        time.sleep(0.002)
        if k == failing:
            raise ValueError(f"number {k}")
        return k

    with pytest.raises(ValueError, match=f"number {failing}"):
        parallel_map(fails, range(60))
    assert len(begun) < 60
    assert permits(three_cores) == 2


def test_ctrl_c_ends_what_other_cores_are_at(three_cores):
    done, begun = 0, threading.Event()

    def step(_k):
        nonlocal done
        done += 1
        begun.set()
        time.sleep(0.001)

    def work(_k):
        if threading.current_thread() is threading.main_thread():
            begun.wait()
            raise KeyboardInterrupt
        parallel_map(step, range(3000))

    with pytest.raises(KeyboardInterrupt):
        parallel_map(work, range(3))
    assert done < 3000
    assert permits(three_cores) == 2
    for _ in range(2):
        three_cores.release()
    assert parallel_map(lambda k: k, range(9)) == list(range(9))


def test_the_environment_says_how_many_cores_are_used(monkeypatch):
    monkeypatch.setenv("HIL_CORES", "3")
    assert cores.cores() == 3
    monkeypatch.delenv("HIL_CORES")
    assert cores.cores() == len(os.sched_getaffinity(0))


@pytest.mark.parametrize("said", ["0", "-1", "two", "1.5"])
def test_a_number_of_cores_that_is_none_is_refused_by_name(said, monkeypatch):
    monkeypatch.setenv("HIL_CORES", said)
    with pytest.raises(SettingError, match=f"^HIL_CORES = {said!r} in the environment: say how many"):
        cores.cores()


def test_at_the_prompt_it_is_one_line_and_exit_2():
    command = [sys.executable, "-m", "hil", "identify", "no.csv", "--plant", "transfer-function", "--out", "m.json"]
    done = subprocess.run(command, env={**os.environ, "HIL_CORES": "two"}, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("hil: HIL_CORES = 'two' in the environment: ") and done.stderr.count("\n") == 1
