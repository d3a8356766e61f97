"""Which valves are identified at which ranges, and their true parameters, off the typical ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hil.record.recording import Array
from tests.studies.identify import plants
from tests.studies.identify.benches import RATE_HZ, Bench
from tests.studies.identify.plants import Channels, Values


@dataclass(frozen=True)
class Case:
    """A valve on its bench.

    Attributes:
        solve: its own solution.
        truth: every parameter that is estimated.
        commands: by range, one for each recording.
        sub_steps: of the solution in a sample.
        lacking: physics of the valve that the plant's model lacks.
    """

    name: str
    plant: str
    bench: Bench
    solve: Callable[[Array, Values, float], Channels]
    truth: Mapping[str, float]
    commands: Mapping[str, tuple[Array, ...]]
    sub_steps: int
    lacking: Mapping[str, float]

    @property
    def starts_steady(self) -> bool:
        """Whether it comes to rest before it is recorded; oil that is closed in would leak for as long as that."""
        return self.plant != "hydraforce-open-loop"


def steps(levels: tuple[float, ...], hold_s: float) -> Array:
    """One level after another."""
    return np.repeat(np.array(levels), round(hold_s * RATE_HZ))


def triangle(low: float, high: float, cycle_s: float) -> Array:
    """From the middle up, down, and back, twice."""
    count = round(cycle_s * RATE_HZ)
    turn = np.concatenate((np.zeros(200), np.arange(2 * count) / count))
    wave = 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * turn))
    made: Array = (low + high) / 2.0 + (high - low) / 2.0 * wave
    return made


def cold(command: Array) -> Array:
    """After half a second without current: how warm a coil would be otherwise is nowhere recorded."""
    return np.concatenate((np.zeros(500), command))


_HPV41 = {
    "dead_time": 0.0184, "pilot_rate": 7.7, "spool_frequency": 30.0, "spool_damping": 0.56, "dead_band": 18.5,
    "full_flow": 74.0, "curve_exponent": 1.12, "sensor_lag": 0.0091,
}  # fmt: skip
_EFC = {
    "dead_time": 0.0023, "coil_lag": 0.0145, "rotor_frequency": 52.0, "rotor_damping": 0.56, "curve_centre": 1.6,
    "curve_width": 0.092, "pressure_span": 200.0, "closed_pressure": 3.6, "sensor_lag": 0.0046,
}  # fmt: skip
_DRIVE = {
    "dead_time": 0.0023, "resistance": 2.2, "inductance": 0.083, "coil_lag": 0.0088, "rotor_frequency": 170.0,
    "rotor_damping": 2.9, "curve_shift": 0.03, "curve_stretch": 1.06, "pressure_span": 200.0, "leakage": 90.0,
    "sensor_lag": 0.0046,
}  # fmt: skip
_CLOSED = {
    "loop_gain": 1.42, "dead_time": 0.0023, "spool_frequency": 68.0, "spool_damping": 0.8, "speed_extend": 170.0,
    "speed_ratio": 1.6, "sensor_lag": 0.0012,
}  # fmt: skip
_OPEN = {
    "dead_time": 0.0023, "hysteresis": 0.05, "first_flow": 0.38, "flow_range": 0.66, "spool_frequency": 68.0,
    "spool_damping": 0.8, "rated_flow": 10.8, "edge_a_return": 0.95, "edge_supply_b": 1.06, "edge_b_return": 1.04,
    "mass": 110.0, "viscous": 2.4, "coulomb": 170.0, "load": 40.0, "piston_leakage": 3.0, "sensor_lag": 0.0012,
}  # fmt: skip

_FULL_STEPS = (0.0, 100.0, -100.0, 60.0, -30.0, 80.0, 0.0)
_SMALL_STEPS = (0.0, 45.0, -45.0, 35.0, -28.0, 40.0, 0.0)
_HPV41_COMMANDS = {
    "full range": (steps(_FULL_STEPS, 2.0), triangle(-100.0, 100.0, 20.0)),
    "half range": (steps(_SMALL_STEPS, 2.0), triangle(-50.0, 50.0, 20.0)),
}
_EFC_COMMANDS = {
    "full range": (steps((0.0, 1.8, 0.0, 2.0, 1.4, 1.6, 1.2, 0.0), 1.0), cold(triangle(0.0, 2.2, 16.0))),
    "half range": (cold(steps((1.5, 1.6, 1.45, 1.75, 1.5, 1.65, 1.4), 1.0)), cold(triangle(1.35, 1.8, 16.0))),
}
CASES = (
    Case("HPV41", "brevini-hpv41", Bench("brevini-hpv41"), plants.hpv41, _HPV41, _HPV41_COMMANDS, 10, {}),
    Case("HPV41, 1 % friction", "brevini-hpv41", Bench("brevini-hpv41"), plants.hpv41, _HPV41, _HPV41_COMMANDS, 10,
         {"friction": 1.0}),
    Case("EFC", "cummins-efc", Bench("cummins-efc"), plants.efc, _EFC, _EFC_COMMANDS, 10, {}),
    Case("EFC with drive", "efc-drive", Bench("cummins-efc-acceptance"), plants.efc_drive, _DRIVE, _EFC_COMMANDS, 100,
         {}),
    Case("EFC with drive, friction as installed", "efc-drive", Bench("cummins-efc-acceptance"), plants.efc_drive,
         _DRIVE, _EFC_COMMANDS, 100, {"friction": 0.001}),
    Case("SP08-47C, closed loop", "hydraforce-sp08-47c", Bench("hydraforce-sp08-47c"), plants.closed, _CLOSED, {
        "full range": (steps((0.0, 100.0, -100.0, 50.0, -30.0, 0.0), 3.0),),
        "half range": (steps((0.0, 40.0, -40.0, 20.0, -12.0, 0.0), 3.0),),
    }, 400, {}),
    Case("SP08-47C, open loop", "hydraforce-open-loop", Bench("hydraforce-open-loop"), plants.opened, _OPEN, {
        "full range": (steps((0.0, 1.1, 0.0, -1.1, 0.0, 0.8, -0.8, 0.0, 0.6, -0.6, 0.0), 0.5),),
        "half range": (steps((0.0, 0.55, 0.0, -0.55, 0.0, 0.7, -0.65, 0.0, 0.5, -0.5, 0.0), 0.7),),
        "two levels": (steps((0.0, 1.1, 0.0, -1.1, 0.0, 0.55, 0.0, -0.55, 0.0), 0.5),),
    }, 100, {}),
)  # fmt: skip
