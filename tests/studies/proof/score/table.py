"""The table of a proof: rows of cases that belong together."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from tests.studies.rates import Rate

from ..cases.label import NOTHING, PAIR, PARAMETER, SEVERITIES, THREE, TOGETHER
from .judge import ALL, AMONG, BOTH, CONSISTENT, FAILED, FIRST, ONE, PARAMETERS, SOME, UNEXPLAINED, WRONG
from .result import Result


@dataclass(frozen=True, slots=True)
class Row:
    """Cases that belong together; `scored` are those whose concealed effect shows enough to be asked for."""

    name: str
    scored: tuple[Result, ...]
    faint: int

    def rate(self, *said: str) -> Rate:
        """Return how often one of these was said."""
        return Rate(sum(r.said in said for r in self.scored), len(self.scored))

    @property
    def right(self) -> Rate:
        """How often what was said is right."""
        return Rate(sum(r.right for r in self.scored), len(self.scored))

    @property
    def surplus(self) -> Rate:
        """How often names were given too many beside right ones."""
        beside = [r for r in self.scored if r.said in (FIRST, AMONG, BOTH, ONE, ALL, SOME)]
        return Rate(sum(r.surplus > 0 for r in beside), len(beside))

    @property
    def held(self) -> Rate:
        """How often a 95 % interval holds the truth."""
        held = [holds for r in self.scored for holds in r.held.values()]
        return Rate(sum(held), len(held))

    def closed(self, quantile: float) -> float | None:
        """Return a quantile of the share of the closable gap that was closed."""
        shares = [r.closed for r in self.scored if r.closed is not None]
        return float(np.quantile(shares, quantile)) if shares else None

    def seconds(self, quantile: float) -> float | None:
        """Return a quantile of the time from recordings to diagnosis."""
        times = [sum(r.seconds.values()) for r in self.scored if r.seconds]
        return float(np.quantile(times, quantile)) if times else None


@dataclass(frozen=True, slots=True)
class Section:
    """Rows under a heading."""

    heading: str
    rows: tuple[Row, ...]


HEADINGS = (
    "", "cases", "faint", "right", "named, not first", "wrong name", "parameter change", "unexplained", "consistent",
    "failed", "surplus names", "gap closed, median (p10)", "intervals hold", "s, median (p90)",
)  # fmt: skip


def cells(row: Row) -> tuple[str, ...]:
    """Return a row as text, in the order of `HEADINGS`."""
    middle, low = row.closed(0.5), row.closed(0.1)
    closed = "–" if middle is None or low is None else f"{100 * middle:.0f} % ({100 * low:.0f} %)"
    typical, slow = row.seconds(0.5), row.seconds(0.9)
    seconds = "–" if typical is None or slow is None else f"{typical:.1f} ({slow:.1f})"
    counts = [row.rate(AMONG, ONE, SOME), *(row.rate(x) for x in (WRONG, PARAMETERS, UNEXPLAINED, CONSISTENT, FAILED))]
    return (
        row.name, str(len(row.scored)), str(row.faint), str(row.right), *(str(c.hits or "") for c in counts),
        str(row.surplus.hits or ""), closed, str(row.held), seconds,
    )  # fmt: skip


def sections(results: Iterable[Result]) -> list[Section]:
    """Return the whole table."""
    every = list(results)
    single = [r for r in every if r.listed and r.kind not in (NOTHING, PARAMETER, *TOGETHER)]
    full = [r for r in single if r.severity == "full"]
    odd = [r for r in every if not r.listed]
    graded = single if len(single) > len(full) else []
    return [
        _section("Single effects, full severity", full, lambda r: r.kind, total=True),
        _section("Single effects by severity", graded, lambda r: r.severity, tuple(SEVERITIES)),
        _section("Single effects by plant, full severity", full, lambda r: r.plant),
        _section("Single effects by effect and severity", graded, lambda r: f"{r.kind}, {r.severity}"),
        _section("Pairs", [r for r in every if r.kind == PAIR], lambda r: r.plant, total=True),
        _section("Three at once", [r for r in every if r.kind == THREE], lambda r: r.plant, total=True),
        _section("Out of library", odd, lambda r: r.kind, total=True),
        _section("Parameter changes", [r for r in every if r.kind == PARAMETER], lambda r: r.plant, total=True),
        _section("No effect", [r for r in every if r.kind == NOTHING], lambda r: r.plant, total=True),
    ]


def _section(
    heading: str,
    results: list[Result],
    group: Callable[[Result], str],
    order: tuple[str, ...] = (),
    total: bool = False,
) -> Section:
    names = [n for n in order if any(group(r) == n for r in results)] or sorted({group(r) for r in results})
    rows = [_row(name, [r for r in results if group(r) == name]) for name in names]
    return Section(heading, (*rows, _row("all", results)) if total and results else tuple(rows))


def _row(name: str, results: list[Result]) -> Row:
    scored = tuple(r for r in results if r.visible)
    return Row(name, scored, len(results) - len(scored))
