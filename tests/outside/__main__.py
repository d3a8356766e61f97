"""Every outage with every ending, the named cases, and drawn combinations; a table, and status 1 on a contradiction."""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from tests.outside.judge import Seen
from tests.outside.situations import Situation, drawn, named, outages
from tests.outside.watch import watched


def chosen(words: list[str]) -> argparse.Namespace:
    """What was asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.outside", description=__doc__)
    parser.add_argument(
        "--seeds", nargs=2, type=int, metavar=("FROM", "TO"), help="drawn combinations; TO is none of them"
    )
    parser.add_argument("--drawn", type=int, metavar="N", help="N combinations, the first seed from the commit's hash")
    parser.add_argument("--only", default="", metavar="TEXT", help="only situations with this in their name")
    parser.add_argument(
        "--watch", type=float, default=30.0, metavar="S", help="how long after the last word (default 30)"
    )
    parser.add_argument("--jobs", type=int, default=4, metavar="N", help="so many at a time (4)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="every row as a line of JSON")
    parser.add_argument("--list", action="store_true", help="names alone")
    return parser.parse_args(words)


def situations(told: argparse.Namespace) -> list[Situation]:
    """Those that were asked for."""
    first, last = told.seeds or (0, 0)
    if told.drawn:
        commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout
        first = int(commit[:7], 16)
        last = first + told.drawn
    every = [*outages(), *named(), *map(drawn, range(first, last))]
    return [one for one in every if told.only in one.name]


def row(seen: Seen) -> str:
    """A line of the table."""
    away = "–" if seen.away_s is None else f"{seen.away_s - seen.begun_s:.2f}"
    what = f"NOT RUN: {seen.not_run}" if seen.not_run else "; ".join(seen.wrong) or "so"
    return f"| {seen.name} | {seen.status} | {away} | {seen.stands:.1f} | {what} |"


def main() -> int:
    """Do it all and count."""
    told = chosen(sys.argv[1:])
    every = situations(told)
    if told.list:
        print("\n".join(one.name for one in every))
        return 0
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # of a shell that runs it in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)
    print("| what was done | exit status | away until [s] | stands [%] | what is said is |\n|---|---|---|---|---|")
    found: list[Seen] = []
    with ThreadPoolExecutor(told.jobs) as pool:
        for seen in pool.map(lambda one: watched(one, told.watch), every):
            found.append(seen)
            print(row(seen), flush=True)
            if told.out is not None:
                with told.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({**asdict(seen), "killed": sorted(seen.killed)}, ensure_ascii=False) + "\n")
    wrong, not_run = sum(bool(seen.wrong) for seen in found), sum(bool(seen.not_run) for seen in found)
    print(f"{len(found)} situations: {wrong} contradictions, {not_run} not run, watched for {told.watch:g} s")
    return 1 if wrong or not_run > 0.02 * len(found) else 0


if __name__ == "__main__":
    sys.exit(main())
