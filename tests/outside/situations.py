"""What is done to a program that drives a valve: outages, named cases, and combinations that are drawn."""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass

from tests.outside.coupler import READS, Coupler
from tests.outside.judge import Seen
from tests.outside.running import Program, run_command, step_command

OUTAGES_S = (0.3, 0.35, 0.4, 0.45, 0.5, 0.6, 0.8, 1.0, 2.0, 4.0, 6.0, 8.0)


@dataclass
class Scene:
    """Whoever takes part."""

    coupler: Coupler
    program: Program
    seen: Seen
    watchdog: int | None


Act = Callable[[Scene], object]


@dataclass(frozen=True)
class Situation:
    """Acts with their times after the output was driven, and with what the program is started.

    Attributes:
        words: of the program, made of the path of the bench; the run of the procedure `stand` where None.
        settings: of that procedure.
        serial: the device is on a serial line.
        reads: steps are measured on it, and this is wrong with what is read (see `Coupler`).
    """

    name: str
    acts: tuple[tuple[float, Act], ...]
    settings: tuple[str, ...] = ()
    terminal: bool = False
    words: Callable[[object], list[str]] | None = None
    settle_s: float = 0.5
    is_ours: bool = True
    serial: bool = False
    reads: str = ""


def later(after_s: float, do: Callable[[], object]) -> None:
    timer = threading.Timer(after_s, do)
    timer.daemon = True
    timer.start()


def outage(for_s: float) -> Act:
    """Packets are lost for a while."""

    def act(scene: Scene) -> None:
        scene.coupler.line.lose()
        later(for_s, scene.coupler.line.heal)

    return act


def signalled(*numbers: int) -> Act:
    """The run gets signals, a third of a second between them."""

    def act(scene: Scene) -> None:
        if signal.SIGKILL in numbers:
            scene.seen.killed.add("run")
        for number in numbers:
            with suppress(ProcessLookupError):
                scene.program.process.send_signal(number)
            time.sleep(0.3 if len(numbers) > 1 else 0.0)

    return act


def watchdog_signalled(number: int, back_s: float | None = None) -> Act:
    """Its watchdog process gets a signal; one that is stopped goes on after a while."""

    def act(scene: Scene) -> None:
        if number == signal.SIGKILL:
            scene.seen.killed.add("watchdog")
        with suppress(ProcessLookupError, TypeError):
            os.kill(scene.watchdog, number)  # type: ignore[arg-type]
            if back_s is not None:
                later(back_s, lambda: _to(scene.watchdog, signal.SIGCONT))

    return act


def stopped(for_s: float) -> Act:
    """The run is stopped for a while, as a computer that sleeps stops it."""

    def act(scene: Scene) -> None:
        scene.program.process.send_signal(signal.SIGSTOP)
        later(for_s, lambda: _to(scene.program.process.pid, signal.SIGCONT))

    return act


def for_a_while(name: str, value: object, for_s: float, usual: object) -> Act:
    """The device does something else for a while."""

    def act(scene: Scene) -> None:
        setattr(scene.coupler, name, value)
        later(for_s, lambda: setattr(scene.coupler, name, usual))

    return act


def press(scene: Scene) -> None:
    scene.program.press()


def trip(scene: Scene) -> None:
    scene.coupler.over = True


def disk_full(scene: Scene) -> None:
    with suppress(OSError):
        size = (scene.program.run / "samples.f8").stat().st_size + 500
        resource.prlimit(scene.program.process.pid, resource.RLIMIT_FSIZE, (size, size))


def no_handles(scene: Scene) -> None:
    with suppress(OSError):
        resource.prlimit(scene.program.process.pid, resource.RLIMIT_NOFILE, (3, 3))


def folder_gone(scene: Scene) -> None:
    shutil.rmtree(scene.program.run, ignore_errors=True)


def terminal_stopped(scene: Scene) -> None:
    """Ctrl-S: it takes nothing any more."""
    scene.program.deaf = True
    with suppress(OSError, TypeError):
        os.write(scene.program.terminal, b"\x13")  # type: ignore[arg-type]


def terminal_closed(scene: Scene) -> None:
    near, scene.program.terminal = scene.program.terminal, None
    if near is not None:
        os.close(near)


def _to(pid: int | None, number: int) -> None:
    with suppress(ProcessLookupError, TypeError):
        os.kill(pid, number)  # type: ignore[arg-type]


