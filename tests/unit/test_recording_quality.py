"""What identify says of recordings before it fits them, and when it refuses them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hil import api
from hil.diagnosis.intake.check import check
from hil.errors import FileError
from hil.identification.grey_box.compare import compare_all
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.content import content_of
from hil.identification.preparation.experiment import experiment
from hil.identification.preparation.plausibility.suspicion import Suspicion
from hil.identification.preparation.recording_quality import Looked, believed, doubts, look, runs_the_other_way
from hil.identification.uncertainty.noise import channel_floor
from hil.physics.model import typical_model
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array, Recording, recording
from tests.concealed import NOISE, PLANT, bound, intake, noise, nominal, records, with_rows

# A unit that is not a typical one.
OWN = {"pilot_rate": 5.0, "dead_band": 24.0, "full_flow": 55.0, "sensor_lag": 0.02}


@cache
def made_steps() -> Recording:
    return records(parameters=OWN, seed=41)[0]


def with_values(one: Recording, **columns: Callable[[Recording], Array]) -> Recording:
    channels = {n: replace(c, values=columns[n](one)) if n in columns else c for n, c in one.channels.items()}
    return replace(one, channels=channels)


def looked_at(one: Recording) -> Looked:
    start = typical_model(PLANT)
    return look(start, bound(start, [one]))


def command_of(one: Recording) -> Array:
    return one.values("command")


def flow_of(one: Recording) -> Array:
    return one.values("flow")


MISTAKES: dict[str, tuple[Callable[[Recording], Recording], str]] = {
    "swapped": (lambda one: with_values(one, command=flow_of, flow=command_of), "look swapped"),
    "millilitres": (lambda one: with_values(one, flow=lambda r: 1000.0 * flow_of(r)), "factor near 1000 .*wrong unit"),
    "volts": (lambda one: with_values(one, command=lambda r: 0.1 * command_of(r)), "multiplied by 10; .*wrong unit"),
    "other sign": (lambda one: with_values(one, flow=lambda r: -flow_of(r)), "runs the other way"),
    "minutes": (lambda one: replace(one, time_s=one.time_s / 60.0), "multiplied by 60; .*unit of time"),
}


def mistaken(mistake: str) -> Recording:
    return MISTAKES[mistake][0](made_steps())


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_a_typical_unit_fits_only_otherwise_is_suspected(mistake):
    one, sentence = mistaken(mistake), MISTAKES[mistake][1]
    (first, *_) = looked_at(one).suspicions
    assert first.fit > 50.0
    with pytest.raises(FileError, match=sentence):
        believed([first], {one.name: 40.0}, at_bounds=False)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_compare_and_simulate_say_what_a_recording_looks_like(mistake):
    one, sentence = mistaken(mistake), MISTAKES[mistake][1]
    start, said = typical_model(PLANT), list[str]()
    (found,) = compare_all(start, bound(start, [one]))
    api.simulate(start, one, notes=said.append)
    assert any(re.search(sentence, note) for note in found.notes)
    assert any(re.search(sentence, note) for note in said)


def test_compare_and_simulate_doubt_no_good_recording_nor_one_without_an_output():
    start, said = typical_model(PLANT), list[str]()
    (found,) = compare_all(start, bound(start, [made_steps()]))
    api.simulate(start, made_steps(), notes=said.append)
    command_alone = replace(made_steps(), channels={"command": made_steps().channels["command"]})
    api.simulate(start, command_alone, notes=said.append)
    assert found.notes == () and said == []


def test_compare_leaves_out_samples_that_identify_leaves_out():
    start, whole = typical_model(PLANT), made_steps()
    stuck = flow_of(whole).copy()
    for first in (300, 900, 1500):
        stuck[first : first + 60] = stuck[first]
    (found,) = compare_all(start, bound(start, [with_values(whole, flow=lambda _: stuck)]))
    assert [note for note in found.notes if "not measured anew 3 ×" in note]


def test_samples_further_apart_than_a_plant_takes_are_refused_before_any_fit():
    short = with_rows(made_steps(), slice(400, 1000))
    slow = replace(short, time_s=1000.0 * short.time_s)
    with pytest.raises(FileError, match=r"time divided by 1000; .*--unit 'time=UNIT'"):
        looked_at(slow)


def test_a_good_recording_of_a_unit_unlike_a_typical_one_is_not_suspected():
    found = looked_at(made_steps())
    assert found.suspicions == () and found.notes == ()


def test_a_fit_as_recorded_outweighs_a_suspicion_unless_it_halves_the_misfit():
    suspected = Suspicion("x", "a factor near 10 looks like a wrong unit", 95.0)
    assert not suspected.outweighs(97.0) and not suspected.outweighs(92.0)
    assert suspected.outweighs(85.0) and suspected.outweighs(30.0) and suspected.outweighs(float("nan"))
    assert suspected.outweighs(94.0, at_bounds=True)


def test_a_wrong_unit_is_refused_and_a_unit_of_another_size_is_told_of():
    start = typical_model(PLANT)
    with pytest.raises(FileError, match="wrong unit"):
        fit_plant(start, bound(start, [mistaken("millilitres")]))
    small = with_values(made_steps(), flow=lambda r: 0.2 * r.values("flow"))
    found = fit_plant(start, bound(start, [small]))
    assert found.fits["steps"] > 90.0
    tenth = with_values(made_steps(), flow=lambda r: 0.1 * r.values("flow"))
    found = fit_plant(start, bound(start, [with_values(tenth, flow=lambda r: r.values("flow") * 70.0 / 55.0)]))
    assert any(
        "wrong unit. If it is right, --unit 'flow=l/min' says so. Other values of the plant fit it as it is" in note
        for note in found.notes
    )


def test_stale_and_held_samples_are_left_out_and_said():
    one = made_steps()
    flow = one.values("flow").copy()
    for start in (300, 900, 1700, 2500):
        flow[start : start + 40] = flow[start]
    stale = looked_at(with_values(one, flow=lambda _: flow))
    assert any("was not measured anew 4 ×, for 0.16 s on average" in text for text in stale.notes)
    assert stale.experiments[0].invalid["output"].sum() == 4 * 39
    held = looked_at(with_values(one, flow=lambda r: np.repeat(r.values("flow")[::8], 8)))
    assert any("shows each value 8 times" in text for text in held.notes)


def test_a_diagnosis_leaves_out_what_was_held_between_slower_samples():
    held = with_values(records(seed=42)[1], flow=lambda r: np.repeat(r.values("flow")[::5], 5))
    checked = intake([held])
    assert any("shows each value 5 times" in text for text in checked.warnings)


def test_a_coarse_sweep_of_leakage_is_not_called_swapped():
    """Within the dead band a flow meter of coarse steps shows little but its steps."""
    leaking = ActiveEffect("leakage", "flow", {"leak": 0.6, "fall": 0.5, "lean": 0.0})
    time_s = np.arange(0.0, 60.0, 0.05)
    command = np.interp(time_s, [0.0, 15.0, 45.0, 60.0], [0.0, 18.0, -18.0, 0.0])
    start = typical_model(PLANT)
    silent = recording("leak", time_s, {"command [%]": command, "flow [l/min]": 0.0 * command})
    (e,) = bound(start, [silent])
    flow = e.respond(start.definition, start.values, (leaking,))[0] + NOISE * noise(
        np.random.default_rng(3), len(time_s)
    )
    coarse = recording("leak", time_s, {"command [%]": command, "flow [l/min]": 0.5 * np.round(flow / 0.5)})
    assert not any("swapped" in s.sentence for s in look(start, bound(start, [coarse])).suspicions)
    intake([coarse])


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_identify_took_is_not_refused_afterwards(mistake):
    """Whatever a model was made of is what it says."""
    one = mistaken(mistake)
    (e,) = bound(nominal(), [one])
    model = replace(nominal(), origin={**nominal().origin, "content": {one.name: content_of(e)}})
    check(model, [e])


def test_too_few_samples_are_refused():
    with pytest.raises(FileError, match="at least 20 are needed"):
        fit_plant(typical_model(PLANT), bound(typical_model(PLANT), [with_rows(made_steps(), slice(10))]))


@pytest.mark.parametrize(("gain", "std", "said"), [(-2.0, 0.1, 1), (-0.2, 0.1, 0), (2.0, 0.1, 0), (-2.0, None, 0)])
def test_a_transfer_function_whose_output_falls_is_told_of(gain, std, said):
    one = typical_model("transfer-function")
    turned = replace(one, parameters={**one.parameters, "gain": replace(one.parameters["gain"], value=gain, std=std)})
    assert len(runs_the_other_way(turned)) == said


@pytest.mark.parametrize(("rate", "said"), [(1.5, True), (0.0, False), (-1.5, False)])
def test_an_output_that_runs_away_is_called_unstable(rate, said):
    """A pole at that rate; 0 is an integrator, which grows with its input's sum alone."""
    time_s = np.arange(0.0, 4.0, 0.01)
    command = np.where(time_s > 0.1, 1.0, 0.0) + 0.2 * np.sin(7.0 * time_s)
    output = np.zeros_like(time_s)
    for k in range(1, len(time_s)):
        output[k] = output[k - 1] + 0.01 * (rate * output[k - 1] + command[k - 1])
    one = recording("away", time_s, {"u [V]": command, "y [mm]": output})
    start = typical_model("transfer-function")
    found = doubts(start, [experiment(one, start.definition, "u", "y", 0.0)], {})
    assert any("unstable" in sentence for sentence in found) == said


