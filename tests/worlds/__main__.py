"""Draw worlds, or show one by its code; status 1 where an invariant does not hold."""

from __future__ import annotations

import argparse
import collections
import itertools
import os
import subprocess
import sys
import time

from tests.worlds.judge import judge
from tests.worlds.schedule import KINDS, PHASES, THIRDS, Schedule, drawn, kinds_with
from tests.worlds.shrink import shrunk
from tests.worlds.world import Ran, one

_BATCH = 100  # worlds of one process: what a killed run holds is never let go of


def main() -> int:
    """Do what was asked."""
    options = _options()
    if options.code:
        ran = one(Schedule.of(options.code), judge)
        _show(ran)
        return bool(ran.broken)
    first = options.seed if options.seed is not None else _of_commit()
    broken, took = 0, collections.Counter[str]()
    begun_s = time.process_time() + sum(os.times()[2:4])
    for lines in _batches(range(first, first + options.n), options.jobs):
        for line in lines:
            kind, _, rest = line.partition("\t")
            if kind == "broken":
                broken += not rest.startswith(" ")
                print(rest, flush=True)
            else:
                took[rest] += 1
    spent_s = time.process_time() + sum(os.times()[2:4]) - begun_s
    print(
        f"{options.n} worlds, {broken} broken; {options.n / spent_s * 3600.0:,.0f} a processor-hour; seeds from {first}"
    )
    _coverage(took, options.missing)
    return bool(broken)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.worlds", description=__doc__)
    parser.add_argument("code", nargs="?", help="a schedule, as it was printed")
    parser.add_argument("-n", type=int, default=200, help="so many worlds (200)")
    parser.add_argument("--seed", type=int, help="of the first; from the commit's hash if not given")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time (2)")
    parser.add_argument("--missing", action="store_true", help="list pairs of kinds that never happened in a phase")
    parser.add_argument("--batch", nargs=2, type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.batch:
        _batch(range(*options.batch))
        sys.exit(0)
    return options


def _of_commit() -> int:
    said = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout
    return int(said[:7], 16)


def _batches(seeds: range, jobs: int) -> collections.abc.Iterator[list[str]]:
    """What each batch printed; so many at a time."""
    waiting = [seeds[i : i + _BATCH] for i in range(0, len(seeds), _BATCH)]
    running: collections.deque[subprocess.Popen[str]] = collections.deque()
    while waiting or running:
        while waiting and len(running) < jobs:
            part = waiting.pop(0)
            words = [sys.executable, "-m", "tests.worlds", "--batch", str(part.start), str(part.stop)]
            running.append(subprocess.Popen(words, stdout=subprocess.PIPE, text=True))
        process = running.popleft()
        out, _ = process.communicate()
        if process.returncode:
            raise SystemExit(f"a batch ended with status {process.returncode}")
        yield out.splitlines()


def _batch(seeds: range) -> None:
    for seed in seeds:
        ran = one(drawn(seed), judge)
        if ran.broken:
            small = shrunk(ran.schedule, lambda other, laws=ran.laws: bool(laws & one(other, judge).laws))  # type: ignore[misc]
            texts = [f"python -m tests.worlds '{small.code}'", *(f"    {text}" for text in one(small, judge).broken),
                     f"    shrunk from '{ran.schedule.code}'"]  # fmt: skip
            print("\n".join(f"broken\t{text}" for text in texts), flush=True)
        for (fault, phase), (other, _) in itertools.combinations(ran.took, 2):
            print(f"took\t{'+'.join(sorted((fault.kind, other.kind)))}\t{phase}")


def _coverage(took: collections.Counter[str], missing: bool) -> None:
    """How many of all pairs of kinds happened in each phase of a run, and which classes of pairs never did."""
    classes: collections.Counter[str] = collections.Counter()
    for line, count in took.items():
        pair, phase = line.split("\t")
        classes["+".join(sorted(KINDS[kind] for kind in pair.split("+"))) + " " + phase] += count
    every = {pair for third in ("", *THIRDS.values())
             for pair in itertools.combinations_with_replacement(sorted(kinds_with(third)), 2)}  # fmt: skip
    left = sorted(f"{'+'.join(pair)}, {phase}" for pair in every for phase in PHASES
                  if f"{'+'.join(pair)}\t{phase}" not in took)  # fmt: skip
    for phase in PHASES:
        reached = sum(line.endswith("\t" + phase) for line in took)
        print(f"{phase}: {reached} of {len(every)} pairs of kinds that can meet")
    if missing:
        print("\n".join(f"never: {text}" for text in left))
    pairs = {"+".join(sorted((KINDS[one], KINDS[other]))) for one, other in every}
    reached = len({line for line in classes if classes[line]})
    print(f"{reached} of {len(pairs) * len(PHASES)} pairs of classes, a class and a phase each")


def _show(ran: Ran) -> None:
    print(f"status {ran.status} after {ran.ended_s:.3f} s, {ran.calls} calls of the seam")
    for fault, phase in ran.took:
        print(f"  {fault.kind} {fault.device} for {fault.lasts_s:g} s, {phase}")
    for at_s, by, text in ran.said:
        print(f"{at_s:9.4f}  {by}: {text}")
    for output, changes in ran.changes.items():
        print(f"{output}: " + " ".join(f"{at_s:.3f}:{at:.1f}" for at_s, at in changes[-12:]))
    print("\n".join(f"BROKEN {text}" for text in ran.broken) or "holds")


if __name__ == "__main__":
    sys.exit(main())
