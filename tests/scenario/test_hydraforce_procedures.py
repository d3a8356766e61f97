"""Sine, velocity steps and drift of the SP08-47C's cylinder on the simulated benches, in virtual time."""

import math

import numpy as np
import pytest

from hil.errors import InputError, SettingError, StoppedError
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.record.folder import read
from hil.record.read import read_recording
from hil.rig import RoleChannel
from hil.session.procedure import load_procedure
from hil.session.setting import parse_settings
from tests.bench_files import bench_file
from tests.driven import driven, silent_rig
from tests.still_rig import Still

BENCH, OPEN_BENCH = "hydraforce-sp08-47c", "hydraforce-open-loop"
TRUTH = plant(BENCH).typical
AREA_RATIO = 1.5625


@pytest.fixture
def measure(tmp_path):
    """Findings of a procedure on the bench, without a report."""

    def run(name, bench=BENCH, /, **given):
        procedure = load_procedure(name)
        return procedure.evaluate(driven(procedure, bench, tmp_path / name, given))

    return run


POSITION = RoleChannel("position", "mm", -130.0, 130.0)
CLOSED = (RoleChannel("request", "mm", -120.0, 120.0), POSITION)
OPEN = (RoleChannel("command", "V", -10.0, 10.0), POSITION)
NO_CYLINDER = (RoleChannel("current", "A", 0.0, 2.2), RoleChannel("pressure", "psi", 0.0, 300.0))
RIGS = {"closed": CLOSED, "open": OPEN, "no cylinder": NO_CYLINDER}
SINE, STEPS, DRIFT = "sine_position", "velocity_steps", "cylinder_drift"


@pytest.mark.parametrize(
    ("name", "rig", "settings", "says"),
    [
        # the paper's own test: 304 mm of way in a period, in a cylinder of 250 mm
        (SINE, "open", {"cycles": 1, "frequency_rad_s": 1.0}, "304 mm in 1; of the stroke of 250 mm"),
        (SINE, "open", {"frequency_rad_s": 1.0}, "goes 304 mm extending in each period, 912 mm in 3"),
        (SINE, "open", {"amplitude": 20.0, "offset": 10.0}, "setting offset: 10 % is below the amplitude, 20 %"),
        (
            SINE,
            "closed",
            {"stroke_mm": 200.0},
            "setting amplitude: 50 % about ±50 % needs -120 … 120 mm; a stroke of 200",
        ),
        (SINE, "closed", {"retracted_mm": 0.0}, "that begins at 0 mm allows 2.5 … 247.5"),
        (SINE, "closed", {"amplitude": 70.0}, "setting amplitude: 70 % about 70 % is 0 … 168 mm, outside"),
        (SINE, "closed", {"frequency_rad_s": 2.0}, "needs 120 mm/s; the full flow extends at 96.77 mm/s: at most 1.61"),
        (SINE, "closed", {"frequency_rad_s": 0.0}, "setting frequency_rad_s: 0 rad/s; it must be above 0"),
        (SINE, "closed", {"frequency_rad_s": math.nan}, "setting frequency_rad_s: nan rad/s"),
        (SINE, "closed", {"amplitude": 0.0}, "setting amplitude: 0 %; it must be above 0"),
        (SINE, "closed", {"offset": -10.0}, "setting offset: -10 %; it must be at least 0"),
        (SINE, "closed", {"cycles": 0}, "setting cycles: 0"),
        (SINE, "closed", {"rod_mm": 60.0}, "setting bore_mm: 50 mm; it must be above 60"),
        (SINE, "no cylinder", {}, "'pressure' is in psi; this test needs a response in mm"),
        (STEPS, "closed", {"stroke_mm": 150.0}, "setting levels: ±80 % needs -96 … 96 mm; a stroke of 150 mm"),
        (STEPS, "closed", {"levels": ()}, "setting levels: none given"),
        (STEPS, "closed", {"levels": (-20.0,)}, "setting levels: -20 %; it must be above 0"),
        (STEPS, "closed", {"levels": (110.0,)}, "setting levels: -110 % is -132 mm, outside"),
        (STEPS, "open", {"repeats": 0}, "setting repeats: 0"),
        (STEPS, "open", {"full_flow_lpm": 0.0}, "setting full_flow_lpm: 0 l/min"),
        (STEPS, "no cylinder", {}, "'pressure' is in psi"),
        (
            DRIFT,
            "open",
            {"levels": (10.0,)},
            "a command in V moves the 'position' all the time, so only 0 % is allowed",
        ),
        (DRIFT, "no cylinder", {}, "'pressure' is in psi; this test needs a response in mm"),
        (DRIFT, "closed", {"duration_s": 1.0}, "setting duration_s: 1 s; it must be at least 5"),
        (DRIFT, "closed", {"levels": ()}, "setting levels: none given"),
    ],
)
def test_what_does_not_fit_is_refused_before_anything_moves(name, rig, settings, says):
    procedure = load_procedure(name)
    with pytest.raises(SettingError) as refused:
        procedure.run(Still(*RIGS[rig]), **parse_settings(procedure.settings, settings))
    assert says in str(refused.value)


