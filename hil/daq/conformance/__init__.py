"""What every driver keeps, as checks that run on its simulated twin or on real hardware.

Nothing is compared with what the program remembers: what was driven is asked of the device again, over a link that was
opened anew where that matters, and seen by an input where the bench has one that measures it. With a twin behind the
driver its terminals are looked at from outside as well, and its answers are spoiled on purpose.
"""

from hil.daq.conformance.examine import CHECKS, Result, examine, left_safe, verdict_of
from hil.daq.conformance.subject import Behind, Broken, LeftOut, Subject, Witness

__all__ = [
    "CHECKS",
    "Behind",
    "Broken",
    "LeftOut",
    "Result",
    "Subject",
    "Witness",
    "examine",
    "left_safe",
    "verdict_of",
]
