"""Every installed procedure's results, as `hil results` hands them on, against the schema that documents them."""

import pytest
from handed_on import check_handed_on

import hil
from hil.catalog import entries

pytestmark = pytest.mark.usefixtures("unprinted")

SHORT = {
    "bench_reference": ("brevini-hpv41", {"cycle_s": 10, "rate_hz": 200}),
    "coil_by_hand": (
        "brevini-hpv41",
        {"cold": 7.2, "hot": 9.1, "resistance_uncertainty": 0.5, "instrument": "meter 7"},
    ),
    "cylinder_drift": ("hydraforce-sp08-47c", {"duration_s": 5, "settle_s": 1}),
    "efc_frequency_response": ("cummins-efc", {"frequencies": (1, 2, 4), "levels": ("medium",), "cycle_s": 8}),
    "efc_step_response": ("cummins-efc", {"repeats": 1, "currents": (1.6,)}),
    "electrical_check": ("cummins-efc-acceptance", {}),
    "endurance": ("brevini-hpv41", {"cycles": 12, "keep_every": 3, "rate_hz": 200}),
    "fail_safe": ("brevini-hpv41", {"repeats": 2, "rate_hz": 200}),
    "flow_curve": ("brevini-hpv41", {"cycle_s": 12}),
    "flow_over_pressure_drop": ("four-way-lab", {"rate_hz": 200}),
    "frequency_response": (
        "brevini-hpv41",
        {"frequencies": (1, 2, 4), "amplitudes": (20,), "biases": (50,), "measure_s": 0.5},
    ),
    "internal_leakage": ("four-way-lab", {"cycle_s": 20, "rate_hz": 200}),
    "iso_10770_1": (
        "brevini-hpv41",
        {"cycle_s": 12, "steps": (50,), "amplitudes": (10,), "biases": (50,), "rate_hz": 200},
    ),
    "jog": ("brevini-hpv41", {"value": 20}),
    "large_sine": ("brevini-hpv41", {"frequencies": (0.5,), "cycles": 1}),
    "leakage_check": ("cummins-efc-acceptance", {}),
    "limiting_power": ("four-way-lab", {"rate_hz": 200}),
    "load_step": ("four-way-lab", {"rate_hz": 500}),
    "multisine_response": (
        "brevini-hpv41",
        {"low_hz": 0.5, "high_hz": 4.5, "base_hz": 0.5, "amplitudes": (4,), "periods": 3, "biases": (60,)},
    ),
    "null_shift": ("four-way-lab", {"cycle_s": 10, "rate_hz": 200}),
    "pressure_current": ("cummins-efc", {}),
    "pressure_gain": ("four-way-lab", {"cycle_s": 20, "rate_hz": 200}),
    "proof_pressure": ("four-way-lab", {"hold_s": 2, "rate_hz": 200}),
    "sine_position": ("hydraforce-open-loop", {"frequency_rad_s": 8}),
    "step_response": ("brevini-hpv41", {"levels": (0, 80)}),
    "threshold": ("brevini-hpv41", {"speed": 1, "reach": 2, "biases": (60,), "rate_hz": 200}),
    "velocity_steps": ("hydraforce-open-loop", {}),
}
ELSEWHERE = {"efc_acceptance"}  # takes long, and is checked where it is run: tests/unit/test_efc_acceptance.py
INSTALLED = sorted(entry.name for entry in entries("procedures") if entry.module.startswith("procedures."))


@pytest.mark.parametrize("name", sorted(SHORT))
def test_results_are_what_their_schema_says(name, tmp_path):
    bench, settings = SHORT[name]
    check_handed_on(hil.run(name, bench, tmp_path / "run", settings=settings), tmp_path)


def test_every_procedure_is_here():
    assert {*SHORT, *ELSEWHERE} == set(INSTALLED)
