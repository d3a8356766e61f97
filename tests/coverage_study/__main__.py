"""`python -m tests.coverage_study`: the study, its table on a page, and what falls short."""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path

from tests.coverage_study.cases import CASES, WITHOUT_TRUTH
from tests.coverage_study.study import Outcome, keep, kept, tried
from tests.coverage_study.table import short, table

_BEGIN, _END = "<!-- coverage: begin -->", "<!-- coverage: end -->"


def main() -> None:
    """Run it."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seeds", type=int, default=300)
    asked.add_argument("--first", type=int, default=1000)
    asked.add_argument("--only", default="", help="part of `procedure bench`")
    asked.add_argument("--situation", default="", help="part of a situation's name")
    asked.add_argument("--limit-s", type=float, default=math.inf, help="processor time of each case and situation")
    asked.add_argument("--keep", type=Path, help="folder of outcomes: what is there is not run again")
    asked.add_argument("--page", type=Path, help="Markdown page to put the table into")
    asked.add_argument("--brief", action="store_true", help="only what falls short")
    given = asked.parse_args()
    outcomes: list[Outcome] = []
    said = (lambda _text: None) if given.brief else _say
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            if given.only not in f"{case.procedure} {case.bench}":
                continue
            for situation in case.situations:
                if given.situation not in situation.name:
                    continue
                name = f"{case.procedure}-{case.bench}-{situation.name.replace(' ', '-')}"
                file = None if given.keep is None else given.keep / f"{name}.json"
                found = None if file is None else kept(file, case, situation)
                if found is None:
                    seeds = range(given.first, given.first + given.seeds)
                    found = tried(case, situation, seeds, Path(folder) / name, said, given.limit_s)
                    if file is not None:
                        keep(file, found)
                outcomes.append(found)
    made = table(outcomes)
    if not given.brief:
        print(made)
    print("\n".join(short(outcomes)) or "every figure holds")
    for one in outcomes:
        for name in sorted(one.strange):
            if name.partition(", ")[0] not in WITHOUT_TRUTH:
                print(f"no truth: {one.case.procedure} on {one.case.bench}, {one.situation.name}: {name}")
    if given.page:
        text = given.page.read_text(encoding="utf-8")
        before, _, rest = text.partition(_BEGIN)
        _, _, after = rest.partition(_END)
        given.page.write_text(f"{before}{_BEGIN}\n\n{made}\n{_END}{after}", encoding="utf-8")


def _say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    main()
