"""What is certain, what is most, what is much the same: the thresholds that all rooms of a diagnosis share."""

from __future__ import annotations

import numpy as np

# Standard uncertainties: from so many on nobody doubts it, and so many seldom come by chance.
CERTAIN, SELDOM_BY_CHANCE = 5.0, 3.0
# Shares: most of something, a good part of it, and next to nothing.
MOST, A_GOOD_PART, NEXT_TO_NOTHING = 0.5, 0.3, 0.02
# Ratios: within it two sizes are much the same, from it on one is plainly larger, far larger, or another thing.
MUCH_THE_SAME, PLAINLY, FAR = 1.25, 1.5, 4.0
# So many are looked at closely; so many lines of a list are read.
FEW, LISTED = 4, 12
# Stands for 0 where that would divide.
TINY = float(np.finfo(np.float32).tiny)
