"""Whether the watchdog process waits longer than the way to the safe values can take."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator

from hil.bench.device import DeviceInUse
from hil.bench.protection_coverage.devices import driving
from hil.bench.read import BenchFile

_ASKED = 2  # times that a silent device is asked before its outputs are made safe: in the run, and down the ramp
_DRIVEN = 4  # times that safe values are driven to it: twice when they are made safe, and again when it is let go of


def too_hasty(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """A watchdog process that would kill a program on its way to the safe values."""
    watchdog_s, takes_s = file.bench.protection.watchdog_s, way_to_safe_s(file)
    if not file.is_simulated and 0.0 < watchdog_s <= takes_s:
        yield (
            f"watchdog_s = {watchdog_s:g}: with devices that do not answer the way to the safe values takes up to "
            f"{takes_s:.3g} s, and the watchdog process would kill the program on it: say watchdog_s = "
            f"{math.ceil(takes_s + 1.0)} under [protection]"
        )


def way_to_safe_s(file: BenchFile) -> float:
    """How long a program can be silent on its way to the safe values when no device answers [s]."""
    waits_s = {name: _longest_s(device) for name, device in file.devices.items()}
    return (
        file.bench.protection.block_s
        + _ASKED * max(waits_s.values(), default=0.0)
        + _DRIVEN * sum(waits_s[name] for name, _ in driving(file))
    )


def _longest_s(device: DeviceInUse) -> float:
    """One exchange with a silent device: its time-out, and what is waited before it is asked again."""
    return float(getattr(device.settings, "timeout_s", 0.0)) + float(getattr(device.settings, "longest_reply_s", 0.0))
