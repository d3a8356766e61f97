"""Faults planted in the code that acts, one at a time: how many of them the worlds find.

    python -m tests.worlds.mutants --seed 1 -n 200 --seconds 60

Each is drawn by one of five operators over all lines of the rooms below. One that fails the world without any fault
does not count. It is found when an invariant is broken in a drawn world, within its processor time.
"""

from __future__ import annotations

import argparse
import ast
import collections
import importlib.abc
import importlib.machinery
import importlib.util
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

ROOT = Path(__file__).parents[2]
ROOMS = (
    "hil/safety/guard.py", "hil/safety/outputs.py", "hil/safety/latch.py", "hil/safety/interrupt.py",
    "hil/safety/operator.py", "hil/safety/witness.py", "hil/bench/watchdog.py", "hil/bench/rescue.py",
    "hil/bench/heartbeat.py", "hil/bench/ending.py", "hil/bench/open.py", "hil/bench/lease.py",
    "hil/bench/stop/stop_service.py", "hil/bench/recorder.py", "hil/record/run_writer.py", "hil/system/tcp.py",
    "hil/daq/device_link.py", "hil/daq/link.py", "hil/daq/polled.py", "hil/daq/polling.py", "drivers/_meeting.py",
    "drivers/_modbus_line.py", "drivers/_modbus_link.py", "drivers/_modbus_ready.py", "drivers/_ports.py",
)  # fmt: skip
OPERATORS = ("line left out", "condition turned", "order changed", "stale value", "mend taken back")
_SIMPLE = (ast.Expr, ast.Assign, ast.AugAssign, ast.AnnAssign, ast.Raise, ast.Delete)
_MENDS = 60  # commits of a file that are looked at
DOES_NOT_COUNT, FOUND, MISSED = 10, 11, 12


def main() -> int:
    """Draw them, try them, and count."""
    options = _options()
    if options.one:
        return _try(*options.one, options.seconds, options.seed)
    draw = random.Random(options.seed)
    counts: collections.Counter[str] = collections.Counter()
    with ThreadPoolExecutor(options.jobs) as pool:
        tried = 0
        while tried < options.n:
            drawn = [_drawn(draw) for _ in range(min(2 * options.jobs, options.n - tried))]
            for mutant, (status, line) in zip(drawn, pool.map(lambda one: _status(one, options), drawn), strict=True):
                if status == DOES_NOT_COUNT:
                    counts["does not count"] += 1
                    continue
                tried += 1
                how = "found" if status == FOUND else "missed"
                counts[how] += 1
                print(f"{how:7} {mutant[0]} {mutant[1]} {mutant[2]}: {line}", flush=True)
    print(dict(counts))
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.worlds.mutants", description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="so many that count (200)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--seconds", type=float, default=60.0, help="processor time of each (60)")
    parser.add_argument("--jobs", type=int, default=2, help="at a time (2)")
    parser.add_argument("--one", nargs=3, metavar=("FILE", "OPERATOR", "NUMBER"), help="one of them")
    return parser.parse_args()


def _drawn(draw: random.Random) -> tuple[str, str, str]:
    """A file by its number of lines, an operator, and a number that chooses the place."""
    files = [(ROOT / room, room) for room in ROOMS]
    room = draw.choices([name for _, name in files], [len(path.read_text().splitlines()) for path, _ in files])[0]
    return room, draw.choice(OPERATORS), str(draw.randrange(1 << 30))


def _status(mutant: tuple[str, str, str], options: argparse.Namespace) -> tuple[int, str]:
    words = [sys.executable, "-m", "tests.worlds.mutants", "--one", *mutant, "--seconds", str(options.seconds),
             "--seed", str(options.seed)]  # fmt: skip
    done = subprocess.run(
        words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=20.0 * options.seconds + 120
    )
    lines = done.stdout.splitlines() or [""]
    if done.returncode not in (DOES_NOT_COUNT, FOUND, MISSED):  # what does not even begin is no mutant
        return DOES_NOT_COUNT, (done.stderr.splitlines() or [""])[-1]
    return done.returncode, lines[-1]


def _try(room: str, operator: str, number: str, seconds: float, seed: int) -> int:
    """In a process of its own: plant it, and let worlds go by."""
    source = (ROOT / room).read_text(encoding="utf-8")
    planted = mutated(source, operator, int(number), room)
    if planted is None:
        return DOES_NOT_COUNT
    code, what = planted
    sys.meta_path.insert(0, _Planted(room.removesuffix(".py").replace("/", "."), code))
    from tests.worlds.judge import judge
    from tests.worlds.schedule import Schedule, drawn
    from tests.worlds.world import one

    for procedure in ("plain", "steps"):
        sound = one(Schedule(0, procedure=procedure), judge)
        if sound.broken or sound.status != 0:
            return DOES_NOT_COUNT
    begun_s, at = time.process_time(), random.Random(seed).randrange(1 << 40)
    while time.process_time() - begun_s < seconds:
        ran = one(drawn(at), judge)
        if ran.broken:
            print(f"{what}; {ran.broken[0]} ({ran.schedule.code})")
            return FOUND
        at += 1
    print(what)
    return MISSED


