"""The map from truths to names that count as right, and the range of each plant's command.

A name is right where it describes what was done in the skeleton's own equations, in the words of the plant's page.
Where the page has no place for it, *unexplained* is right.
"""

from __future__ import annotations

from collections.abc import Mapping

RANGES: Mapping[str, tuple[float, float, bool]] = {
    "brevini-hpv41": (-90.0, 90.0, False),
    "cummins-efc": (1.2, 2.0, False),
    "hydraforce-open-loop": (-1.0, 1.0, True),
    "linear-axis": (-300.0, 300.0, True),
}
"""By plant: the command's ends, and whether the output is the integral of something."""

UNEXPLAINED = "unexplained"
"""Right where the page has no place for what was done: then nothing is to be named."""

_SPOOL = "spool_damping spool_frequency"  # 2·ζ/ω is what damping changes: both names are that
_PILOT = "pilot_rate rate_limit spool_frequency spool_damping"  # the stages before the spool's place
_FLOW_CEILING = "supply_droop saturation"  # the flow is the lesser of two: the supply only lowers its ceiling

_RIGHT: Mapping[str, str] = {
    # what is the same in all skeletons, then what one of them does in another way: `skeleton.change`
    "friction_rise": "friction",
    "breakaway_rise": "friction",
    "stiction_one_side": "friction asymmetry",
    "play": "backlash",
    "axis_screw.play": UNEXPLAINED,  # the page of the axis has no play
    "axis_two_mass.play": UNEXPLAINED,
    "axis_belt.play": UNEXPLAINED,
    "hpv41_compensated.play": UNEXPLAINED,  # of the lever that feeds back: the spool goes too far, it does not lag
    "magnetic_hysteresis": "hysteresis",
    "slower_pilot": _PILOT + " coil_lag",
    "efc_flow_path.slower_pilot": "coil_lag",  # nothing but the coil is slower
    "efc_two_orifices.slower_pilot": "coil_lag",
    "cylinder_elastic.slower_pilot": "coil_lag " + _SPOOL,
    "cylinder_four_edges.slower_pilot": "coil_lag " + _SPOOL,
    "efc_slot.slower_pilot": "coil_lag",
    "efc_pilot_bleed.slower_pilot": "coil_lag",
    "efc_pilot_bleed.feed_clogged": "rotor_frequency rotor_damping rate_limit",  # the stage after the coil
    "cylinder_hose.slower_pilot": "coil_lag " + _SPOOL,
    "damping_change": _SPOOL,
    "hpv41_direct.damping_change": _SPOOL + " pilot_rate",  # a dashpot is its only lag
    "efc_slot.damping_change": "rotor_damping rotor_frequency",
    "efc_pilot_bleed.damping_change": "rotor_damping rotor_frequency",
    "hpv41_loop.damping_change": _SPOOL + " resonance",  # a pilot that rings more
    "hpv41_pilot_pressure.damping_change": _SPOOL + " resonance",
    "efc_flow_path.damping_change": "rotor_damping rotor_frequency",
    "efc_two_orifices.damping_change": "rotor_damping rotor_frequency",
    "axis_screw.damping_change": "viscous",
    "axis_two_mass.damping_change": "viscous",
    "axis_belt.damping_change": "viscous",
    "edge_worn": "deadband dead_band leakage curve_exponent first_flow flow_range curve_width curve_centre",
    "leakage": "leakage closed_pressure internal_leakage piston_leakage",
    "supply_sag": "supply_droop",
    "hpv41_curved.supply_sag": _FLOW_CEILING,
    "hpv41_direct.supply_sag": _FLOW_CEILING,
    "hpv41_compensated.supply_sag": _FLOW_CEILING,
    "efc_slot.supply_sag": "supply_droop pressure_span saturation",  # a pump that gives less
    "efc_pilot_bleed.supply_sag": "supply_droop pressure_span saturation",
    "hpv41_loop.supply_sag": _FLOW_CEILING,
    "hpv41_pilot_pressure.supply_sag": _FLOW_CEILING,
    "zero_shift": "load_force",
    "efc_slot.zero_shift": "load_force curve_centre",
    "efc_pilot_bleed.zero_shift": "load_force curve_centre",
    "efc_flow_path.zero_shift": "load_force curve_centre",
    "efc_two_orifices.zero_shift": "load_force curve_centre",
    "gain_loss": "full_flow asymmetry",  # `asymmetry` has a gain of both sides
    "hpv41_pilot_pressure.gain_loss": "full_flow asymmetry dead_band deadband",  # it shortens the way of the spool
    "efc_flow_path.gain_loss": "curve_centre curve_width asymmetry",  # the same torque needs more current
    "efc_two_orifices.gain_loss": "curve_centre curve_width asymmetry",
    "hpv41_direct.gain_loss": "full_flow asymmetry dead_band deadband",  # as the one above
    "hpv41_compensated.gain_loss": "full_flow asymmetry dead_band deadband",
    "hpv41_compensated.spring_weak": "full_flow asymmetry",  # less drop over the edges: less flow everywhere
    "efc_slot.gain_loss": "curve_centre curve_width asymmetry",
    "efc_pilot_bleed.gain_loss": "curve_centre curve_width pressure_span asymmetry",  # a share of what is held
    "cylinder_hose.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_elastic.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_four_edges.gain_loss": "first_flow flow_range deadband asymmetry",
    "axis_screw.gain_loss": "asymmetry mass viscous",  # only force over mass and over drag is in the page
    "axis_two_mass.gain_loss": "asymmetry mass viscous",
    "axis_belt.gain_loss": "asymmetry mass viscous",
    "mass_change": "mass",
    "sensor_lag": "sensor_lag",
    "stroke_stop": "end_stop saturation",
    "hpv41_loop.orifice_clogged": _PILOT,  # it is the pilot's
    "hpv41_pilot_pressure.orifice_clogged": _PILOT + " asymmetry",  # on one side
    "efc_flow_path.orifice_clogged": "supply_droop pressure_span saturation",  # a filter between pump and port
    "efc_two_orifices.orifice_clogged": "pressure_span curve_centre",  # the outlet of the rail
    "cylinder_elastic.orifice_clogged": "rated_flow asymmetry saturation",  # that of both return edges
    "cylinder_four_edges.orifice_clogged": "rated_flow asymmetry",  # both edges of the supply
    "hpv41_direct.orifice_clogged": "full_flow saturation supply_droop asymmetry",  # those of the load
    "efc_slot.orifice_clogged": "pressure_span curve_centre",
    "cylinder_hose.orifice_clogged": "asymmetry edge_a_return",  # what leaves the head side
    "hpv41_curved.asymmetry": "asymmetry",
    "hpv41_pilot_pressure.asymmetry": "asymmetry",
    "hpv41_compensated.asymmetry": "asymmetry",
    "axis_screw.asymmetry": "asymmetry friction",  # Coulomb friction that is greater forwards
    "axis_two_mass.asymmetry": "asymmetry friction",
    "axis_belt.asymmetry": "asymmetry friction",
    "cylinder_elastic.asymmetry": "asymmetry coulomb",
    "cylinder_hose.asymmetry": "asymmetry coulomb seal_friction",
    "cogging_rise": "periodic_disturbance " + UNEXPLAINED,  # by place, where the page has one by the clock
    "coupling_soft": "resonance",
}


def right_names(skeleton: str, change: str) -> frozenset[str]:
    """What counts as right of a change of a skeleton; nothing of the unit as it is."""
    return frozenset(_RIGHT.get(f"{skeleton}.{change}", _RIGHT.get(change, "")).split())
