"""HydraForce SP08-47C with cylinder and LVDT as Gunay publishes it: transfer functions, test signal, geometry.

Gunay: Mathematical modelling and analysis of cartridge proportional valve, Global Journal of Engineering Science
and Researches 4(11), 2017, doi 10.5281/zenodo.1040758. Numbers are as printed; what is wrong with some of them,
and what had to be chosen because the paper leaves it open, stands in docs/explanation/hydraforce-paper.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil.physics.transfer_function import transfer_function

# Section III: the only test signal, about 5 V.
AMPLITUDE_V = 5.0
FREQUENCY_RAD_S = 1.0

# Eq. 9 (closed loop, "the transfer function obtained"); its first two numerator terms are printed
# "−2,842e − 0,14" and "−1,998e − 0,15" and are read as −2.842·10⁻¹⁴ and −1.998·10⁻¹⁵.
CLOSED_LOOP_EQ_9 = transfer_function((-2.842e-14, -1.998e-15, 0.002668), (1.0, 17.8, 1.316, 0.0002992))
# Eq. 11 inserts another closed loop into eq. 10; eq. 12 is what the paper calls the open loop.
CLOSED_LOOP_EQ_11 = transfer_function((0.7837,), (1.0, 3.853, 1.011e-5))
OPEN_LOOP_EQ_12 = transfer_function((0.7837,), (1.0, 3.853, -0.78368989))

# Section III, valve and LVDT.
FULL_FLOW_LPM = 11.4
VALVE_PRESSURE_BAR = 240.0
LVDT_RANGE_MM = 250.0

# HydraForce's data sheet of the sister valve SP08-47D, 12 V: first flow, full flow, hysteresis.
FIRST_FLOW_A, FULL_FLOW_A = 0.4, 1.1
HYSTERESIS_PERCENT = 7.0


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A differential cylinder.

    Attributes:
        bore_mm, rod_mm: diameters.
        stroke_mm: from end to end.
    """

    bore_mm: float
    rod_mm: float
    stroke_mm: float

    @property
    def head_area_mm2(self) -> float:
        """That pushes when it extends."""
        return math.pi / 4.0 * self.bore_mm**2

    @property
    def rod_area_mm2(self) -> float:
        """That pushes when it retracts."""
        return self.head_area_mm2 - math.pi / 4.0 * self.rod_mm**2

    @property
    def area_ratio(self) -> float:
        """Head over rod side."""
        return self.head_area_mm2 / self.rod_area_mm2

    def speeds_mm_per_s(self, flow_lpm: float) -> tuple[float, float]:
        """(extending, retracting) with the same flow into either side."""
        per_s = flow_lpm * 1e6 / 60.0
        return per_s / self.head_area_mm2, per_s / self.rod_area_mm2


# The pipe is stated as 65/50 mm, the rod as 30 mm; the stroke is taken to be what the LVDT can measure.
CYLINDER = Cylinder(50.0, 30.0, LVDT_RANGE_MM)

# Eqs 6 and 8 before the loop is closed, current in A to position in mm: `hil linearise hydraforce-open-loop --at ±0.75
# --set hysteresis=0 --set coulomb=0 --poles 2 --zeros 0`. The paper says that the directions differ, and prints one.
LINEARISED_AT_A = 0.75
EXTENDING = transfer_function((9.249e5,), (1.0, 77.73, 4480.0, 0.0))
RETRACTING = transfer_function((7.305e5,), (1.0, 77.56, 4460.0, 0.0))

# What the paper leaves open, and what was taken for it.
DECLARED = {
    "unit of input and output": "V in, V out (10 V is the LVDT's 250 mm), where a unit is needed at all",
    "0–10 V": "a sine of 5 V about 5 V; 10 V is full flow, 11.4 l/min",
    "stroke": "250 mm, the range of the LVDT",
    "e − 0,14 and e − 0,15": "exponents −14 and −15",
    "sampling rate, length of the record": "not stated; nothing here depends on them",
}
