"""Run a proof: draw and seal all cases, then have them diagnosed and score them; what is done is kept on disk."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tests.studies.jobs import finished

from .cases.draw import draw
from .cases.label import Label, parse
from .cases.seal import publish, read
from .cases.truth import to_json
from .diagnosers import Diagnoser
from .examine import examine
from .score import result
from .score.result import Result

Progress = Callable[[str, int, int], None]
"""Told what is being done, how much of it is done, and of how much."""


class OtherSealsError(ValueError):
    """Results are of other cases."""


def prove(
    labels: Sequence[Label],
    seed: int,
    out: Path,
    diagnoser: Diagnoser,
    jobs: int,
    progress: Progress,
    every: int = 1,
    begin_until_s: float = math.inf,
    known: Path | None = None,
) -> tuple[list[Result], str]:  # fmt: skip
    """Return the results of all cases and the fingerprint of their seals.

    `every`: hand over every so-manyth recording only. A proof that was stopped goes on where it was: truths and
    results on disk are not made again.
    `begin_until_s`: no case is begun after this `time.time()`; the results are of the cases that were. Their order
    is mixed, so that those of a proof that ran out of time are a fair sample.
    `known`: `proof.json` of an earlier run; its results count and are not made again.

    Raises:
        OtherSealsError: `known` was made with other seals.
    """
    for name in ("truth", "results", "kept"):
        (out / name).mkdir(parents=True, exist_ok=True)
    sealed = {str(label): out / "truth" / f"{label}.json" for label in labels}
    missing = [(seed, name, path) for name, path in sealed.items() if not path.exists()]
    _parallel(_draw, missing, jobs, "sealing", progress)
    seals = out / "seals.sha256"
    fingerprint = publish(sealed, seals)
    progress(f"seals published, sha256 {fingerprint}", len(labels), len(labels))
    if known is not None:
        _adopt(known, fingerprint, out)
    published = read(seals)
    todo = [
        (path, published[name], diagnoser, out, every, begin_until_s)
        for name, path in sorted(sealed.items(), key=_mixed)
        if not _result(out, name).exists()
    ]
    _parallel(_examine, todo, jobs, "diagnosing", progress)
    return [result.read(_result(out, name)) for name in sealed if _result(out, name).exists()], fingerprint


def _adopt(known: Path, fingerprint: str, out: Path) -> None:
    try:
        fields = json.loads(known.read_text())
    except ValueError as error:
        raise OtherSealsError(f"{known}: not the results of a proof: {error}") from error
    if fields["seals_sha256"] != fingerprint:
        raise OtherSealsError(
            f"{known}: seals_sha256 is {fields['seals_sha256']}, that of these cases {fingerprint}; "
            "the same seed, kinds and number of cases are needed"
        )
    for case in fields["cases"]:
        if not (path := _result(out, case["label"])).exists():
            result.of(case).write(path)


def _mixed(case: tuple[str, Path]) -> bytes:
    return hashlib.sha256(case[0].encode()).digest()


def _result(out: Path, name: str) -> Path:
    return out / "results" / f"{name}.json"


def _draw(seed: int, name: str, path: Path) -> None:
    _write(path, to_json(draw(seed, parse(name))))


def _examine(
    sealed: Path, published: str, diagnoser: Diagnoser, out: Path, every: int, begin_until_s: float
) -> None:  # fmt: skip
    if time.time() < begin_until_s:
        examine(sealed, published, diagnoser, out / "kept" / sealed.stem, every).write(_result(out, sealed.stem))


def _write(path: Path, text: str) -> None:
    # a proof may be stopped at any moment; a file is there whole or not at all
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    part.replace(path)


def _parallel(
    work: Callable[..., None], calls: Sequence[Sequence[Any]], jobs: int, what: str, progress: Progress
) -> None:  # fmt: skip
    for done, _ in enumerate(finished(work, calls, jobs), 1):
        progress(what, done, len(calls))
