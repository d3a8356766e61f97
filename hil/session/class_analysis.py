"""Classes learnt from valves of one's own: how many bad ones pass and how many good ones are refused.

Each valve is judged by what the others taught. From recordings of one test, a valve's number is its root mean square
difference from the mean of the good ones, and a threshold is learnt; from a table, its numbers are a Gaussian model's.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError, InputError
from hil.identification.papers.classification import by_thresholds, learn, leave_one_out, ordered_thresholds
from hil.record.plain import plain
from hil.record.recording import Array, Integers, Recording
from hil.record.table.tokens import as_numbers
from hil.session.analyses import aligned
from hil.signals.interval import exact_limits
from hil.untrusted import read_text

FEWEST = 5  # valves of a class
_CLASS = ("class", "condition", "verdict", "label")
GOOD = ("good", "ok", "pass")
"""Names of a class that is the good one, wherever it stands."""


@dataclass(frozen=True, slots=True)
class Share:
    """So many of so many, with its exact 95 % limits."""

    count: int
    of: int

    @property
    def limits(self) -> tuple[float, float]:
        """After Clopper and Pearson."""
        return exact_limits(self.count, self.of)

    def __str__(self) -> str:
        low, high = self.limits
        return f"{self.count} of {self.of} ({100.0 * low:.1f} … {100.0 * high:.1f} %, 95 %)"

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        low, high = self.limits
        return {"count": self.count, "of": self.of, "low": low, "high": high}


@dataclass(frozen=True, slots=True)
class Judged:
    """A valve, its class, and the class that the others give it; `value` is its number where one is compared."""

    name: str
    own: str
    found: str
    value: float | None = None


@dataclass(frozen=True, slots=True)
class ClassAnalysis:
    """What was learnt.

    Attributes:
        good, bad: names of the classes.
        rule: what a valve is judged by, in words.
        threshold: of the number; None of several numbers. `unit`: of it.
        judged: every valve by what the others taught.
        others: valves whose class nobody knew, by what all taught.
    """

    good: str
    bad: str
    rule: str
    judged: tuple[Judged, ...]
    threshold: float | None = None
    unit: str = "1"
    others: tuple[Judged, ...] = ()

    @property
    def accepted_bad(self) -> Share:
        """Bad valves that pass."""
        bad = [one for one in self.judged if one.own == self.bad]
        return Share(sum(one.found == self.good for one in bad), len(bad))

    @property
    def refused_good(self) -> Share:
        """Good valves that do not."""
        good = [one for one in self.judged if one.own == self.good]
        return Share(sum(one.found == self.bad for one in good), len(good))

    def as_text(self) -> str:
        """As lines for a terminal."""
        rows = [self.rule, f"  accepted bad  {self.accepted_bad}", f"  refused good  {self.refused_good}"]
        wrong = [one for one in self.judged if one.own != one.found]
        rows += [f"  wrong: {one.name} is {one.own}, found {one.found}" for one in wrong]
        rows += [f"  {one.name}: {one.found}{self._value(one)}" for one in self.others]
        return "\n".join(rows)

    def _value(self, one: Judged) -> str:
        return "" if one.value is None else f" ({one.value:.4g} {self.unit})"

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return plain({
            "schema": "hil.classes/1", "good": self.good, "bad": self.bad, "rule": self.rule,
            "threshold": self.threshold, "unit": self.unit, "accepted_bad": self.accepted_bad.as_dict(),
            "refused_good": self.refused_good.as_dict(),
            "valves": [{"name": o.name, "class": o.own, "found": o.found, "value": o.value} for o in self.judged],
            "others": [{"name": o.name, "found": o.found, "value": o.value} for o in self.others],
        })  # fmt: skip


def classes_of_recordings(
    good: tuple[str, Sequence[Recording]],
    bad: tuple[str, Sequence[Recording]],
    output: str,
    others: Sequence[Recording],
) -> ClassAnalysis:
    """A threshold on the difference from the mean good valve, in one test that all valves passed through.

    Args:
        good: name of the class and a recording of each of its valves.
        bad: likewise.
        output: channel that is compared.
        others: valves to be judged.

    Raises:
        InputError: fewer than five of a class. FileError: recordings of different tests.
    """
    names = (good[0], bad[0])
    _check_count({good[0]: len(good[1]), bad[0]: len(bad[1])})
    all_of = [*good[1], *bad[1], *others]
    unit = all_of[0].channel(output).unit
    rows = aligned(all_of, output, unit)
    count, known = len(good[1]), len(good[1]) + len(bad[1])
    labels = np.repeat(np.array([0, 1], dtype=np.int64), [count, known - count])
    values = _differences(rows[:known], rows, count)
    threshold = float(ordered_thresholds(values[:known], labels, 2)[0])
    found = np.array([_by_the_others(rows[:known], labels, k) for k in range(known)], dtype=np.int64)
    new = by_thresholds(values[known:], np.array([threshold]))
    rule = (
        f"{bad[0]}: '{output}' differs from the mean of the {good[0]} ones by {threshold:.4g} {unit} rms or more"
        if np.isfinite(threshold)
        else f"'{output}' does not tell {bad[0]} from {good[0]}: no difference has more of the ones than of the others"
    )
    judged = _judged([one.name for one in all_of[:known]], names, labels, found, values[:known])
    return ClassAnalysis(
        *names, rule, judged, threshold, unit,
        _judged([one.name for one in all_of[known:]], names, new, new, values[known:]),
    )  # fmt: skip


def classes_of_table(path: Path) -> ClassAnalysis:
    """A Gaussian model of each class from a CSV: a row for each valve, its class, and numbers that were measured.

    Raises:
        FileError: no such table. InputError: fewer than five of a class, or too few for so many numbers.
    """
    head, rows = _rows_of(path)
    at = next((k for k, name in enumerate(head) if name.strip().casefold() in _CLASS), None)
    if at is None:
        raise FileError(f"{path}: no column 'class'; a row for each valve has its class and what was measured")
    classes = [row[at].strip() for row in rows]
    names = sorted(set(classes), key=lambda name: (name.casefold() not in GOOD, classes.index(name)))
    if len(names) != 2:
        raise FileError(f"{path}: column '{head[at]}' holds {len(names)} classes ({', '.join(names)}); two are needed")
    _check_count({name: classes.count(name) for name in names})
    numbers = {k: column for k in range(len(head)) if k != at and (column := _numbers(path, head, rows, k)) is not None}
    if not numbers:
        raise FileError(f"{path}: no column of numbers beside '{head[at]}'")
    features = np.column_stack(list(numbers.values()))
    labels = np.array([names.index(name) for name in classes], dtype=np.int64)
    learn(features, labels, names)
    found = np.argmax(leave_one_out(features, labels, names), axis=1).astype(np.int64)
    text = next((k for k in range(len(head)) if k != at and k not in numbers), None)
    called = [row[text] if text is not None else f"row {i + 2}" for i, row in enumerate(rows)]
    rule = f"{names[1]}: by a Gaussian model of {', '.join(head[k] for k in numbers)}"
    return ClassAnalysis(names[0], names[1], rule, _judged(called, (names[0], names[1]), labels, found))


def _rows_of(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        head, *rows = [row for row in csv.reader(read_text(path).splitlines()) if row]
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: no table of valves: {getattr(error, 'strerror', None) or error}") from error
    if short := next((i for i, row in enumerate(rows, 2) if len(row) != len(head)), None):
        raise FileError(f"{path}: line {short} has not {len(head)} fields, as the heading has")
    return head, rows


def _numbers(path: Path, head: Sequence[str], rows: Sequence[Sequence[str]], column: int) -> Array | None:
    """A column of numbers; None where it holds texts, or one number alone.

    Raises:
        FileError: most of its fields are numbers, and others are none.
    """
    made = as_numbers([row[column].strip() for row in rows])
    known = np.isfinite(made)
    if not known.all() and 2 * np.count_nonzero(known) > len(known):
        at = int(np.argmin(known))
        raise FileError(
            f"{path}: row {at + 2}, column '{head[column]}': '{rows[at][column]}' is not a number; mend it, or leave "
            "the column out"
        )
    return made if known.all() and np.ptp(made) > 0.0 else None


def _check_count(counts: Mapping[str, int]) -> None:
    for name, count in counts.items():
        if count < FEWEST:
            raise InputError(f"class '{name}': {count} valves; at least {FEWEST} are needed to say how often it errs")


def _by_the_others(rows: Array, labels: Integers, left: int) -> int:
    """Class of one valve by the threshold and the mean that all others give."""
    kept = np.arange(len(rows)) != left
    others, of = rows[kept], labels[kept]
    good = int(np.count_nonzero(of == 0))
    threshold = ordered_thresholds(_differences(others, others, good), of, 2)
    value = np.sqrt(np.mean((rows[left] - others[:good].mean(axis=0)) ** 2))
    return int(by_thresholds(np.array([value]), threshold)[0])


def _differences(known: Array, rows: Array, good: int) -> Array:
    """Root mean square difference of rows from the mean of the first `good` known ones; of these, from all others'."""
    mean = known[:good].mean(axis=0)
    own = np.where(np.arange(len(rows))[:, None] < good, (good * mean - rows) / (good - 1), mean)
    return np.sqrt(np.mean((rows - own) ** 2, axis=1))


def _judged(
    names: Iterable[str], classes: tuple[str, str], own: Integers, found: Integers, values: Array | None = None
) -> tuple[Judged, ...]:
    numbers = [None] * len(own) if values is None else values.tolist()
    return tuple(
        Judged(name, classes[mine], classes[given], number)
        for name, mine, given, number in zip(names, own.tolist(), found.tolist(), numbers, strict=True)
    )