def test_a_sine_in_an_open_loop_is_as_slow_as_the_stroke_allows():
    refused_rad_s = 6.48  # what the refusal of the paper's 1 rad/s names for three cycles
    for cycles in (1, 3):
        with pytest.raises(AssertionError, match="asked for"):
            load_procedure(SINE).run(Still(*OPEN), cycles=cycles)
    with pytest.raises(SettingError, match="goes"):
        load_procedure(SINE).run(Still(*OPEN), frequency_rad_s=refused_rad_s - 0.01)


def test_what_the_refusal_says_would_fit_does_fit():
    with pytest.raises(SettingError) as refused:
        load_procedure(SINE).run(Still(*OPEN), cycles=1, frequency_rad_s=1.0)
    text = str(refused.value)
    percent = float(text.split("at most ")[1].split(" %")[0])
    with pytest.raises(AssertionError, match="asked for"):  # it goes on to move
        load_procedure(SINE).run(Still(*OPEN), cycles=1, amplitude=0.99 * percent, frequency_rad_s=1.0)
    fast = float(text.split("at least ")[1].split(" rad/s")[0])
    with pytest.raises(AssertionError, match="asked for"):
        load_procedure(SINE).run(Still(*OPEN), cycles=1, frequency_rad_s=1.01 * fast)


def loop_at(omega, extend):
    """Request to position for small motion in one direction of the speed's ratio: the linear loop."""
    s = 1j * omega
    speed = TRUTH["speed_extend"] * (1.0 if extend else TRUTH["speed_ratio"]) / 100.0
    spool = 1.0 / (
        1.0 + 2.0 * TRUTH["spool_damping"] * s / TRUTH["spool_frequency"] + (s / TRUTH["spool_frequency"]) ** 2
    )
    return TRUTH["loop_gain"] * speed / s * spool * np.exp(-TRUTH["dead_time"] * s)


def test_the_sine_of_the_paper_on_both_sides(measure):
    findings = measure(SINE, cycles="2", rate_hz="500")
    found = {m.name: m for m in findings.measured}
    sides = [name.split(", ")[1] for name in found if name.startswith("gain")]
    assert sides == ["+60 ± 60 mm", "-60 ± 60 mm"]
    # the loop turns between its two speeds; the fundamental lies between the two linear loops
    slow, fast = (loop_at(1.0, extend) / (1.0 + loop_at(1.0, extend)) for extend in (True, False))
    for side in sides:
        assert min(abs(slow), abs(fast)) - 2e-3 < found[f"gain, {side}"].value < max(abs(slow), abs(fast)) + 2e-3
        phase = found[f"phase, {side}"].value
        assert math.degrees(np.angle(slow)) - 0.3 < phase < math.degrees(np.angle(fast)) + 0.3
        assert 1.0 < found[f"thd, {side}"].value < 4.0  # two speeds bend the sine
        # retracting is faster, so the cylinder stays on the retracted side of the sine's middle
        assert -4.0 < found[f"offset, {side}"].value - float(side.split()[0]) < -1.0
    assert found["direction_ratio"].value == pytest.approx(1.0, abs=5e-3)
    assert [curve["bias"] for curve in findings.curves["large_sines"]] == [60.0, -60.0]
    assert all(np.std(curve["measured"] - curve["fitted"]) < 0.3 for curve in findings.curves["large_sines"])
    assert sum("P1, gain" in note for note in findings.notes) == 2
    assert "One sine determines a gain" in findings.notes[-1]


def test_speeds_both_ways_and_their_ratio(measure):
    findings = measure(STEPS, rate_hz="500")
    found = {m.name: m for m in findings.measured}
    extending, retracting = found["speed, -96 → 96 mm"], found["speed, 96 → -96 mm"]
    # the LVDT's calibration is exact on this bench: speeds are those of the plant
    for measured, truth in (
        (extending, TRUTH["speed_extend"]),
        (retracting, -TRUTH["speed_extend"] * TRUTH["speed_ratio"]),
    ):
        assert measured.value == pytest.approx(truth, rel=2e-3)
        assert abs(measured.value - truth) < 4.0 * measured.std + 1e-3 * abs(truth)
    ratio = found["speed_ratio, ±96 mm"]
    assert ratio.value == pytest.approx(TRUTH["speed_ratio"], rel=3e-3)
    assert not any("not steady" in note for note in findings.notes)
    assert any("1.562 with the same flow both ways, and 0.8 with equal edges" in note for note in findings.notes)
    assert len(findings.curves["velocity_steps"]) == 4


def test_short_steps_are_told_to_be_unsteady(measure):
    findings = measure(STEPS, levels="20", repeats="1", rate_hz="500")
    assert any("not steady" in note for note in findings.notes)
    fast = max(abs(m.value) for m in findings.measured if m.quantity == "speed")
    assert fast < 0.9 * TRUTH["speed_extend"] * TRUTH["speed_ratio"]


