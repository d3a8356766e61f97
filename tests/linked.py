"""A driver and the twin of its device, with the HPV41 behind it: on a link, or by a clock that is turned by hand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from types import ModuleType
from typing import Any

from hil.clock import VirtualClock
from hil.daq.channel import Wiring
from sim_devices._field import Field, Side
from sim_devices._quirks import Quirks
from sim_devices._simulation import Simulation


def simulation(*inputs: str, slope: float = 1.0, **slopes: float) -> Simulation:
    """The valve, whose command is the output; inputs read it, in % times a slope, each the common one or its own."""
    every = dict.fromkeys(("command", *inputs), slope) | slopes
    of_command = {name: {"signal": "command", "unit": "%", "slope": one} for name, one in every.items()}
    instruments = of_command | {"command": {"direction": "out", **of_command["command"]}}
    return Simulation.model_validate({"plant": "brevini-hpv41", "instruments": instruments})


def turned(behind: Simulation, wiring: Wiring, clock: VirtualClock | None = None) -> Side:
    """The terminals of a device whose time is the clock's."""
    return Field(behind, {"": wiring}, clock or VirtualClock()).side("")


@contextmanager
def linked(
    driver: ModuleType,
    twin: ModuleType,
    behind: Simulation,
    wiring: Wiring,
    told: dict[str, Any],
    quirks: Quirks | None = None,
    used: Wiring | None = None,
) -> Iterator[tuple[Any, Any, Side]]:
    """A driver's link to a served twin, what serves it, and its terminals; the link uses all of them or some."""
    side = twin.world(behind, {"": wiring}).side("")
    with closing(twin.serve(told, side, quirks or Quirks())) as served:
        settings = driver.Settings.model_validate({**told, "address": served.where})
        with closing(driver.open_link(settings, used or wiring)) as link:
            yield link, served, side
