"""How often a healthy unit is called anything but consistent: counted by plant, and unknown for any other."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.stats import binomtest

# Alarms and healthy units by plant: cases of the concealment proof without an effect (own equations, four recordings,
# white and coloured noise), and for the HPV41 300 short recordings more (docs/explanation/proof.md).
_COUNTED = {
    "brevini-hpv41": (0, 360),
    "cummins-efc": (0, 57),
    "hydraforce-sp08-47c": (0, 63),
    "linear-axis": (0, 57),
}


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """A rate and where it holds.

    Attributes:
        rate: upper end of the exact 95 % interval; None where nothing was counted.
        scope: of which units it was counted, one sentence.
    """

    rate: float | None
    scope: str


def false_alarms(plant: str) -> FalseAlarms:
    """The rate for a plant of the library; nothing is known of others."""
    if plant not in _COUNTED:
        return FalseAlarms(None, f"not counted for the plant '{plant}'")
    alarms, units = _COUNTED[plant]
    high = float(binomtest(alarms, units).proportion_ci().high)
    return FalseAlarms(round(high, 4), f"{alarms} alarms of {units} healthy simulated units of the plant '{plant}'")
