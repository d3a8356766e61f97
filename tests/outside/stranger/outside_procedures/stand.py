"""Stand at a level, and do what no procedure should."""

import os
import signal
import subprocess
import sys
import time
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt

from hil.record.measurement import Findings, Measurement
from hil.record.recording import Recording
from hil.rig import Rig

MEASUREMENTS = (Measurement("none", "%", "nothing"),)


def run(
    rig: Rig,
    *,
    level: float = 70.0,
    hold_s: Annotated[float, Gt(0)] = 1.0,
    rounds: int = 120,
    wrong: Literal[
        "", "swallows", "drives again", "ignores signals", "forks", "starts", "hangs", "exits", "reads"
    ] = "",
) -> None:
    """Stand there round by round.

    Args:
        level: where.
        hold_s: how long a round takes.
        rounds: how many.
        wrong: what it does, from the first round on.
    """
    for done in range(rounds):
        try:
            rig.play(np.full(max(1, round(hold_s * rig.rate_hz)), level), part={"kind": "level", "level": level})
        except BaseException:
            if wrong == "swallows":
                time.sleep(0.05)
                continue
            if wrong == "drives again":
                rig.play(np.full(max(1, round(hold_s * rig.rate_hz)), level), part={"kind": "level", "level": level})
            raise
        rig.progress((done + 1) / rounds, f"round {done + 1}")
        if done == 0:
            _do(wrong)


def _do(wrong: str) -> None:
    if wrong == "ignores signals":
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
            signal.signal(number, signal.SIG_IGN)
    if wrong == "forks" and os.fork() == 0:
        time.sleep(90.0)
        os._exit(0)
    if wrong == "starts":
        subprocess.Popen(["sleep", "90"], close_fds=False)
    if wrong == "hangs":
        time.sleep(600.0)
    if wrong == "reads":
        sys.stdin.readline()
    if wrong == "exits":
        sys.exit(0)


def evaluate(_recording: Recording) -> Findings:
    return Findings((MEASUREMENTS[0].of(1.0, 0.1),))
