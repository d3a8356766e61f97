"""`python -m tests.coverage_study`: the study, its table on a page, and what falls short."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from tests.coverage_study.cases import CASES, WITHOUT_TRUTH
from tests.coverage_study.study import tried
from tests.coverage_study.table import short, table

_BEGIN, _END = "<!-- coverage: begin -->", "<!-- coverage: end -->"


def main() -> None:
    """Run it."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seeds", type=int, default=300)
    asked.add_argument("--first", type=int, default=1000)
    asked.add_argument("--only", default="", help="part of `procedure bench`")
    asked.add_argument("--situation", default="", help="part of a situation's name")
    asked.add_argument("--page", type=Path, help="Markdown page to put the table into")
    asked.add_argument("--brief", action="store_true", help="only what falls short")
    given = asked.parse_args()
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            if given.only not in f"{case.procedure} {case.bench}":
                continue
            for situation in case.situations:
                if given.situation in situation.name:
                    at = Path(folder) / f"{case.procedure}-{case.bench}-{situation.name.replace(' ', '-')}"
                    said = (lambda _text: None) if given.brief else print
                    outcomes.append(tried(case, situation, range(given.first, given.first + given.seeds), at, said))
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


if __name__ == "__main__":
    main()
