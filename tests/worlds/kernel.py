"""The world against Linux: TCP, pipes, signals, serial ports. One drawn script on both, and what either side saw.

    python -m tests.worlds.kernel -n 500

A script sends, waits, loses what goes to the other side (on Linux by a BPF filter that returns 0), closes as
`hil.system.tcp` does, and has the other side send, close and reset. Compared are what the other side has received, how
the connection ended for it, and which calls failed.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, field

from hil.system import system
from hil.system.parent import Parent
from hil.system.tcp import TcpConnection
from tests.foreign_line import ForeignLine
from tests.worlds.kernel_of_terminals import (
    Steps,
    port_in_world,
    port_on_linux,
    port_script,
    signal_script,
    signals_in_world,
    signals_on_linux,
)
from tests.worlds.network import Cable, End, Host
from tests.worlds.processes import ParentEnd, Pipe
from tests.worlds.system import WorldSystem
from tests.worlds.tasks import Hub

TIMEOUT_S = 0.4  # of the link: far from the kernel's first retransmission after 0.2 s
SHORT_S, LONG_S = 0.05, 1.5
SETTLES_S = 1.0
_SOON_S = 0.05
Script = tuple[tuple[str, float], ...]
_STEPS = ("send", "send", "send", "wait", "lose", "heal", "other sends", "other closes", "other resets")


@dataclass
class Seen:
    """What came of a script.

    Attributes:
        received: by the other side.
        failed: which steps raised an error.
    """

    received: bytes = b""
    failed: list[int] = field(default_factory=list)
    ended: str = "open"


def script(seed: int) -> Script:
    """Three to seven steps, and the end of the connection."""
    draw = random.Random(f"script {seed}")
    steps: list[tuple[str, float]] = []
    for _ in range(draw.randint(3, 7)):
        what = draw.choice(_STEPS)
        is_other = what.startswith("other")
        steps += [("wait", SHORT_S)] if is_other else []  # what was sent before has come: loopback takes no time
        steps.append((what, draw.randint(1, 300) if "send" in what else draw.choice((SHORT_S, LONG_S))))
        if is_other or what in ("lose", "heal"):
            steps.append(("wait", draw.choice((SHORT_S, LONG_S)) if what == "lose" else SHORT_S))
    steps.append((draw.choice(("drop", "let go")), 0.0))
    return (*steps, ("heal", 0.0), ("wait", SETTLES_S))


class _Other:
    """The other side, on Linux."""

    def __init__(self) -> None:
        self.seen = Seen()
        self.line = ForeignLine(self._take, lambda came: len(came))
        self.port = self.line.port

    def _take(self, came: bytes) -> bytes:
        self.seen.received += came
        return b""


def on_linux(steps: Script) -> Seen:
    """Do it on this computer."""
    other = _Other()
    with other.line as line:
        held = TcpConnection("127.0.0.1", other.port, TIMEOUT_S)
        time.sleep(SHORT_S)
        client = line.clients[0]
        acts: dict[str, Callable[[], object]] = {
            "lose": line.lose, "heal": line.heal,
            "other closes": lambda: client.shutdown(2), "other resets": line.reset,
        }  # fmt: skip
        for at, (what, much) in enumerate(steps):
            if what == "other sends":
                _try(other.seen, -1, lambda much=much: client.sendall(b"y" * int(much)))  # type: ignore[misc]
            elif what in acts:
                _try(other.seen, -1, acts[what])
            else:
                _step(held, other.seen, at, what, much, time.sleep)
    return other.seen


def in_world(steps: Script) -> Seen:
    """Do it in a world."""
    hub, seen = Hub(1), Seen()
    there, back = Cable(hub, (1e-5, 5e-5)), Cable(hub, (1e-5, 5e-5))
    ends: list[End] = []

    def heard(end: End) -> None:
        seen.received += bytes(end.received)
        end.received.clear()
        if end.has_ended and not end.is_gone:
            end.close()

    def taken(end: End) -> None:
        ends.append(end)
        end.on_data = heard

    standing = WorldSystem(hub, {("10.0.0.1", 1): Host(hub, there, taken, back)}, {}, (0.0, 0.0))
    process = standing.new_process("client")

    def main() -> int:
        held = TcpConnection("10.0.0.1", 1, TIMEOUT_S)
        standing.sleep(SHORT_S)
        for at, (what, much) in enumerate(steps):
            if what == "other sends":
                if not ends[0].is_gone and not ends[0].is_over:
                    ends[0].send(b"y" * int(much))
            elif what in ("lose", "heal"):
                there.is_out = what == "lose"
            elif what == "other closes":
                ends[0].close()
            elif what == "other resets":
                ends[0].reset()
            else:
                _step(held, seen, at, what, much, standing.sleep)
        return 0

    with system.replaced_by(standing):
        process.begin(main)
        hub.run(1000.0, lambda: not standing.living)
    if hub.fallen:
        raise hub.fallen[0][1]
    return seen


def parent_script(seed: int) -> tuple[str, ...]:
    """What a program and somebody who asks do to a watchdog, and when it listens."""
    draw = random.Random(f"parent {seed}")
    return (*(draw.choice(_TO_PARENT) for _ in range(draw.randint(4, 12))), "next", "next")


_TO_PARENT = ("write", "write", "request", "next", "next", "close", "die")


def parent_on_linux(steps: tuple[str, ...]) -> list[object]:
    """What `hil.system.parent.Parent` hears."""
    heard: list[object] = []
    reading, writing = os.pipe()
    with subprocess.Popen(["sleep", "60"]) as program, closing(Parent[str](program.pid, reading, writing)) as parent:
        is_open = True
        for at, step in enumerate(steps):
            if step == "write" and is_open:
                os.write(writing, bytes([65 + at]))
            elif step == "request":
                parent.request(f"asked {at}")
            elif step == "close" and is_open:
                is_open = False
                os.close(writing)
            elif step == "die":
                program.kill()
                program.wait()
            elif step == "next":
                heard.append(parent.next(_SOON_S))
        program.kill()
        if is_open:
            os.close(writing)
        os.close(reading)
    return heard


def parent_in_world(steps: tuple[str, ...]) -> list[object]:
    """What its stand-in hears."""
    hub, heard = Hub(1), list[object]()
    standing = WorldSystem(hub, {}, {}, (0.0, 0.0))
    program, process, pipe = standing.new_process("program"), standing.new_process("watchdog"), Pipe(hub)

    def main() -> int:
        parent = ParentEnd(program, pipe, Pipe(hub), standing.call)
        for at, step in enumerate(steps):
            if step == "write" and pipe.writers:
                pipe.write(bytes([65 + at]), standing.call)
            elif step == "request":
                parent.request(f"asked {at}")
            elif step == "close":
                pipe.close_writer()
            elif step == "die":
                program.die(-9)
            elif step == "next":
                heard.append(parent.next(_SOON_S))
        return 0

    with system.replaced_by(standing):
        process.begin(main)
        hub.run(100.0, lambda: not process.lives)
    return heard


def _step(held: TcpConnection, seen: Seen, at: int, what: str, much: float, wait: Callable[[float], None]) -> None:
    if what == "send":
        _try(seen, at, lambda: (held.read(0.0), held.write(bytes([at + 1]) * int(much))))
    elif what == "wait":
        wait(much)
    elif what == "drop":
        _try(seen, at, held.drop)
    else:
        _try(seen, at, held.let_go)


def _try(seen: Seen, at: int, do: Callable[[], object]) -> None:
    try:
        do()
    except OSError:
        if at >= 0:
            seen.failed.append(at)


def main() -> int:
    """Compare, and list what differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.worlds.kernel", description=__doc__)
    parser.add_argument("-n", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    scripts = [script(seed) for seed in range(options.seed, options.seed + options.n)]
    with ThreadPoolExecutor(40) as pool:
        real = [*pool.map(on_linux, scripts)]
    differ = 0
    for seed, steps, linux in zip(range(options.seed, options.seed + options.n), scripts, real, strict=True):
        world = in_world(steps)
        if (linux.received, linux.failed) != (world.received, world.failed):
            differ += 1
            print(f"{seed}: {steps}\n   Linux {len(linux.received)} bytes, failed {linux.failed}\n"
                  f"   world {len(world.received)} bytes, failed {world.failed}")  # fmt: skip
    print(f"{options.n} scripts of TCP, {differ} differ")
    scripts_of_parent = [parent_script(seed) for seed in range(options.seed, options.seed + options.n)]
    others = [steps for steps in scripts_of_parent if parent_on_linux(steps) != parent_in_world(steps)]
    for steps in others:
        print(f"{steps}\n   Linux {parent_on_linux(steps)}\n   world {parent_in_world(steps)}")
    print(f"{options.n} scripts of a pipe and a process, {len(others)} differ")
    seeds = range(options.seed, options.seed + options.n)
    left = _compared("signals", map(signal_script, seeds), signals_on_linux, signals_in_world)
    left += _compared("a serial port", map(port_script, seeds), port_on_linux, port_in_world)
    return bool(differ or others or left)


def _compared(
    what: str, scripts: Iterable[Steps], linux: Callable[[Steps], object], world: Callable[[Steps], object]
) -> int:
    """How many differ, which are printed."""
    steps = [*scripts]
    with ThreadPoolExecutor(1 if what == "signals" else 40) as pool:
        both = zip(steps, pool.map(linux, steps), map(world, steps), strict=True)
        differ = [(one, real, ours) for one, real, ours in both if real != ours]
    for one, real, ours in differ:
        print(f"{one}\n   Linux {real}\n   world {ours}")
    print(f"{len(steps)} scripts of {what}, {len(differ)} differ")
    return len(differ)


if __name__ == "__main__":
    sys.exit(main())