class _Planted(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives one module its other code."""

    def __init__(self, name: str, code: CodeType) -> None:
        self._name, self._code = name, code

    def find_spec(self, name: str, path: Any = None, _target: ModuleType | None = None) -> Any:
        if name != self._name:
            return None
        found = importlib.machinery.PathFinder.find_spec(name, path)
        return importlib.util.spec_from_loader(name, self, origin=found.origin if found else None)

    def exec_module(self, module: ModuleType) -> None:
        exec(self._code, module.__dict__)


def mutated(source: str, operator: str, number: int, room: str) -> tuple[CodeType, str] | None:
    """The code of a file with one fault in it, and what that is; None where the operator finds no place."""
    if operator == "mend taken back":
        return _taken_back(source, number, room)
    tree = ast.parse(source)
    places = [*_PLACES[operator](tree)]
    if not places:
        return None
    plant, line = places[number % len(places)]
    plant()
    text = source.splitlines()[line - 1].strip()
    return compile(ast.fix_missing_locations(tree), room, "exec"), f"{operator} at {room}:{line} `{text}`"


Place = tuple[Callable[[], None], int]


def _bodies(tree: ast.Module) -> Iterator[list[ast.stmt]]:
    """The statements of functions, block by block."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for node in ast.walk(function):
                for name in ("body", "orelse", "finalbody"):
                    if isinstance(body := getattr(node, name, None), list) and body and node is not tree:
                        yield body


def _unique(bodies: Iterator[list[ast.stmt]]) -> list[list[ast.stmt]]:
    return list({id(body): body for body in bodies}.values())


def _left_out(tree: ast.Module) -> Iterator[Place]:
    for body in _unique(_bodies(tree)):
        for at, statement in enumerate(body):
            is_text = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
            if isinstance(statement, _SIMPLE) and not is_text:

                def plant(body: list[ast.stmt] = body, at: int = at) -> None:
                    body[at] = ast.copy_location(ast.Pass(), body[at])

                yield plant, statement.lineno


def _turned(tree: ast.Module) -> Iterator[Place]:
    for node in ast.walk(tree):
        if isinstance(node, ast.If | ast.While | ast.IfExp) and not isinstance(node.test, ast.Constant):

            def plant(node: ast.If | ast.While | ast.IfExp = node) -> None:
                node.test = ast.copy_location(ast.UnaryOp(ast.Not(), node.test), node.test)

            yield plant, node.lineno


def _swapped(tree: ast.Module) -> Iterator[Place]:
    for body in _unique(_bodies(tree)):
        for at in range(len(body) - 1):
            pair = body[at : at + 2]
            if all(isinstance(one, _SIMPLE) and not _is_text(one) for one in pair):

                def plant(body: list[ast.stmt] = body, at: int = at) -> None:
                    body[at], body[at + 1] = body[at + 1], body[at]

                yield plant, pair[0].lineno


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _stale(tree: ast.Module) -> Iterator[Place]:
    """A value is that of the call before."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Return | ast.Assign) and isinstance(node.value, ast.Call | ast.BinOp | ast.Attribute):

            def plant(node: ast.Return | ast.Assign = node) -> None:
                kept = f"_kept_{node.lineno}_{node.col_offset}"
                tree.body.insert(1, ast.parse(f"{kept} = []").body[0])
                value = ast.parse(f"({kept}.append(0), {kept}[max(-2, -len({kept}))])[1]", mode="eval").body
                assert isinstance(value, ast.Subscript) and isinstance(value.value, ast.Tuple)
                append = value.value.elts[0]
                assert isinstance(append, ast.Call)
                append.args = [node.value]  # type: ignore[list-item]
                node.value = value

            yield plant, node.lineno


_PLACES: dict[str, Callable[[ast.Module], Iterator[Place]]] = {
    "line left out": _left_out, "condition turned": _turned, "order changed": _swapped, "stale value": _stale,
}  # fmt: skip


def _taken_back(source: str, number: int, room: str) -> tuple[CodeType, str] | None:
    """A piece of an earlier commit, where what it made still stands as it made it."""
    log = _git("log", f"-{_MENDS}", "--format=%h", "--", room).split()
    found: list[tuple[str, str]] = []
    for commit in log:
        shown = _git("show", "--format=", "-U1", commit, "--", room)
        for hunk in re.split(r"^@@.*@@.*$", shown, flags=re.MULTILINE)[1:]:
            lines = hunk.strip("\n").splitlines()
            made, before = (_side(lines, drop) for drop in "-+")
            is_moved = "system." in made and "system." not in before  # the seam itself: what it took away is not there
            if made != before and not is_moved and source.count(made) == 1 and len(made.strip()) > 40:
                other = source.replace(made, before)
                try:
                    compile(other, room, "exec")
                except SyntaxError:
                    continue
                if ast.dump(ast.parse(other)) != ast.dump(ast.parse(source)):
                    found.append((commit, other))
    if not found:
        return None
    commit, other = found[number % len(found)]
    return compile(other, room, "exec"), f"a piece of {commit} taken back in {room}"


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def _side(lines: Sequence[str], drop: str) -> str:
    return "\n".join(line[1:] for line in lines if not line.startswith((drop, "\\")))


if __name__ == "__main__":
    sys.exit(main())
