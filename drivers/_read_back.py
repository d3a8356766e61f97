"""When outputs are read back while they are driven: twice a second, but not while a line has become slow."""

from __future__ import annotations

import math
import time

_EVERY_S = 0.5  # another master, or a device that restarted, is noticed so soon
_LATEST_S = 2.0  # on a line that has become slow; one that stays so ends the run before
_SLOW, _SHORTEST_S = 3.0, 0.005


class ReadBackTimes:
    """When a device is asked where its outputs stand, beside the readings that interlocks wait for.

    The question takes an answer more. On a line whose answers suddenly take several times as long as before it would
    hold back the next readings just when they are late already.
    """

    def __init__(self) -> None:
        self._usual_s, self._took_s = math.inf, 0.0

    def took(self, took_s: float) -> None:
        """The inputs were read in so long."""
        self._took_s = took_s
        self._usual_s = min(self._usual_s, max(took_s, _SHORTEST_S))

    def is_due(self, checked_s: float) -> bool:
        """Whether outputs are to be read back again, after they were at this time of `time.monotonic`."""
        slow = self._took_s > _SLOW * self._usual_s
        return time.monotonic() - checked_s > (_LATEST_S if slow else _EVERY_S)
