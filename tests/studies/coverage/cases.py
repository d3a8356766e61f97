"""Which procedure is tried on which bench, and where its truth comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from hil.record.recording import Recording
from tests.once import once
from tests.studies.coverage import truth_four_way, truth_others, truth_sines, truth_static, truth_steps
from tests.studies.coverage.situations import (
    ACCEPTANCE,
    CLOSED,
    EFC,
    FOUR_WAY,
    HPV41,
    HPV41_LAB,
    OPEN,
    SITUATIONS,
    Effect,
    Situation,
)
from tests.studies.coverage.truth_static import Truths

WITHOUT_TRUTH = {
    "parts_completed": "whether every part of a test was run",
    "model_fit": "says how a model fits this recording; nothing of the valve",
    "function": "a rise of pressure that is only compared with its limit",
    "probability_good": "a class, held against classes in `make acceptance-risk`",
    "probability_malfunctioned": "a class",
    "probability_severe": "a class",
    "usual_among_good": "a rank among classes",
    "rise_over_good": "a ratio to the good reference, held against it in `make acceptance-risk`",
    "bandwidth_over_good": "a ratio to the good reference",
    "deviation_from_good": "the thesis's own number; it grows with noise and duration, and is stated with both",
    "pressure_drop_high": "of `flow_curve` on a bench that reads a return pressure: held in "
    "tests/unit/test_flow_curve_null.py",
    "pressure_drop_low": "the same",
    "spool_settling": "no load moves the spool of the simulated valve; held in tests/unit/test_load_step.py",
    "counted_change": "three standard uncertainties of a mean: it says how well this recording can be read",
    "reading": "what an input showed while an output was moved by hand",
}
MADE_OF = {
    "efc_acceptance": (
        "pressure_current", "efc_step_response", "efc_frequency_response", "leakage_check", "electrical_check",
    ),
    "bench_reference": ("flow_curve", "step_response"),
    "iso_10770_1": (
        "flow_curve", "step_response", "frequency_response", "multisine_response", "threshold", "fail_safe",
        "pressure_gain", "internal_leakage", "flow_over_pressure_drop", "limiting_power", "null_shift", "load_step",
    ),
}  # fmt: skip
"""Procedures whose figures are those of others."""
BY_HAND = {
    "endurance": "figures are made cycle by cycle while it drives; held in tests/unit/test_endurance.py",
    "coil_by_hand": "readings are typed in, with the uncertainty of their instrument",
    "jog": "an output is moved by hand; reading and noise are what an input showed meanwhile",
}
SAME_AS = {
    "cummins-efc-modbus": "cummins-efc-acceptance", "efc-good": "cummins-efc-acceptance",
    "efc-prototype": "cummins-efc-acceptance", "efc-return": "cummins-efc-acceptance",
    "four-way-lab-modbus": "four-way-lab", "four-way-lab-can": "four-way-lab",
    "hpv41-lab-modbus": "hpv41-lab", "hpv41-lab-can": "hpv41-lab",
    "hpv41-canopen": "brevini-hpv41", "hpv41-j1939": "brevini-hpv41", "hpv41-mixed": "brevini-hpv41",
    "hpv41-modbus-rtu": "brevini-hpv41", "hpv41-modbus-tcp": "brevini-hpv41", "hpv41-serial": "brevini-hpv41",
    "hpv41-usb-6211": "brevini-hpv41", "hpv41-identified": "brevini-hpv41", "hpv41-mean": "brevini-hpv41",
    "hpv41-minus-5": "brevini-hpv41", "hpv41-minus-10": "brevini-hpv41", "hpv41-minus-20": "brevini-hpv41",
    "hpv41-plus-5": "brevini-hpv41", "hpv41-plus-10": "brevini-hpv41", "hpv41-plus-20": "brevini-hpv41",
    "hydraforce-extending": "hydraforce-sp08-47c", "hydraforce-retracting": "hydraforce-sp08-47c",
}  # fmt: skip
"""Shipped benches that are another one behind other links, with other parameters, or made linear."""


@dataclass(frozen=True)
class Case:
    """A procedure with its settings on a bench. `truth` reads a run without noise."""

    procedure: str
    bench: str
    settings: Mapping[str, str]
    truth: Callable[[Recording, str, Situation], Truths]

    @property
    def situations(self) -> Iterator[Situation]:
        """Those that change something here."""
        for situation in SITUATIONS:
            fits = not situation.only or self.procedure in situation.only
            if fits and (not situation.effects or self.bench in situation.effects):
                yield situation

    def truths(self, clean: Recording, situation: Situation) -> Truths:
        """What is true of a run without noise; in a run of the tests it is found once for all."""
        name = f"truth-{self.procedure}-{self.bench}-{situation.name}"
        return once(name, lambda: self.truth(clean, self.bench, situation))


_LINES = "0.1,0.3,0.7,1.1,1.5,1.9,2.5,3.3,4.1,4.9"
_EFC_LINES = "0.5,1,2,3,4,6,8,10,12,16,20"
CASES = (
    Case("flow_curve", HPV41, {}, truth_static.of_flow_curve),
    Case("flow_curve", EFC, {}, truth_static.of_flow_curve),
    Case("step_response", HPV41, {}, truth_steps.of_step_response),
    Case("step_response", EFC, {"levels": "0,80,0"}, truth_steps.of_step_response),
    Case("step_response", CLOSED, {"levels": "0,20,0"}, truth_steps.of_step_response),
    Case("step_response", FOUR_WAY, {"levels": "0,80,0"}, truth_steps.of_step_response),
    Case("frequency_response", HPV41, {"amplitudes": "10", "biases": "50", "frequencies": _LINES},
         truth_sines.of_frequency_response),
    Case("frequency_response", EFC, {"amplitudes": "2", "biases": "72", "frequencies": _EFC_LINES},
         truth_sines.of_frequency_response),
    Case("multisine_response", HPV41, {"biases": "50"}, truth_sines.of_multisine),
    Case("multisine_response", EFC, {"biases": "72", "amplitudes": "2", "low_hz": "0.5", "high_hz": "20",
                                     "base_hz": "0.5"}, truth_sines.of_multisine),
    Case("large_sine", HPV41, {}, truth_sines.of_large_sine),
    Case("large_sine", EFC, {}, truth_sines.of_large_sine),
    Case("sine_position", CLOSED, {}, truth_sines.of_sine_position),
    Case("sine_position", OPEN, {"amplitude": "5", "offset": "45", "frequency_rad_s": "6.48"},
         truth_sines.of_sine_position),
    Case("velocity_steps", CLOSED, {}, truth_others.of_velocity_steps),
    Case("velocity_steps", OPEN, {}, truth_others.of_velocity_steps),
    Case("cylinder_drift", CLOSED, {}, truth_others.of_cylinder_drift),
    Case("cylinder_drift", OPEN, {}, truth_others.of_cylinder_drift),
    Case("pressure_current", ACCEPTANCE, {}, truth_static.of_pressure_current),
    Case("efc_step_response", ACCEPTANCE, {}, truth_steps.of_efc_steps),
    Case("efc_step_response", EFC, {}, truth_steps.of_efc_steps),
    Case("efc_frequency_response", ACCEPTANCE, {}, truth_sines.of_frequency_response),
    Case("leakage_check", ACCEPTANCE, {}, truth_others.of_leakage_check),
    Case("electrical_check", ACCEPTANCE, {}, truth_others.of_electrical_check),
    Case("threshold", HPV41, {"rate_hz": "250"}, truth_static.of_threshold),
    Case("fail_safe", HPV41, {}, truth_steps.of_fail_safe),
    Case("pressure_gain", FOUR_WAY, {}, truth_four_way.of_pressure_gain),
    Case("internal_leakage", FOUR_WAY, {}, truth_four_way.of_internal_leakage),
    Case("flow_over_pressure_drop", FOUR_WAY, {}, truth_four_way.of_flow_over_pressure_drop),
    Case("limiting_power", FOUR_WAY, {}, truth_four_way.of_limiting_power),
    Case("null_shift", FOUR_WAY, {}, truth_four_way.of_null_shift),
    Case("load_step", FOUR_WAY, {}, truth_four_way.of_load_step),
    Case("proof_pressure", FOUR_WAY, {}, truth_four_way.of_proof_pressure),
    Case("pressure_gain", HPV41_LAB, {}, truth_four_way.of_pressure_gain),
    Case("internal_leakage", HPV41_LAB, {}, truth_four_way.of_internal_leakage),
    Case("flow_over_pressure_drop", HPV41_LAB, {}, truth_four_way.of_flow_over_pressure_drop),
    Case("limiting_power", HPV41_LAB, {}, truth_four_way.of_limiting_power),
    Case("null_shift", HPV41_LAB, {}, truth_four_way.of_null_shift),
    Case("load_step", HPV41_LAB, {}, truth_four_way.of_compensated_load_step),
    Case("proof_pressure", HPV41_LAB, {}, truth_four_way.of_proof_pressure),
)  # fmt: skip


def truthful(situation: Situation) -> Situation:
    """The situation without what disturbs readings alone: no figure is to contain that."""
    kept: dict[str, tuple[Effect, ...]] = {
        bench: tuple(effect for effect in effects if effect.hook != "sensor")
        for bench, effects in situation.effects.items()
    }
    return replace(situation, effects=kept)