def test_a_closed_loop_at_rest_does_not_drift(measure):
    findings = measure(DRIFT, levels="0,50", duration_s="20", rate_hz="200")
    found = {m.name: m for m in findings.measured}
    for level in ("0 mm", "60 mm"):
        rate = found[f"drift_rate, {level}"]
        assert abs(rate.value) < 4.0 * rate.std
        assert rate.std < 0.05  # mm/min, from noise of 0.05 mm
        assert found[f"restlessness, {level}"].value == pytest.approx(0.05, rel=0.5)
        offset = found[f"offset, {level}"]
        assert abs(offset.value) < 4.0 * offset.std
    assert "The loop was closed" in findings.notes[0]
    assert len(findings.curves["drift"]) == 2


def test_an_open_loop_at_constant_pressure_extends_faster_than_it_retracts(measure):
    findings = measure(STEPS, OPEN_BENCH, rate_hz="500", repeats="1")
    found = {m.name: m.value for m in findings.measured}
    for level in ("0.55", "1.1"):
        assert found[f"speed, 0 → {level} A"] > -found[f"speed, 0 → -{level} A"] > 0.0
        assert found[f"speed_ratio, ±{level} A"] == pytest.approx(1.0 / math.sqrt(AREA_RATIO), rel=0.02)
    # 0.4 A of 0.55 A do nothing: half the command is far from half the speed
    assert found["speed, 0 → 0.55 A"] < 0.25 * found["speed, 0 → 1.1 A"]
    starts = [(curve["speed_per_s"] > 0.0, curve["measured"][0]) for curve in findings.curves["velocity_steps"]]
    for extending, start in starts:
        assert -125.0 < start < -95.0 if extending else 95.0 < start < 125.0


def test_the_sine_in_an_open_loop_has_a_gain_for_each_direction(measure):
    findings = measure(SINE, OPEN_BENCH, rate_hz="500", cycles="1", amplitude="20", offset="60", frequency_rad_s="3")
    found = {m.quantity: m for m in findings.measured}
    assert found["direction_ratio"].value == pytest.approx(math.sqrt(AREA_RATIO), rel=0.03)
    assert found["gain"].unit == "mm/s per A"
    assert sum("P1I, gain" in note and "mm/s per A" in note for note in findings.notes) == 2
    for curve in findings.curves["large_sines"]:
        assert np.std(curve["measured"] - curve["fitted"]) < 0.2


def test_a_command_inside_the_dead_band_is_told_as_such(measure):
    with pytest.raises(InputError, match="a command inside the dead band, or one of the wrong sign"):
        measure(STEPS, OPEN_BENCH, rate_hz="500", repeats="1", levels="30")


def test_a_closed_valve_holds_the_cylinder(measure):
    findings = measure(DRIFT, OPEN_BENCH, rate_hz="200", duration_s="10")
    rate = next(m for m in findings.measured if m.quantity == "drift_rate")
    assert abs(rate.value) < 4.0 * rate.std
    assert {m.quantity for m in findings.measured} == {"drift_rate", "drift", "restlessness"}
    assert "The loop was open" in findings.notes[0]


def open_bench_with(folder, parameters):
    """The open bench with another valve behind it."""
    return bench_file(folder / "bench.toml", OPEN_BENCH, simulation={"parameters": parameters})


def test_a_valve_larger_than_stated_is_stopped_at_the_end_of_the_stroke(tmp_path):
    given = {"cycles": "1", "amplitude": "20", "offset": "60", "frequency_rad_s": "2"}
    path = open_bench_with(tmp_path, {"rated_flow": 25.0})
    with (
        pytest.raises(StoppedError, match=r"'end-of-stroke': [\s\S]* stopped\soutputs are safe"),
    ):
        driven(load_procedure(SINE), path, tmp_path / "run", given | {"full_flow_lpm": "8"})
    assert read(tmp_path / "run").values("position").max() < 125.5


def test_levels_that_turn_back_tell_the_open_valves_physics_the_magnets_loop_included(tmp_path):
    truth = {"first_flow": 0.45, "hysteresis": 0.06, "edge_supply_b": 0.7, "coulomb": 400.0, "load": 1500.0}
    path = open_bench_with(tmp_path, truth)
    levels = (0.7, 0.9, 0.7, 0.6, -0.9, -0.65, -0.9, -0.6, 0.8, 0.55, 1.0, -1.0, -0.7, 0.65, 0.9)
    with silent_rig(path, tmp_path / "run") as rig:
        for level in levels:
            rig.play(np.full(400, level))
    start = starting_model(OPEN_BENCH, ())
    model = fit_plant(start, [experiment(read_recording(tmp_path / "run"), start.definition)], ()).model
    for name, true in truth.items():
        found = model.parameters[name]
        assert found.std is not None and found.std < 0.05 * true, name
        assert abs(found.value - true) < 4.0 * found.std, name