def test_the_noise_of_an_inner_channel_is_that_of_samples_within_its_range():
    def clipped(one):
        noisy = 50.0 * command_of(one) / np.abs(command_of(one)).max()
        noisy += 0.5 * np.random.default_rng(3).standard_normal(len(one))
        return np.clip(noisy, -90.0, 20.0)

    made = records(parameters=OWN, seed=41, with_spool=True)[0]
    (e,) = looked_at(with_values(made, **{"spool position": clipped})).experiments
    assert e.invalid["spool position"].mean() > 0.1
    assert channel_floor(e.valid_observed["spool position"]) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize("top", [4.0, 2.0])
def test_a_motor_that_nobody_asks_to_turn_rests_and_a_meter_at_its_end_is_clipped(top):
    time_s = np.arange(0.0, 16.0, 0.02)
    command = np.floor(time_s / 2.0)
    turning = command > 0.0
    speed = 0.5 * command + 0.01 * np.random.default_rng(2).standard_normal(len(time_s)) * turning
    one = recording("motor", time_s, {"current [mA]": command, "speed [V]": np.minimum(speed, top)})
    start = typical_model("transfer-function")
    (e,) = look(start, [experiment(one, start.definition, "current", "speed")]).experiments
    assert e.valid[~turning].all()
    assert e.valid[turning].all() == (top == 4.0)
