"""Judge a diagnosis against the truth: by the names it gives, or by not giving any."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..cases.label import NOTHING, PAIR, PARAMETER, THREE
from ..cases.truth import Truth

FIRST = "named first"
AMONG = "named, not first"
BOTH = "both named"
ONE = "one of two named"
ALL = "all three named"
SOME = "one or two of three named"
WRONG = "wrong name"
PARAMETERS = "parameter change"
UNEXPLAINED = "unexplained"
CONSISTENT = "consistent"
FAILED = "failed"

OUTCOMES = (FIRST, AMONG, BOTH, ONE, ALL, SOME, WRONG, PARAMETERS, UNEXPLAINED, CONSISTENT, FAILED)


@dataclass(frozen=True, slots=True)
class Judgement:
    """One diagnosis: what was said, whether that is right, and how many names were given too many.

    `probabilities`: how likely each of `named` was said to be.
    """

    said: str
    right: bool
    named: tuple[str, ...]
    surplus: int
    verdict: str
    probabilities: tuple[float, ...]


def judge(truth: Truth, diagnosis: Mapping[str, Any]) -> Judgement:
    """Judge a diagnosis (the contract's `diagnosis.json`).

    Right is: an effect named first; both of a pair named, all of three; `parameter_change` without a name for a changed
    parameter; `unexplained` without a name for what no list has; `consistent` where nothing was concealed.
    """
    named = tuple(str(effect["name"]) for effect in diagnosis["effects"])
    said = _said(truth, named, str(diagnosis["verdict"]))
    surplus = len(set(named) - set(truth.effects))
    probabilities = tuple(float(effect["probability"]) for effect in diagnosis["effects"])
    return Judgement(said, said == _wanted(truth), named, surplus, str(diagnosis["verdict"]), probabilities)


def _said(truth: Truth, named: tuple[str, ...], verdict: str) -> str:
    if not named:
        silent = {"parameter_change": PARAMETERS, "consistent": CONSISTENT}
        return silent.get(verdict, UNEXPLAINED)
    found = set(named) & set(truth.effects)
    if not found:
        return WRONG
    if len(truth.effects) == 1:
        return FIRST if named[0] in found else AMONG
    whole, part = (BOTH, ONE) if len(truth.effects) == 2 else (ALL, SOME)
    return whole if found == set(truth.effects) else part


def _wanted(truth: Truth) -> str:
    silent = {NOTHING: CONSISTENT, PARAMETER: PARAMETERS, PAIR: BOTH, THREE: ALL}
    return silent.get(truth.label.kind, FIRST if truth.listed else UNEXPLAINED)
