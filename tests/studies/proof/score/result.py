"""The score of one case, as it is kept on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..cases.label import NOTHING
from ..cases.truth import Truth
from .judge import FAILED, Judgement

FAINTEST_SIGMA = 0.1
"""An effect that shows with less, beyond what a refit of base parameters absorbs, is tabulated but not scored."""


@dataclass(frozen=True, slots=True)
class Result:
    """One case.

    Attributes:
        label: Label of the case.
        kind: Kind of the case; for listed effects their name.
        effects: Names of what was concealed.
        listed: Whether all of it has a name in the contract.
        sigma: Change of the output by each law, in noise deviations.
        distinct_sigma: What of it no change of base parameters imitates.
        said: One of `judge.OUTCOMES`.
        right: Whether that is right.
        named: Effects that were named, in order.
        probabilities: How likely each of them was said to be.
        surplus: Names too many.
        verdict: The diagnosis's own word.
        nominal: Misfit of the nominal model to the noise-free truth on unseen recordings, in noise deviations.
        corrected: The same of the corrected model.
        closed: Share of the closable gap in fit that was closed; None where there is none, or chance decides.
        held: Comparable intervals, whether each holds the truth.
        seconds: Time of each stage.
        error: What was raised, if anything was.
    """

    label: str
    kind: str
    plant: str
    severity: str
    effects: tuple[str, ...]
    listed: bool
    sigma: tuple[float, ...]
    distinct_sigma: tuple[float, ...]
    said: str
    right: bool
    named: tuple[str, ...] = ()
    probabilities: tuple[float, ...] = ()
    surplus: int = 0
    verdict: str = ""
    nominal: float | None = None
    corrected: float | None = None
    closed: float | None = None
    held: dict[str, bool] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    error: str = ""

    @property
    def visible(self) -> bool:
        """Whether all that was concealed shows enough to be asked for."""
        return self.kind == NOTHING or min((*self.distinct_sigma, *self.sigma)) >= FAINTEST_SIGMA

    def write(self, path: Path) -> None:
        """Keep this result."""
        part = path.with_name(path.name + ".part")  # there whole or not at all, when a proof is stopped
        part.write_text(json.dumps(asdict(self), indent=1))
        part.replace(path)


def read(path: Path) -> Result:
    """Read a result back."""
    return of(json.loads(path.read_text()))


def of(fields: Mapping[str, Any]) -> Result:
    """Return the result that `asdict` made these fields of."""
    several = ("effects", "sigma", "distinct_sigma", "named", "probabilities")
    return Result(**{name: tuple(value) if name in several else value for name, value in fields.items()})


def judged(truth: Truth, judgement: Judgement, **more: object) -> Result:
    """Return the result of a case that was diagnosed."""
    return _result(
        truth, said=judgement.said, right=judgement.right, named=judgement.named, surplus=judgement.surplus,
        verdict=judgement.verdict, probabilities=judgement.probabilities, **more,
    )  # fmt: skip


def failed(truth: Truth, error: str, **more: object) -> Result:
    """Return the result of a case on which the program under test failed."""
    return _result(truth, said=FAILED, right=False, error=error, **more)


def _result(truth: Truth, **more: object) -> Result:
    return Result(
        str(truth.label), truth.label.kind, truth.label.plant, truth.label.severity, truth.effects, truth.listed,
        truth.sigma, truth.distinct_sigma, **more,
    )  # fmt: skip
