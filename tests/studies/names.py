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
    "cylinder_open_centre.seal_rise": "friction coulomb seal_friction",
    "cylinder_rocker.seal_rise": "friction coulomb seal_friction",
    "cylinder_rocker.pins_dry": "friction coulomb seal_friction",
    "axis_counterweight.sheave_dry": "friction",
    "stiction_one_side": "friction asymmetry",
    "play": "backlash",
    "axis_two_mass.play": UNEXPLAINED,
    "axis_belt.play": UNEXPLAINED,
    "axis_wobble.play": UNEXPLAINED,
    "axis_counterweight.play": UNEXPLAINED,
    "axis_yaw.rails_loose": "backlash " + UNEXPLAINED,  # the scale beside moves as the carriage turns
    "hpv41_compensated.play": UNEXPLAINED,  # of the lever that feeds back: the spool goes too far, it does not lag
    "hpv41_wire.ball_worn": UNEXPLAINED,  # as that: the spool goes too far
    "axis_counterweight.rope_creep": "backlash hysteresis",  # what is read lags behind at each turn
    "magnetic_hysteresis": "hysteresis",
    "slower_pilot": _PILOT + " coil_lag",
    "cylinder_elastic.slower_pilot": "coil_lag " + _SPOOL,
    "cylinder_four_edges.slower_pilot": "coil_lag " + _SPOOL,
    "efc_slot.slower_pilot": "coil_lag",
    "efc_pilot_bleed.slower_pilot": "coil_lag",
    "efc_pilot_bleed.feed_clogged": "rotor_frequency rotor_damping rate_limit",  # the stage after the coil
    "efc_spool.slower_pilot": "coil_lag",
    "efc_holes.slower_pilot": "coil_lag",
    "hpv41_notched.slower_pilot": _PILOT + " coil_lag resonance",  # an armature in a loop, which rings
    "hpv41_pulsed.slower_pilot": _PILOT + " coil_lag resonance",  # seats in a loop, as those
    "hpv41_wire.filter_clogged": _PILOT,  # less oil for the spool's ends
    "hpv41_wire.one_clogged": "load_force " + _PILOT,  # the flapper rests aside, and one way is slower
    "hpv41_notched.loop_weak": _SPOOL,
    "hpv41_pulsed.loop_weak": _PILOT,  # oil that is let in integrates: the loop's gain is its lag
    "hpv41_pulsed.pulse_dead": "backlash hysteresis friction",  # the spool rests short of its place from both sides
    "hpv41_notched.rate_ceiling": "pilot_rate rate_limit stage_rate",  # of what the electronics give
    "cylinder_hose.slower_pilot": "coil_lag " + _SPOOL,
    "cylinder_pipes.slower_pilot": "coil_lag " + _SPOOL,
    "cylinder_open_centre.slower_pilot": "coil_lag " + _SPOOL,
    "cylinder_rocker.slower_pilot": "coil_lag " + _SPOOL,
    "cylinder_pipes.dither_lost": "friction hysteresis",  # what it hid
    "axis_yaw.slower_drive": "sensor_lag",  # a lag is the same before the mass and after it
    "axis_yaw.force_ceiling": "saturation",
    "axis_counterweight.force_ceiling": "saturation",
    "damping_change": _SPOOL,
    "hpv41_direct.damping_change": _SPOOL + " pilot_rate",  # a dashpot is its only lag
    "hpv41_notched.damping_change": _PILOT,  # the bridge's pressure is all that it has for a dashpot
    "hpv41_pulsed.damping_change": _PILOT,  # against what the seats let in
    "hpv41_spring_pilot.damping_change": _PILOT,  # orifices before its ends: a ceiling of its speed and a lag
    "efc_slot.damping_change": "rotor_damping rotor_frequency",
    "efc_pilot_bleed.damping_change": "rotor_damping rotor_frequency",
    "efc_spool.damping_change": "rotor_damping rotor_frequency",
    "efc_holes.damping_change": "rotor_damping rotor_frequency",
    "axis_two_mass.damping_change": "viscous",
    "axis_belt.damping_change": "viscous",
    "axis_wobble.damping_change": "viscous",
    "axis_yaw.damping_change": "viscous",
    "axis_counterweight.damping_change": "viscous",
    "axis_wobble.drag_drift": "viscous " + UNEXPLAINED,  # the drag that is left once it is warm
    "edge_worn": "deadband dead_band leakage curve_exponent first_flow flow_range curve_width curve_centre",
    "efc_spool.edge_worn": "curve_centre curve_width pressure_span saturation",  # it spills where it had closed
    "efc_holes.edge_worn": "curve_centre curve_width closed_pressure leakage",  # it passes before they meet
    "leakage": "leakage closed_pressure internal_leakage piston_leakage",
    "efc_spool.leakage": "pressure_span saturation",  # past a spill that never closes
    "supply_sag": "supply_droop",
    "hpv41_direct.supply_sag": _FLOW_CEILING,
    "hpv41_compensated.supply_sag": _FLOW_CEILING,
    "hpv41_pulsed.supply_sag": _FLOW_CEILING,
    "hpv41_spring_pilot.supply_sag": _FLOW_CEILING,
    "hpv41_wire.supply_sag": _FLOW_CEILING,  # its pump, once the accumulator is empty
    "hpv41_spring_pilot.margin_low": "full_flow asymmetry",  # less drop over the notches: less flow everywhere
    "efc_slot.supply_sag": "supply_droop pressure_span saturation",  # a pump that gives less
    "efc_pilot_bleed.supply_sag": "supply_droop pressure_span saturation",
    "efc_spool.supply_sag": "supply_droop pressure_span curve_centre",  # most where the spill is open
    "efc_holes.supply_sag": "supply_droop pressure_span saturation",  # a plunger that lifts earlier
    "cylinder_open_centre.supply_sag": "supply_droop saturation rated_flow",  # a pump that gives a flow
    "cylinder_rocker.supply_sag": "supply_droop rated_flow",  # less pressure at every flow
    "cylinder_open_centre.bypass_worn": "supply_droop saturation rated_flow deadband first_flow flow_range",
    "zero_shift": "load_force",
    "efc_slot.zero_shift": "load_force curve_centre",
    "efc_pilot_bleed.zero_shift": "load_force curve_centre",
    "efc_spool.zero_shift": "load_force curve_centre",
    "efc_holes.zero_shift": "load_force curve_centre",
    "cylinder_open_centre.rod_load": "load_force asymmetry",
    "cylinder_rocker.weight_shifted": "load_force asymmetry",
    "gain_loss": "full_flow asymmetry",  # `asymmetry` has a gain of both sides
    "hpv41_direct.gain_loss": "full_flow asymmetry dead_band deadband",  # as the one above
    "hpv41_compensated.gain_loss": "full_flow asymmetry dead_band deadband",
    "hpv41_notched.gain_loss": "full_flow asymmetry dead_band deadband",
    "hpv41_pulsed.gain_loss": "full_flow asymmetry dead_band deadband",
    "hpv41_spring_pilot.gain_loss": "full_flow asymmetry dead_band deadband",
    "hpv41_wire.gain_loss": "full_flow asymmetry dead_band deadband",
    "hpv41_wire.wire_soft": "full_flow asymmetry dead_band deadband",  # more way by the same torque
    "hpv41_spring_pilot.spring_weak": "full_flow asymmetry dead_band deadband",  # more way by the same pressure
    "hpv41_compensated.spring_weak": "full_flow asymmetry",  # less drop over the edges: less flow everywhere
    "efc_slot.gain_loss": "curve_centre curve_width asymmetry",
    "efc_pilot_bleed.gain_loss": "curve_centre curve_width pressure_span asymmetry",  # a share of what is held
    "efc_spool.gain_loss": "curve_centre curve_width asymmetry",
    "efc_holes.gain_loss": "curve_centre curve_width asymmetry",
    "efc_spool.spring_weak": "curve_centre curve_width rotor_frequency",
    "efc_holes.spring_weak": "curve_centre curve_width rotor_frequency",
    "cylinder_hose.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_elastic.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_four_edges.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_pipes.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_open_centre.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_rocker.gain_loss": "first_flow flow_range deadband asymmetry",
    "cylinder_rocker.springs_tired": "first_flow deadband",  # those that hold the middle
    "axis_two_mass.gain_loss": "asymmetry mass viscous",
    "axis_belt.gain_loss": "asymmetry mass viscous",
    "axis_wobble.gain_loss": "asymmetry mass viscous",
    "axis_yaw.gain_loss": "asymmetry mass viscous",
    "axis_counterweight.gain_loss": "asymmetry mass viscous",
    "mass_change": "mass",
    "sensor_lag": "sensor_lag",
    "stroke_stop": "end_stop saturation",
    "cylinder_elastic.orifice_clogged": "rated_flow asymmetry saturation",  # that of both return edges
    "cylinder_four_edges.orifice_clogged": "rated_flow asymmetry",  # both edges of the supply
    "hpv41_direct.orifice_clogged": "full_flow saturation supply_droop asymmetry",  # those of the load
    "hpv41_wire.orifice_clogged": "full_flow saturation supply_droop asymmetry",  # the throttle of the load
    "efc_slot.orifice_clogged": "pressure_span curve_centre",
    "efc_spool.orifice_clogged": "pressure_span curve_centre",  # the feed of the chamber
    "efc_holes.orifice_clogged": "pressure_span curve_centre curve_width",  # the hole
    "efc_holes.nozzles_worn": "pressure_span curve_centre curve_width",  # the other orifice of the two
    "hpv41_notched.orifice_clogged": _PILOT,  # both of the bridge
    "hpv41_pulsed.orifice_clogged": _PILOT,  # all four seats
    "cylinder_hose.orifice_clogged": "asymmetry edge_a_return",  # what leaves the head side
    "cylinder_pipes.orifice_clogged": "rated_flow asymmetry",  # the pipe of the head side, both ways
    "cylinder_open_centre.orifice_clogged": "asymmetry edge_a_return",  # what leaves the head side
    "cylinder_rocker.orifice_clogged": "asymmetry edge_a_return",
    "cylinder_open_centre.check_clogged": "rated_flow asymmetry",  # of the head side, both ways
    "cylinder_rocker.check_clogged": "rated_flow asymmetry",
    "hpv41_compensated.asymmetry": "asymmetry",
    "hpv41_notched.asymmetry": "asymmetry",
    "hpv41_pulsed.asymmetry": "asymmetry",
    "hpv41_spring_pilot.asymmetry": "asymmetry",
    "hpv41_wire.asymmetry": "asymmetry",
    "hpv41_spring_pilot.refill_ajar": "asymmetry leakage",  # from one port to the tank
    "axis_two_mass.asymmetry": "asymmetry friction",
    "axis_belt.asymmetry": "asymmetry friction",
    "axis_wobble.asymmetry": "asymmetry friction",
    "axis_yaw.asymmetry": "asymmetry friction",
    "axis_counterweight.asymmetry": "asymmetry friction",
    "axis_yaw.rails_skew": "friction " + UNEXPLAINED,  # by place
    "cylinder_elastic.asymmetry": "asymmetry coulomb",
    "cylinder_hose.asymmetry": "asymmetry coulomb seal_friction",
    "cylinder_pipes.asymmetry": "asymmetry coulomb seal_friction",
    "cylinder_pipes.cocking_rise": "coulomb seal_friction",  # most at the ends
    "cogging_rise": "periodic_disturbance " + UNEXPLAINED,  # by place, where the page has one by the clock
    "axis_wobble.wobble_rise": "periodic_disturbance " + UNEXPLAINED,  # by place, as that
    "axis_counterweight.encoder_loose": "periodic_disturbance " + UNEXPLAINED,  # by place, as those
    "efc_holes.beat_rise": "periodic_disturbance",  # by the clock
    "axis_wobble.chain_stiff": UNEXPLAINED,  # a spring: the page has a steady force at most
    "efc_spool.line_longer": "resonance standing_wave",
    "hpv41_pulsed.line_longer": "resonance sensor_lag",  # inertia that edges damp
    "hpv41_spring_pilot.load_heavier": "resonance sensor_lag",  # inertia between volumes, after the edges
    "efc_holes.air_in_rail": "sensor_lag coil_lag",  # a lag is the same wherever it is
    "coupling_soft": "resonance",
    "axis_yaw.feet_soft": "resonance",
    "axis_counterweight.rope_soft": "resonance",
}


def right_names(skeleton: str, change: str) -> frozenset[str]:
    """What counts as right of a change of a skeleton; nothing of the unit as it is."""
    return frozenset(_RIGHT.get(f"{skeleton}.{change}", _RIGHT.get(change, "")).split())