ENDINGS: Mapping[str, Act | None] = {
    "nothing": None, "Ctrl-C": signalled(signal.SIGINT), "SIGTERM": signalled(signal.SIGTERM),
    "SIGKILL": signalled(signal.SIGKILL), "stop button": press,
}  # fmt: skip


def outages() -> list[Situation]:
    """Every outage with every ending, which comes a moment into it."""
    return [
        Situation(
            f"outage of {for_s:g} s, {ending}",
            ((0.0, outage(for_s)), *(((min(0.1, 0.3 * for_s), act),) if act is not None else ())),
            settle_s=0.5 + 0.37 * (i % 3),
        )
        for i, for_s in enumerate(OUTAGES_S) for ending, act in ENDINGS.items()
    ]  # fmt: skip


def held_lines() -> list[Situation]:
    """A serial line that keeps what was sent, and gives it out later."""
    return [
        Situation(f"serial line held for {for_s:g} s, {ending}",
                  ((0.0, outage(for_s)), *(((0.1, act),) if act is not None else ())), serial=True)
        for for_s in (0.5, 4.0) for ending, act in ENDINGS.items()
    ]  # fmt: skip


_DEAD = outage(9.0)
_SCRIPT = """\
import sys, time, threading
import numpy as np
from hil import api

def drive():
    with api.open_bench(sys.argv[1], sys.argv[2]) as rig:
        for _ in range(60):
            rig.play(np.full(8, 70.0))

how = sys.argv[3]
if how == "thread":
    thread = threading.Thread(target=drive)
    thread.start()
    thread.join()
elif how in ("left open", "left open and exits"):
    opened = api.open_bench(sys.argv[1], sys.argv[2])
    rig = opened.__enter__()
    rig.play(np.full(8, 70.0))
    if how == "left open":
        time.sleep(40.0)
else:
    drive()
"""


def _script(how: str) -> Callable[[object], list[str]]:
    return lambda path: ["-c", _SCRIPT, str(path), str(path.parent / "run"), how]  # type: ignore[attr-defined]


def _check_driver(path: object) -> list[str]:
    return ["-m", "hil", "check-driver", "modbus", "--bench", str(path), "--hardware", "--reach", "0.8"]


def _jog(path: object) -> list[str]:
    out = str(path.parent / "run")  # type: ignore[attr-defined]
    return ["-m", "hil", "jog", str(path), "command", "60", "--for", "30s", "--out", out]


def named() -> list[Situation]:
    """The cases that have a name."""
    wrong = [
        Situation(f"procedure {wrong}, {name}", ((2.0, act),), (f"wrong={wrong}",))
        for wrong in ("swallows", "drives again", "ignores signals", "hangs")
        for name, act in {"Ctrl-C": signalled(signal.SIGINT), "trip": trip, "dead link": _DEAD, "stop button": press,
                          "SIGTERM": signalled(signal.SIGTERM)}.items()
    ]  # fmt: skip
    forks = [
        Situation(f"procedure {wrong}, {name}", ((2.5, act),), (f"wrong={wrong}",))
        for wrong in ("forks", "starts")
        for name, act in {"SIGKILL": signalled(signal.SIGKILL), "Ctrl-C": signalled(signal.SIGINT),
                          "outage of 0.5 s": outage(0.5), "outage of 4 s": outage(4.0)}.items()
    ]  # fmt: skip
    watchdogs = [
        Situation("watchdog dying, dead link", ((0.0, watchdog_signalled(signal.SIGINT)), (0.05, _DEAD))),
        *(Situation(f"dead link, watchdog gets {number}{' and so does the run' if both else ''}",
                    ((0.0, _DEAD), (0.0, watchdog_signalled(number)), *(((0.0, signalled(number)),) if both else ())))
          for number in (signal.SIGINT, signal.SIGTERM) for both in (False, True)),
        Situation("dead link, watchdog killed", ((0.0, _DEAD), (0.0, watchdog_signalled(signal.SIGKILL)))),
        Situation("dead link, watchdog stopped", ((0.0, _DEAD), (0.0, watchdog_signalled(signal.SIGSTOP, 20.0)))),
        Situation("watchdog stopped, run ends well",
                  ((0.0, watchdog_signalled(signal.SIGSTOP, 20.0)), (0.5, signalled(signal.SIGINT)))),
    ]  # fmt: skip
    programs = [
        *(Situation(f"check-driver on hardware, signal {number}", ((0.0, signalled(number)),), words=_check_driver,
                    settle_s=0.0) for number in (9, 15, 1, 2)),
        *(Situation(f"jog, signal {number}", ((0.0, signalled(number)),), words=_jog) for number in (9, 1, 15)),
        *(Situation(f"Python API: {how}, {name}", ((0.5, act),) if act else (), words=_script(how),
                    is_ours=False)
          for how, name, act in (
              ("plain", "nothing", None), ("plain", "Ctrl-C", signalled(2)), ("plain", "SIGTERM", signalled(15)),
              ("plain", "SIGKILL", signalled(9)), ("thread", "Ctrl-C", signalled(2)), ("left open", "nothing", None),
              ("left open and exits", "nothing", None))),
    ]  # fmt: skip
    terminals = [
        Situation(f"terminal {how}, {name}", ((0.0, what), (3.0, act)), terminal=True)
        for how, what in {"stopped": terminal_stopped, "closed": terminal_closed}.items()
        for name, act in {"trip": trip, "Ctrl-C": signalled(2), "SIGKILL": signalled(9), "stop button": press}.items()
    ]
    truths = [Situation(f"truth: a flow that is read {how}", (), reads=how) for how in READS]
    return [*truths, *held_lines(), *wrong, *forks, *watchdogs, *programs, *terminals]


