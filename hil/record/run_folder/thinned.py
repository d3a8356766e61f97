"""Thinned parts: of a run of days some stretches stay at the full rate, the rest is driven, judged and let go."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.record.recording import Array

ROWS_KEPT = "rows_kept"
_NAMES = ("after", "first", "of", "last")


class Thinning:
    """Which rows of a part stay, by its description: `"rows_kept": {"after": 500, "first": 9, "of": 900, "last": 50}`.

    Of each `of` rows, counted from row `after` of the part on, the `first` ones are kept, and none before that row.
    Where the part is cut short, its `last` rows are kept too: they show what ended it. A part that says nothing of the
    kind keeps all its rows.

    Raises:
        ValueError: `rows_kept` is not these four numbers.
    """

    def __init__(self, details: Mapping[str, Any]) -> None:
        self._rows: Mapping[str, int] | None = details.get(ROWS_KEPT)
        self._seen = 0
        self.held: Array | None = None
        if self._rows is None:
            return
        named = sorted(self._rows) == sorted(_NAMES)
        if not (named and self._rows["last"] >= 1 and 1 <= self._rows["first"] <= self._rows["of"]):
            raise ValueError(f"{ROWS_KEPT}: {', '.join(_NAMES)}; last ≥ 1, 1 ≤ first ≤ of; given: {dict(self._rows)}")

    def kept(self, table: Array) -> Array:
        """Of the next rows those that stay, shape (n, columns); `held` has the last of what came since."""
        if self._rows is None:
            return table
        place = np.arange(self._seen, self._seen + len(table)) - self._rows["after"]
        self._seen += len(table)
        stays = (place >= 0) & (place % self._rows["of"] < self._rows["first"])
        rest = table[np.flatnonzero(stays)[-1] + 1 :] if stays.any() else table
        before = None if stays.any() else self.held
        self.held = (rest if before is None else np.concatenate((before, rest)))[-self._rows["last"] :]
        return table[stays]
