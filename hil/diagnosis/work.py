"""How far a diagnosis is, and what it leaves out when the computing time that it was given is over."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

Progress = Callable[[float, str], None]
OUT_OF_TIME = "was over before these were looked at"


class Work:
    """One diagnosis at work.

    Attributes:
        left_out: what was not done for want of time, in the order in which it came up.
    """

    def __init__(self, progress: Progress = lambda _done, _text: None, budget_s: float = math.inf) -> None:
        self._progress, self._budget_s = progress, budget_s
        self._until_s = time.monotonic() + budget_s
        self.left_out: list[str] = []

    def at(self, share: float, text: str) -> None:
        """Say how far it is."""
        self._progress(share, text)

    def leaves_out(self, what: str) -> bool:
        """Whether there is no time left for something; it is remembered."""
        over = time.monotonic() >= self._until_s
        if over and what not in self.left_out:
            self.left_out.append(what)
        return over

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was left out, in words; empty where nothing was."""
        if not self.left_out:
            return ()
        what = ", ".join(self.left_out)
        over = f"the computing time of {self._budget_s:.3g} s {OUT_OF_TIME}: {what}"
        return (f"{over}; a larger --budget may find more",)
