"""What each number of `Criteria` decides: `python -m tests.studies.criteria FOLDER`, a study's, with its answers.

Every table that was printed is read again with one number halved or doubled, and the gate before it. Nothing is fitted
again, and a table lists its best twelve rows: what is counted is the least that a number decides.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import hil.diagnosis.verdict.score as score
from hil.diagnosis.criteria import CRITERIA, Criteria
from hil.diagnosis.verdict.score import UNKNOWN, Hypothesis, Noise, table

Said = tuple[str, frozenset[str], frozenset[str]]
"""Verdict, what is named, and what is in the set."""


def hypotheses(printed: Mapping[str, Any]) -> Iterator[Hypothesis]:
    """The sets of causes of a printed table, each once, with the χ² that leaves what is printed; and χ₀²."""
    noise, found = printed["noise_chi2"], dict[tuple[str, ...], Hypothesis]()
    for row in printed["rows"]:
        names = tuple(name for name in row["name"].split(" + ") if name not in (UNKNOWN, "nothing"))
        is_open = UNKNOWN in row["name"]
        left = row["left"] / CRITERIA.unknown if is_open else row["left"]
        causes, unknowns = row["causes"] - is_open, row["unknowns"] - CRITERIA.unknowns * is_open
        found.setdefault(names, Hypothesis(names, noise * (1.0 + left / printed["count"]), causes, unknowns))
    yield from (*found.values(), Hypothesis(("least",), noise, causes=len(printed["rows"]), unknowns=0))


def said(answer: Mapping[str, Any]) -> Said:
    """What is said of a unit by its gate and its table, with the criteria as they are."""
    gate, printed = answer["gate"], answer["table"]
    if gate and gate["z"] < max(score.CRITERIA.alarm, *gate["pseudo_tests"]):
        return "consistent", frozenset(), frozenset()
    if printed is None:
        return "unexplained", frozenset(), frozenset()
    noise = Noise(printed["count"], 0.0, float("inf"), printed["samples"], printed["searched"])
    read = table(noise, hypotheses(printed))
    read = read.without("consistent") if gate else read
    names = frozenset(read.first.hypothesis.named)
    return read.first.verdict, names, frozenset(n for row in read.ambiguous for n in row.hypothesis.named) - {"least"}


def main(folder: Path) -> None:
    """Print how many answers change with each number."""
    answers = [json.loads(path.read_text("utf-8")) for path in sorted(folder.glob("*/*/diagnosis.json"))]
    before = [said(answer) for answer in answers]
    print(f"{len(answers)} answers, {sum(verdict != 'consistent' for verdict, *_ in before)} beyond the gate")
    for name in Criteria.__slots__:
        for factor in (0.5, 2.0):
            score.CRITERIA = replace(CRITERIA, **{name: factor * getattr(CRITERIA, name)})
            pairs = list(zip(before, map(said, answers), strict=True))
            changed = [sum(old[k] != new[k] for old, new in pairs) for k in range(3)]
            print(f"{name:9} × {factor}: verdicts {changed[0]}, names {changed[1]}, sets {changed[2]}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
