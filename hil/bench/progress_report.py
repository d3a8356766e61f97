"""What the operator is told while a bench drives: one time over the whole run, what is going on, and live values."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from hil.record.recording import Array
from hil.record.run_folder.progress import Progress
from hil.system import system
from hil.units import behind_a_number

_MOST_SHARE = 0.99  # until the outputs are safe and the run is evaluated, nothing is done
_EVERY_S = 0.1  # of the operator's time
_MOST_VALUES = 6
_RESOLUTION = 1e-3  # of the range
_LATE_SHARE = 0.05  # of the expected time


@dataclass(frozen=True, slots=True)
class Shown:
    """A channel that the operator sees: its values with no more places than its range makes sense of."""

    name: str
    unit: str
    span: float

    def text(self, values: Array) -> str:
        """The mean of what was measured."""
        measured = values[np.isfinite(values)]
        if not measured.size:
            return f"{self.name} not measured"
        value = round(float(measured.mean()), self._places) + 0.0  # never minus zero
        return f"{self.name} {value:.{max(0, self._places)}f}{behind_a_number(self.unit)}"

    @property
    def _places(self) -> int:
        known = math.isfinite(self.span) and self.span > 0.0
        return min(6, -math.floor(math.log10(_RESOLUTION * self.span))) if known else 3


class ProgressReporter:
    """Follows the blocks of a run and says how far it is.

    Where a procedure has said how long it takes, the share is bench time over that; a sequence says what follows each
    of its parts, so that the time is that of the whole. Where nothing was said, the share is what the procedure tells.

    Args:
        progress: called with each report.
        shown: channels whose values are shown, the most important first.
        virtual: whether the bench runs in virtual time, which is not the operator's.
        begins_s: bench time at which it begins: a resumed run goes on behind the samples of the earlier one.
    """

    def __init__(
        self, progress: Progress, shown: Sequence[Shown], *, virtual: bool = False, begins_s: float = 0.0
    ) -> None:
        self._progress = progress
        self._time = " of simulated time" if virtual else ""
        self._shown = shown[:_MOST_VALUES]
        self._text, self._share = "", 0.0
        self._now_s, self._until_s = begins_s, 0.0
        self._then_s = 0.0
        self._values: Mapping[str, Array] = {}
        self._last = -_EVERY_S

    def expect(self, duration_s: float) -> None:
        """What comes now takes so long, in s of bench time."""
        self._until_s = self._now_s + duration_s + self._then_s

    @contextmanager
    def before(self, rest_s: float) -> Iterator[None]:
        """What is expected inside is followed by so much more, in s of bench time."""
        self._then_s += rest_s
        try:
            yield
        finally:
            self._then_s -= rest_s

    def say(self, share: float, text: str) -> None:
        """The procedure says what it does, and how much of that is done."""
        self._text = text
        self._reach(share if self._until_s <= 0.0 else self._by_time)
        self._tell()

    def heard(self, time_s: Array, values: Mapping[str, Array]) -> None:
        """A block has come: its stamps, counted from the first sample of the run, and its channels."""
        self._now_s = float(time_s[-1])
        if self._until_s > 0.0:
            self._reach(self._by_time)
        self._values = values
        now = system.now_s()
        if now - self._last >= _EVERY_S:
            self._last = now
            self._tell()

    @property
    def _by_time(self) -> float:
        return self._now_s / self._until_s

    def _reach(self, share: float) -> None:
        """Further, never back: what was expected shorter than it is stands still for a while."""
        self._share = max(self._share, min(share, _MOST_SHARE))

    def _tell(self) -> None:
        live = ", ".join(one.text(self._values[one.name]) for one in self._shown) if self._values else ""
        self._progress(self._share, "; ".join(filter(None, (self._text, self._time_left, live))))

    @property
    def _time_left(self) -> str:
        if self._until_s <= 0.0:
            return ""
        left_s = self._until_s - self._now_s
        if left_s > 0.0:
            return f"{time_text(left_s)}{self._time} left"
        return "almost done" if left_s > -_LATE_SHARE * self._until_s else "longer than expected"


def time_text(seconds: float) -> str:
    """`45 s`, `6 min 20 s`, `1 h 5 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
