"""The map from truths to names that count as right, and the range of each plant's command."""

from __future__ import annotations

from collections.abc import Mapping

RANGES: Mapping[str, tuple[float, float, bool]] = {
    "brevini-hpv41": (-90.0, 90.0, False),
    "cummins-efc": (1.2, 2.0, False),
    "hydraforce-open-loop": (-1.0, 1.0, True),
    "linear-axis": (-300.0, 300.0, True),
}
"""By plant: the command's ends, and whether the output is the integral of something."""

RIGHT: Mapping[str, frozenset[str]] = {
    name: frozenset(right.split())
    for name, right in {
        "nothing": "",
        "friction_rise": "friction coulomb seal_friction uneven_drag",
        "breakaway_rise": "friction coulomb seal_friction",
        "play": "backlash",
        "magnetic_hysteresis": "hysteresis",
        "slower_pilot": "pilot_rate rate_limit stage_rate coil_lag spool_frequency rotor_frequency",
        "damping_change": "spool_damping rotor_damping viscous",
        "edge_worn": "deadband dead_band leakage curve_exponent first_flow flow_range curve_width curve_centre",
        "leakage": "leakage piston_leakage internal_leakage closed_pressure",
        "supply_sag": "supply_droop supply_pressure",
        "zero_shift": "load_force load curve_centre sensor_offset asymmetry",
        "gain_loss": "full_flow rated_flow pressure_span supply_pressure asymmetry",
        "mass_change": "mass",
        "sensor_lag": "sensor_lag turbine_lag",
        "stroke_stop": "end_stop saturation",
        "orifice_clogged": "orifice turbulent_loss full_flow rated_flow pressure_span saturation",
        "asymmetry": "asymmetry uneven_drag",
        "stiction_one_side": "asymmetry uneven_drag friction",
        "cogging_rise": "periodic_disturbance load_force resonance",
        "coupling_soft": "resonance backlash",
    }.items()
}
