"""The code of rooms changed as they are imported: probes that tell which lines a world reaches, or one fault."""

from __future__ import annotations

import ast
import hashlib
import importlib.abc
import importlib.machinery
import importlib.util
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import CodeType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tests.worlds.schedule import drawn

if TYPE_CHECKING:
    from tests.worlds.world import Ran, World

ROOT = Path(__file__).parents[2]
ROOMS = (
    "hil/safety/guard.py", "hil/safety/outputs.py", "hil/safety/latch.py", "hil/safety/interrupt.py",
    "hil/safety/operator.py", "hil/safety/witness.py", "hil/bench/watchdog.py", "hil/bench/fail_safe_shutdown.py",
    "hil/bench/heartbeat.py", "hil/bench/ending.py", "hil/bench/open.py", "hil/bench/lease.py",
    "hil/bench/stop/stop_service.py", "hil/bench/recorder.py", "hil/record/run_folder/run_writer.py",
    "hil/system/tcp.py",
    "hil/daq/device_link.py", "hil/daq/link.py", "hil/daq/polled.py", "hil/daq/polling.py", "drivers/_meeting.py",
    "drivers/_modbus_line.py", "drivers/_modbus_link.py", "drivers/_modbus_ready.py", "drivers/_ports.py",
    "drivers/_shared_port.py", "drivers/_line.py", "drivers/_text_link.py", "drivers/ascii_module.py",
    "drivers/scpi.py", "drivers/_can_frames.py", "drivers/_can_messages.py", "drivers/can.py", "drivers/j1939_valve.py",
    "drivers/_sdo.py", "drivers/_canopen_node.py", "drivers/canopen.py",
)  # fmt: skip
_BATCH, _KEPT = 100, 120
Place = tuple[str, int]


class Reached(NamedTuple):
    """Seeds of worlds that reach each line, and the course of every world (see `course`)."""

    seeds: dict[Place, list[int]]
    courses: dict[int, str]


class Planted(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives modules their other code.

    Args:
        codes: by the name of the module.
        more: what this code finds among its globals.
    """

    def __init__(self, codes: Mapping[str, CodeType], more: Mapping[str, Any]) -> None:
        self._codes, self._more = codes, more
        sys.meta_path.insert(0, self)

    def find_spec(self, name: str, path: Any = None, _target: ModuleType | None = None) -> Any:
        if name not in self._codes:
            return None
        found = importlib.machinery.PathFinder.find_spec(name, path)
        return importlib.util.spec_from_loader(name, self, origin=found.origin if found else None)

    def exec_module(self, module: ModuleType) -> None:
        module.__dict__.update(self._more)
        exec(self._codes[module.__name__], module.__dict__)


def module_of(room: str) -> str:
    """By which name it is imported."""
    return room.removesuffix(".py").replace("/", ".")


def blocks(tree: ast.Module) -> Iterator[tuple[ast.FunctionDef, list[ast.stmt]]]:
    """The statements of functions, block by block, each with its innermost function."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            inner = {id(one) for f in ast.walk(function) if isinstance(f, ast.FunctionDef) and f is not function
                     for one in ast.walk(f)}  # fmt: skip
            for node in ast.walk(function):
                for name in ("body", "orelse", "finalbody"):
                    body = getattr(node, name, None)
                    if isinstance(body, list) and body and id(node) not in inner:
                        yield function, body


def _probed(room: str) -> CodeType:
    tree = ast.parse((ROOT / room).read_text(encoding="utf-8"))
    for _, body in [*blocks(tree)]:
        for statement in [*body]:
            probe = ast.parse(f"_reached.add(({room!r}, {statement.lineno}))").body[0]
            body.insert(body.index(statement), ast.copy_location(probe, statement))
    return compile(ast.fix_missing_locations(tree), room, "exec")


