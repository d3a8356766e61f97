"""The ripple of `ripple.py` at a chance phase in each recording: it can be named, but not predicted."""

from __future__ import annotations

from dataclasses import replace

from . import ripple

LAW = replace(ripple.LAW, others={**ripple.LAW.others, "locked": 0.0}, predictable=False)
