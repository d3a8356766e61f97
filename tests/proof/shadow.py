"""`python -m tests.proof.shadow OUT...`: the decision and the one score beside it, on the cases of proofs.

`OUT` is the folder of a proof (`python -m tests.proof --out OUT`), whose truths were sealed before any diagnosis.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from .cases.label import NOTHING, PAIR, PARAMETER, THREE
from .cases.truth import Truth, from_json
from .score import result
from .score.judge import WRONG, Judgement, judge

START, STOP = "<!-- shadow: python -m tests.proof.shadow -->", "<!-- end of shadow -->"
_GROUPS = {
    "quantisation": "coarse channels", "dropout": "lost commands", PAIR: "pairs", THREE: "three at once",
    PARAMETER: "changed units", NOTHING: "nothing concealed",
}  # fmt: skip
_SINGLE, _WEAK, _FOREIGN = "single effects", "single effects, a quarter as strong", "foreign laws"
_ROWS = (_SINGLE, _WEAK, *_GROUPS.values(), _FOREIGN)


@dataclass(frozen=True, slots=True)
class Both:
    """A case, how it was decided, and how the score would have."""

    truth: Truth
    now: Judgement
    shadow: Judgement

    @property
    def group(self) -> str:
        """The row that it belongs to."""
        single = _SINGLE if self.truth.label.severity == "full" else _WEAK
        return _GROUPS.get(self.truth.label.kind, single if self.truth.listed else _FOREIGN)


def cases(out: Path) -> Iterator[Both]:
    """The cases that were diagnosed and show enough to be asked for."""
    for path in sorted((out / "results").glob("*.json")):
        if not (kept := out / "kept" / path.stem / "diagnosis.json").is_file() or not result.read(path).visible:
            continue
        truth = from_json((out / "truth" / path.name).read_text())
        diagnosis = json.loads(kept.read_text())
        yield Both(truth, judge(truth, diagnosis), judge(truth, _by_score(diagnosis["shadow"])))


def _by_score(shadow: Mapping[str, Any]) -> dict[str, Any]:
    named = zip(shadow["names"], shadow["probabilities"], strict=True)
    return {"verdict": shadow["verdict"], "effects": [{"name": name, "probability": p} for name, p in named]}


def brier(judged: Sequence[tuple[Truth, Judgement]]) -> float:
    """Mean square of a name's probability less whether it is right; not a number without names."""
    scores = [(p - (name in truth.effects and truth.label.kind != PARAMETER)) ** 2
              for truth, j in judged for name, p in zip(j.named, j.probabilities, strict=True)]  # fmt: skip
    return sum(scores) / len(scores) if scores else float("nan")


def table(found: Sequence[Both]) -> str:
    """What either says, by kind of case, and every case on which they differ."""
    rows = ["| cases | number | right now | right by the score | wrong names now | by the score |",
            "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for group in _ROWS:
        own = [b for b in found if b.group == group]
        wrong = [sum(j.said == WRONG or bool(j.named and not b.truth.listed) for b, j in pairs)
                 for pairs in ([(b, b.now) for b in own], [(b, b.shadow) for b in own])]  # fmt: skip
        right = [sum(b.now.right for b in own), sum(b.shadow.right for b in own)]
        rows.append(f"| {group} | {len(own)} | {right[0]} | {right[1]} | {wrong[0]} | {wrong[1]} |")
    scores = [brier([(b.truth, b.now) for b in found]), brier([(b.truth, b.shadow) for b in found])]
    rows += ["", f"Brier score of the probabilities of names: {scores[0]:.3f} now, {scores[1]:.3f} by the score.", ""]
    rows += ["| case on which they differ | now | by the score |", "| --- | --- | --- |"]
    rows += [f"| {b.truth.label} | {_told(b.now)} | {_told(b.shadow)} |" for b in found
             if (b.now.verdict, set(b.now.named)) != (b.shadow.verdict, set(b.shadow.named))]  # fmt: skip
    return "\n".join(rows)


def _told(j: Judgement) -> str:
    names = " + ".join(name.replace("_", " ") for name in j.named)
    return f"{j.verdict.replace('_', ' ')}{': ' if names else ''}{names}{'' if j.right else ' ✗'}"


def main(
    out: list[Path] = typer.Argument(..., help="Folders of proofs."),
    page: Path | None = typer.Option(None, help="Page of documentation to put the table into."),
) -> None:
    """Set both verdicts side by side."""
    made = table([case for folder in out for case in cases(folder)])
    print(made)
    if page is not None:
        before, _, rest = page.read_text(encoding="utf-8").partition(START)
        page.write_text(f"{before}{START}\n\n{made}\n\n{STOP}{rest.partition(STOP)[2]}", encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
