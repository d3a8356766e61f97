"""The places of the signal chain at which a law can act, and how a plant lets it act.

A law is `law(x, a, b, r) -> x`: it changes the signal x of its slot; a and b are what it may look at there.

| slot | x | a, b |
|---|---|---|
| DRIVE | command after the base dead time, in input units | – |
| RATE | speed of the first moving or electrical stage | its state, – |
| VISCOSITY | factor on damping, 1 | time, speed of the moving part where the plant has one |
| FORCE | net force on the moving part, in input units | position, speed |
| LINK | position of the moving part | speed, – |
| METER | position of the metering edge | speed, – |
| FLOW | what the metering edge lets through, in output units | edge position, load position |
| SUPPLY | relative supply pressure, 1 | demanded share of full flow, – |
| OUTPUT | the physical output | edge position, – |
| TRAVEL | speed of the load | its position, – |
| SENSOR | what the transducer meets | – |
| READING | what the transducer shows | edge position, command |
"""

from __future__ import annotations

from typing import Any

from numba import njit

DRIVE, RATE, VISCOSITY, FORCE, LINK, METER, FLOW, SUPPLY, OUTPUT, TRAVEL, SENSOR, READING = range(12)


@njit(inline="always")
def through(slot: int, x: float, a: float, b: float, laws: Any, records: Any) -> float:
    """Pass a signal through the laws that sit at this slot."""
    for j in range(len(records)):
        if records[j].slot == slot:
            x = laws[j](x, a, b, records[j])
    return x
