"""One situation from the start of the program until its last word has been watched for long enough."""

from __future__ import annotations

import signal
import tempfile
import time
from pathlib import Path

from tests.outside.coupler import Coupler
from tests.outside.judge import Seen, judged
from tests.outside.running import Program, bench, started
from tests.outside.situations import Scene, Situation, words_of
from tests.waits import PATIENCE_S

GIVES_UP_S = 75.0  # the watchdog process, at the latest
_DRIVEN = 20.0  # %
_TRIES = 3
_ENDS_S = 15.0


def watched(situation: Situation, watch_s: float) -> Seen:
    """What was seen, for so long after run and watchdog process were gone; a host too busy to begin is asked again."""
    for _ in range(_TRIES):
        seen = _once(situation, watch_s)
        if not seen.not_run:
            break
    return seen


def _once(situation: Situation, watch_s: float) -> Seen:
    with tempfile.TemporaryDirectory(prefix="hil-outside-") as name, Coupler(situation.serial) as coupler:
        folder, seen = Path(name), Seen(situation.name, situation.is_ours)
        coupler.reads = situation.reads or coupler.reads
        program = started(
            folder, words_of(situation, bench(folder, coupler, 25 if situation.reads else 8)), situation.terminal
        )
        try:
            return _seen(situation, Scene(coupler, program, seen, None), watch_s)
        except Exception as error:  # of the observer: a row that was not run, and is counted
            seen.not_run = f"{type(error).__name__}: {error}"
            return seen
        finally:
            program.end()


def _seen(situation: Situation, scene: Scene, watch_s: float) -> Seen:
    program, seen, coupler = scene.program, scene.seen, scene.coupler
    if not _wait(lambda: abs(coupler.percent) > _DRIVEN or program.process.poll() is not None, PATIENCE_S) or (
        program.process.poll() is not None
    ):
        seen.not_run = f"not driven: {program.said[-300:]}"
        return seen
    time.sleep(situation.settle_s)
    scene.watchdog = program.watchdog
    begun_s = time.monotonic()
    seen.begun_s = time.time()
    for at_s, act in situation.acts:
        time.sleep(max(0.0, begun_s + at_s - time.monotonic()))
        act(scene)
    _end(program, seen, PATIENCE_S if situation.reads else _ENDS_S)
    _wait(lambda: program.watchdog is None, GIVES_UP_S)
    time.sleep(watch_s)
    return judged(seen, coupler, program, measures=bool(situation.reads))


def _end(program: Program, seen: Seen, within_s: float) -> None:
    """It has ended by itself, or is asked to: what does not disturb it goes on for ever."""
    if not _wait(lambda: program.process.poll() is not None, within_s):
        program.deaf = False
        program.process.send_signal(signal.SIGINT)
        _wait(lambda: program.process.poll() is not None, 60.0)
    seen.ended_s = time.time()


def _wait(until: object, within_s: float) -> bool:
    assert callable(until)
    end_s = time.monotonic() + within_s
    while not until():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.01)
    return True