_LINK: Mapping[str, Act] = {
    **{f"outage of {for_s:g} s": outage(for_s) for for_s in (0.3, 0.5, 1.0, 4.0)},
    "garbled for 1 s": for_a_while("garbles", True, 1.0, False),
    "0.15 s late for 2 s": for_a_while("late_s", 0.15, 2.0, 0.0),
    "0.5 s late for 3 s": for_a_while("late_s", 0.5, 3.0, 0.0),
    "ignores commands for 3 s": for_a_while("ignores", True, 3.0, False),
    "connection reset": lambda scene: scene.coupler.line.reset(),
}
_REST: Mapping[str, Act] = {
    "Ctrl-C": signalled(2), "Ctrl-C twice": signalled(2, 2), "Ctrl-C twice, SIGTERM": signalled(2, 2, 15),
    "SIGTERM": signalled(15), "SIGHUP": signalled(1), "SIGQUIT": signalled(3), "SIGKILL": signalled(9),
    "run stopped for 0.7 s": stopped(0.7), "run stopped for 4 s": stopped(4.0),
    "watchdog killed": watchdog_signalled(9), "watchdog stopped for 3 s": watchdog_signalled(19, 3.0),
    "watchdog SIGTERM": watchdog_signalled(15), "watchdog SIGINT": watchdog_signalled(2),
    "disk full": disk_full, "no handles": no_handles, "run folder gone": folder_gone,
    "terminal closed": terminal_closed, "terminal stopped": terminal_stopped, "stop button": press, "trip": trip,
    "another master": lambda scene: scene.coupler.poke(),
}  # fmt: skip


def drawn(seed: int) -> Situation:
    """Two or three faults at random moments."""
    draw = random.Random(seed)
    first = draw.choice(sorted(_LINK)) if draw.random() < 0.7 else draw.choice(sorted(_REST))
    names = [first, *draw.choices(sorted({**_LINK, **_REST}), k=draw.choice([1, 1, 2]))]
    if draw.random() < 0.35:
        names[:2] = names[1::-1]
    choices_s = (0.02, 0.1, 0.25, 0.4, 0.7, 1.1, 1.6, 2.4)
    times_s = [0.0, *sorted(draw.choice(choices_s) * draw.uniform(0.8, 1.2) for _ in names[1:])]
    acts = tuple((at_s, {**_LINK, **_REST}[name]) for at_s, name in zip(times_s, names, strict=True))
    told = ", ".join(f"{name} at {at_s:.2f} s" for at_s, name in zip(times_s, names, strict=True))
    on_terminal = any(name.startswith("terminal") for name in names) or draw.random() < 0.3
    return Situation(f"seed {seed}: {told}", acts, terminal=on_terminal, settle_s=draw.uniform(0.05, 2.0))


def words_of(situation: Situation, path: object) -> list[str]:
    """With what a program is started."""
    if situation.reads:
        return step_command(path)  # type: ignore[arg-type]
    if situation.words is not None:
        return situation.words(path)
    return run_command(path, *situation.settings)  # type: ignore[arg-type]
