"""What every figure means, in one place: the standard's term, the range it is read from, what is in it.

`hil run NAME --describe` prints it under each figure, docs/reference/figures.md lists it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hil.record.measurement import Measurement

_READING = (
    "Of the reading: the meter's lag and half a hold of the command are in it; frequency responses are without them."
)

STEPS: Mapping[str, str] = {
    "onset": f"From the command's jump until the response has made 2 % of its change. A "
    f"model's dead time is shorter: it is without the beginning of the lag. {_READING}",
    "rise": (
        "IEC 60469 transition duration, 10 % to 90 % of the change between the levels before and after. The meter's "
        "lag lengthens it."
    ),
    "response": f"ISO 10770-1 step response time: from the command's jump until 90 % of the change. {_READING}",
    "settling": (
        "IEC 60469 settling: from the command's jump until the response stays within the band (in % of the change) "
        f"about its final value for good. {_READING}"
    ),
    "band_entry": (
        "From the command's jump until the response first comes within the band. The HPV41 paper calls this settling "
        f"time; where the response overshoots it is shorter than `settling`. {_READING}"
    ),
    "overshoot": (
        "IEC 60469 overshoot: largest value beyond the final one, in % of the change. `<` where noise alone could "
        "make it."
    ),
    "change": (
        "Final value (mean of the last 15 % of the step) less that before (mean of the last quarter before it)."
    ),
    "step_pressure": "Mean of the last 15 % of the step.",
}
SWEEPS: Mapping[str, str] = {
    "response_high": "Steady response at the upper end, mean of the visits.",
    "response_low": "Steady response at the lower end, mean of the visits.",
    "hysteresis": (
        "ISO 10770-1 hysteresis: largest difference of command for one response where the curve is steeper than 30 % "
        "of its steepest, without the lag. With friction it lies between twice the sliding and twice the "
        "static friction. `<` where noise alone could make it."
    ),
    "dead_band_positive": (
        "ISO 10770-1 dead band, upper edge: where a power law through the middle curve up to 40 % of the response "
        "begins. With play or friction the branches begin half the hysteresis to either side. `<` where its "
        "uncertainty covers the whole way from neutral."
    ),
    "dead_band_negative": "Lower edge of the dead band, as the upper one; `>` there.",
    "gain_positive": (
        "ISO 10770-1 gain: least-squares line through the middle curve, even in command, from 30 % to 90 % of the "
        "response at the upper end."
    ),
    "gain_negative": "The same below neutral.",
    "symmetry": "Smaller of the two gains over the larger. `>` where noise alone could make the difference.",
    "linearity": (
        "ISO 10770-1 linearity error within the gain's range: largest departure from its line, in % of the response "
        "at the end. The worse side counts."
    ),
    "polarity": "Sign of the response at the upper end less that at the lower end.",
    "null_bias": (
        "ISO 10770-1 null bias (recollection): mean of the zero crossings of two straight lines, less neutral. These "
        "are least-squares lines through the curve between the branches, from 20 % to 80 % of the response at an end. "
        "Absent where the response does not pass zero."
    ),
    "lap": (
        "ISO 10770-1 lap (recollection): distance between the zero crossings of the lines of `null_bias`. Above 0 "
        "overlap, below 0 underlap. A curve that bends near its edge has its `dead_band` elsewhere."
    ),
    "saturation_positive": (
        "From where to the end the curve stays flatter than half the slope of the line of `null_bias`. `>` the end "
        "of the sweep where it does not."
    ),
    "saturation_negative": "The same below neutral; `<` there.",
    "pressure_drop_high": (
        "Supply less return pressure, less the size of a recorded load pressure, while `response_high` is read. Absent "
        "where the bench has no `return pressure`."
    ),
    "pressure_drop_low": "The same of `response_low`.",
    "leakage": "Mean of the reading at neutral before the sweep.",
    "command_half": "Where the curve between the branches passes the middle of the responses at both ends.",
    "gain_largest": "Steepest slope of the curve between the branches.",
    "lag": (
        "All delays from the command to the reading together: valve, meter, half a hold. From the widths of the loop "
        "at two speeds; friction that depends on speed is granted to it."
    ),
    "pressure": "Of the curve between the branches.",
    "pressure_span": "Pressure at the highest current less that at the lowest.",
    "current_half": "Where the curve between the branches passes the middle of the pressures at both ends.",
    "slope_largest": "Steepest slope of the curve between the branches.",
}
THRESHOLDS: Mapping[str, str] = {
    "threshold_onward": (
        "ISO 10770-1 threshold (recollection): least change of command, onward, that changes the response by more than "
        "`counted_change`. Ramps of at most 1 % a second from a stop, mean of both directions and all repeats, delay "
        "taken out. `<` where a valve without friction would need as much, `>` where the reach did not suffice."
    ),
    "threshold_reversal": "The same against the direction in which the command came to the stop.",
    "counted_change": "Three standard uncertainties of the averaged change of the response.",
}
FAIL_SAFES: Mapping[str, str] = {
    "closing_time": (
        "From the command's jump to its safe value, or a relay's opening, until the response stays for good within "
        f"the band (in % of the change). Mean of the repeats. {_READING}"
    ),
    "left_open": "Mean of the second half of the time after the loss, less the response at neutral before the test.",
}
PRESSURE_GAINS: Mapping[str, str] = {
    "pressure_gain": (
        "ISO 10770-1 pressure gain (recollection): slope of the load pressure with blocked ports. Least-squares line, "
        "even in command, through the curve between the branches where it is within ± 40 % of the supply pressure."
    ),
    "pressure_null": "Where that curve passes zero load pressure.",
    "supply_pressure": "Mean over the sweeps; the load pressure counts in % of it.",
}
LEAKAGES: Mapping[str, str] = {
    "leakage_peak": (
        "ISO 10770-1 internal leakage (recollection): flow from supply to tank with blocked ports, at its largest. Of "
        "the curve between the branches of a sweep about neutral. What a pilot stage takes is in it."
    ),
    "leakage_peak_at": (
        "Middle of the commands between which that curve is above halfway from its larger end to its peak. Two edges "
        "that overlap make two peaks with a dip between them."
    ),
    "leakage_high": "The same flow at the upper end, mean of the visits.",
    "leakage_low": "The same at the lower end.",
}
PRESSURE_DROPS: Mapping[str, str] = {
    "flow": "Mean of the second half of the time at a command and a supply pressure.",
    "pressure_drop": ("Supply less return pressure, less the size of a recorded load pressure, at the same time."),
    "flow_exponent": "Slope of the least-squares line through log flow over log pressure drop; 0.5 for sharp edges.",
    "rated_flow": "Of that line at the rated valve pressure drop, `rated_drop`.",
}
LIMITING_POWERS: Mapping[str, str] = {
    "limiting_power": (
        "Size of the mean flow times the valve pressure drop, at the supply pressure where this is largest. Both as in "
        "`flow_over_pressure_drop`."
    ),
    "limiting_drop": "The valve pressure drop there.",
    "saturation_drop": (
        "From where the slope of log flow over log pressure drop stays below 0.25, half that of a sharp edge. `>` the "
        "largest drop where the flow still rises there."
    ),
}
NULL_SHIFTS: Mapping[str, str] = {
    "null": "`null_bias` of `flow_curve`, under the condition that is named.",
    "null_shift_supply": (
        "ISO 10770-1 null shift (recollection): slope of the line through the nulls over the measured supply pressure, "
        "times 10 % of the bench's own."
    ),
    "null_shift_tank": "The same over the measured tank pressure, times 10 % of the supply pressure.",
    "null_shift_temperature": "The same over the oil temperature as it was adjusted, times 40 K.",
    "flow_shift_temperature": "Slope of the line through the responses at that end over oil temperature, times 40 K.",
}
PROOF: Mapping[str, str] = {
    "proof_pressure": "Mean of the second half of the time held, the lower of both ends of the command.",
    "leakage_before": "Mean of the second half of the time at neutral, ports blocked, supply as the bench stands.",
    "leakage_change": "The same after the proof pressure, less that before.",
}
LOAD_STEPS: Mapping[str, str] = {
    "load_step": "Mean of the second half of the time held after the step, less that before; mean of the repeats.",
    "load_deviation": (
        "Largest size of the response less its mean before the step, of a smooth curve through the mean of the "
        "repeats. `<` where noise alone could make it."
    ),
    "load_settling": (
        "From the step of the load until that curve stays within the band (in % of the largest departure) about its "
        f"end. {_READING}"
    ),
    "spool_deviation": "As `load_deviation`, of the channel `spool position`.",
    "spool_settling": "As `load_settling`, of the channel `spool position`.",
}
COILS: Mapping[str, str] = {
    "coil_resistance_cold": "ISO 10770-2:2012, 7.2: after at least 2 h without current, at ambient temperature. Typed.",
    "coil_resistance_hot": "ISO 10770-2:2012, 7.2: temperature settled, within 1 s of switching off. Typed.",
    "coil_inductance": "As the instrument showed it. Typed.",
    "insulation_resistance": "As the instrument showed it. Typed.",
    "coil_temperature_rise": "From both resistances and the line of copper, 0.393 % per K at 20 °C.",
}
FREQUENCIES: Mapping[str, str] = {
    "gain": (
        "Amplitude of the response's fundamental over that of the command at the reference frequency. Without the "
        "measuring chain (meter's lag, hold, reading delay) unless correct_chain=no."
    ),
    "bandwidth_3db": (
        "ISO 10770-1: lowest frequency at which the amplitude ratio is 3.000 dB below that at the reference (a ratio "
        "of 0.7079). Read on a cubic spline through the lines over log frequency, without the measuring chain. Value "
        "and uncertainty: where the spline with its uncertainty may be at that level. `>` where that is left open."
    ),
    "bandwidth_90deg": (
        "ISO 10770-1: lowest frequency at which the response lags by 90°, read as the −3 dB frequency."
    ),
    "model_fit": "100·(1 − ‖H − Ĥ‖/‖H − mean H‖) over the lines; its uncertainty is what noise does to it.",
    "thd": (
        "Root of the summed powers of harmonics 2 to 5 over the fundamental, noise taken off, at the worst line. `<` "
        "where noise alone could make it."
    ),
    "noise": "Of the mean over the periods, over the amplitude of the response there; median over the driven lines.",
    "odd_distortion": (
        "Rms on silent odd lines near a driven one beyond noise, over the response's amplitude there; median over the "
        "driven lines. `<` where noise alone could make it."
    ),
    "even_distortion": "The same on even lines.",
}
SINES: Mapping[str, str] = {
    "amplitude": "Of the fundamental, meter's lag and hold included.",
    "phase": "Of the response's fundamental less that of the command's, meter's lag and hold included.",
    "offset": "Mean of the response over whole periods.",
    "thd": "Root of the summed powers of harmonics 2 to 5 over the fundamental.",
    "gain": "Amplitude of the position over that of the command; in an open loop times 2π·f, of the speed.",
    "direction_ratio": "Gain of the positive side over that of the negative side.",
}
CYLINDERS: Mapping[str, str] = {
    "speed": (
        "Slope of a line through the position: from 10 % to 40 % of the way, in an open loop from 40 % of the time on."
    ),
    "speed_ratio": "Speed retracting over speed extending, of one level.",
    "drift_rate": "Slope of a line through the position while the command stands.",
    "drift": (
        "Largest less smallest value of a smooth curve through one-second means. `<` where noise alone could make it."
    ),
    "restlessness": "Standard deviation of the position about its line, sensor noise included.",
    "offset": "Mean position less command, in a closed loop.",
}
CYCLES: Mapping[str, str] = {
    "cycles": "Of the pattern, without those in which the valve settled at the start and after each resumption.",
    "gain": "Over all cycles, by the discrete Fourier sum of each cycle; the meter's lag included.",
    "phase": "Of the response's fundamental less that of the command's, meter's lag and hold included.",
    "offset": "Mean of the response over whole cycles.",
    "residual": "Root mean square of the response less its mean and its fundamental: harmonics and noise.",
    "gain_drift": (
        "Slope of the weighted line through the gain of blocks of cycles, times all cycles. In % of the first block's "
        "amplitude."
    ),
    "phase_drift": "As `gain_drift`, of the phase; 1 % is 0.573°.",
    "offset_drift": "As `gain_drift`, of the offset.",
    "residual_drift": "As `gain_drift`, of the residual.",
}


def defined(definitions: Mapping[str, str], *measurements: Measurement) -> tuple[Measurement, ...]:
    """The measurements with their definitions."""
    return tuple(replace(m, definition=definitions.get(m.name, "")) for m in measurements)
