"""How wide an interval is: one number for every room that states one."""

from __future__ import annotations

COVERED = 1.96
"""Standard uncertainties on either side of a value within which 95 % of a normal distribution lie."""