def course(world: World, ran: Ran) -> str:
    """What devices, files and other processes have of a world: a digest of all but words for people.

    Where outputs stood and when, how and when each process ended, what was said of each output, and what was recorded.
    """
    from tests.worlds.left import end_of, recording_of

    recording, end = recording_of(world), end_of(world)
    words = [(word.by, word.at_s, word.safe, word.states) for word in ran.words]
    ends = [(process.name, process.status, process.ended_s) for process in world.system.processes]
    found: list[object] = [ran.changes, ends, words, ran.blocks, end.get("rows"), end.get("outputs")]
    if recording is not None:
        found += [(name, channel.unit, channel.values.tobytes()) for name, channel in recording.channels.items()]
        found += [recording.time_s.tobytes(), [event["event"] for event in recording.meta["events"]]]
    return hashlib.sha256(repr(found).encode()).hexdigest()[:16]


def reach(worlds: int, jobs: int) -> Path:
    """A file that says which of so many worlds reach each line, and what course they take (see `reached_in`).

    Found once for these sources, and kept.
    """
    sources = [*(ROOT / room for room in ROOMS), *sorted(Path(__file__).parent.glob("*.py"))]
    key = hashlib.sha256(b"".join(path.read_bytes() for path in sources) + bytes(str(worlds), "ascii")).hexdigest()
    kept = Path(tempfile.gettempdir(), f"worlds-reach-{key[:16]}.json")
    if not kept.exists():
        found, courses = defaultdict[str, list[int]](list), dict[int, str]()
        with ThreadPoolExecutor(jobs) as pool:
            for lines in pool.map(lambda first: _batch_of(first, worlds), range(0, worlds, _BATCH)):
                for line in lines:
                    seed, courses[int(seed)], *places = line.split("\t")
                    for place in places:
                        found[place].append(int(seed))
        alone = {seed for seed in range(worlds) if len(drawn(seed).faults) == 1}
        turn = {seed: at for at, seed in enumerate(_rarest_first(found, worlds))}
        seeds = {place: _mixed(sorted(seeds, key=turn.__getitem__), alone) for place, seeds in found.items()}
        kept.write_text(json.dumps({"seeds": seeds, "courses": courses}), encoding="utf-8")
    return kept


def reached_in(kept: Path) -> Reached:
    """What stands in such a file. Worlds with one fault come every other time: of them more is known."""
    content = json.loads(kept.read_text(encoding="utf-8"))
    seeds = {
        (place.partition(":")[0], int(place.partition(":")[2])): seeds for place, seeds in content["seeds"].items()
    }
    return Reached(seeds, {int(seed): digest for seed, digest in content["courses"].items()})


def _rarest_first(found: Mapping[str, list[int]], worlds: int) -> list[int]:
    """Every world, the one first that reaches most of what was reached least so far: each time counts half as much."""
    reaches = np.zeros((worlds, len(found)), dtype=np.float32)
    for at, seeds in enumerate(found.values()):
        reaches[seeds, at] = 1.0
    worth, left, order = np.ones(len(found), dtype=np.float32), np.ones(worlds, dtype=bool), list[int]()
    for _ in range(worlds):
        best = int(np.argmax(np.where(left, reaches @ worth, -1.0)))
        order.append(best)
        left[best] = False
        worth *= 1.0 - 0.5 * reaches[best]
    return order


def _mixed(seeds: list[int], those_with_one: set[int]) -> list[int]:
    alone = [seed for seed in seeds if seed in those_with_one]
    others = [seed for seed in seeds if seed not in those_with_one]
    both = [seed for pair in zip(alone, others, strict=False) for seed in pair]
    return [*both, *alone[len(others) :], *others[len(alone) :]][:_KEPT]


def _batch_of(first: int, worlds: int) -> list[str]:
    words = [sys.executable, "-m", "tests.worlds.planted", str(first), str(min(first + _BATCH, worlds))]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()


def main(first: str, end: str) -> int:
    """Print the course of each of these worlds, and the lines that it reaches."""
    reached: set[Place] = set()
    Planted({module_of(room): _probed(room) for room in ROOMS}, {"_reached": reached})
    from tests.worlds.judge import judge
    from tests.worlds.world import one

    for seed in range(int(first), int(end)):
        reached.clear()
        took = list[str]()
        one(drawn(seed), lambda world, ran, took=took: (judge(world, ran), took.append(course(world, ran))))
        print("\t".join((str(seed), *took, *(f"{room}:{line}" for room, line in sorted(reached)))), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
