import re
from dataclasses import replace

import numpy as np
import pytest

import hil
from hil.errors import FileError, SettingError
from hil.identification.frequency.table_fit import Orders
from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.grey_box.structure import StructureChoice, Tried, choose_structure, with_orders
from hil.identification.preparation.experiment import experiment
from hil.identification.uncertainty.evidence import simplest_good
from hil.physics.compose import plant
from hil.physics.model import load_model, save_model
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import transfer_function
from hil.record.recording import recording
from hil.session.identification import bound
from hil.signals.recursion import filtered
from tests.binary_sequence import binary_sequence

PLANT = plant("transfer-function")
FEW = replace(PLANT, structures=PLANT.structures[:8])  # where it is not the choice among all that is tried
RATE_HZ = 100.0


def measured(model, noise=0.02, seed=0, uneven=False, offset=2.0, start_off=0.0, bits=7):
    """A recording of a linear model under a binary sequence, with noise, as a stranger's bench would give it."""
    command = binary_sequence(1.0, 3.0, 0.24 if bits > 5 else 0.8, RATE_HZ, bits=bits)
    parameters = PLANT.typical | model.to_parameters() | {"offset": offset, "start_at_output": float(start_off != 0)}
    first = offset + model.dc_gain * command[0] + start_off
    output = simulate(PLANT, parameters, Drive(command[None, :], first, 1 / RATE_HZ))[0]
    rng = np.random.default_rng(seed)
    kept = np.sort(rng.choice(len(command), size=len(command) * 2 // 3, replace=False)) if uneven else slice(None)
    y = output + noise * rng.normal(size=len(output))
    columns = {"valve [V]": command[kept], "pressure [bar]": y[kept]}
    return recording("stranger", (np.arange(len(command)) / RATE_HZ)[kept], columns)


def chosen(made, plant=PLANT):
    return choose_structure(plant, [experiment(made, plant, "valve", "pressure")])


def test_a_furnace_and_a_pressure_in_pascal_lie_within_the_bounds():
    rng = np.random.default_rng(1)
    command = np.repeat(rng.choice([20.0, 40.0, 60.0], 20), 150)
    drive = Drive(command[None, :], 2e7, 60.0)
    true = {"gain": 2.5e6, "offset": 2e7, "dead_time": 720.0, "lag_time": 21_600.0}
    output = simulate(PLANT, PLANT.typical | true, drive)[0] + 5e5 * rng.normal(size=len(command))
    made = recording("slow", 60.0 * np.arange(len(command)), {"valve [%]": command, "pressure [Pa]": output})
    found = fit_plant(starting_model("transfer-function"), [experiment(made, PLANT, "valve", "pressure")]).model
    assert found.origin["structure"] == "1 pole, dead time"
    for name, value in true.items():
        one = found.parameters[name]
        assert abs(one.value - value) < 3.0 * one.std < 0.2 * value, name


@pytest.mark.parametrize(
    ("model", "name"),
    [
        (transfer_function([4.0], [0.3, 1.0]), "1 pole"),
        (transfer_function([4.0], [0.3, 1.0], 0.15), "1 pole, dead time"),
        (transfer_function([80.0], [1.0, 3.0, 40.0]), "2 poles"),
        (transfer_function([-60.0], np.poly([-2.0, -3 + 7j, -3 - 7j])), "3 poles"),
    ],
)
def test_the_structure_that_made_the_recording_is_chosen(model, name):
    choice = chosen(measured(model))
    assert choice.chosen.structure.name == name
    assert name in choice.sentence
    names, most = {t.structure.name for t in choice.tried}, len(choice.chosen.structure.free) + 1
    assert {s.name for s in PLANT.structures if len(s.free) <= most and "bend" not in s.free} <= names
    assert sum("bend" in t.structure.free for t in choice.tried) < 12  # what no curve explains is fitted with none
    assert choice.chosen.values["start_at_output"] == 0.0  # it started at rest
    for parameter, value in model.to_parameters().items():
        if parameter in choice.chosen.structure.free and parameter != "offset":
            assert choice.chosen.values[parameter] == pytest.approx(value, rel=0.05)


def test_the_only_two_channels_are_the_input_and_the_output_of_a_plant_that_takes_any():
    made = measured(transfer_function([4.0], [0.3, 1.0]))
    for names in ((), ("valve",)):
        found = bound(made, PLANT, names)
        assert np.array_equal(found.output, made.values("pressure"))
        assert np.array_equal(found.drive.inputs[0], made.values("valve"))
    assert np.array_equal(bound(made, PLANT, (), "valve").output, made.values("valve"))
    with pytest.raises(FileError, match="no channel"):
        bound(made, plant("coupled-drives"))


def test_identification_of_a_plant_with_structures_states_units_and_uncertainty(tmp_path):
    model = transfer_function([80.0], [1.0, 3.0, 40.0])
    start = starting_model("transfer-function")
    found = fit_plant(start, [experiment(measured(model), PLANT, "valve", "pressure")])
    gain = found.model.parameters["gain"]
    assert gain.unit == "[bar]/[V]"
    assert gain.value == pytest.approx(2.0, abs=3 * gain.std)
    assert 0 < gain.std < 0.01
    assert found.model.parameters["lag_time"].std is None
    assert found.model.origin["structure"] == "2 poles"
    assert re.search(r"of \d+ tried", found.notes[0])
    # A model file keeps its structure: another recording refits the numbers, not the shape.
    save_model(found.model, tmp_path / "model.json")
    again = fit_plant(
        load_model(tmp_path / "model.json"), [experiment(measured(model, seed=3), PLANT, "valve", "pressure")]
    )
    assert again.model.origin["structure"] == "2 poles"
    assert not any("tried" in note for note in again.notes)
    assert again.model.parameters["gain"].value == pytest.approx(2.0, abs=0.01)


def staircase(levels, seed, unit=1.0):
    """A lag behind a curve that levels off, a sine's and no parabola, under a staircase of levels."""
    command = np.repeat(levels, 40).astype(float)
    answer = filtered([0.25], [1.0, -0.75], 3.4 * np.sin(command * np.pi / 16.0))
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(len(answer))
    columns = {"valve [V]": unit * command, "speed [rpm]": answer + noise}
    return experiment(recording("stairs", 0.2 * np.arange(len(command)), columns), PLANT, "valve", "speed")


def test_a_bent_static_curve_is_found_on_a_staircase_and_holds_on_the_way_down():
    names = ("gain", "1 pole", "2 poles", "2 poles, 1 zero", "3 poles", "3 poles, 1 zero", "3 poles, 2 zeros")
    wanted = [s for s in PLANT.structures if s.name in names or s.name.endswith(", bent")]
    up, down = staircase(np.arange(8), 1), staircase(np.arange(8)[::-1], 2)
    chosen = choose_structure(replace(PLANT, structures=tuple(wanted)), [up]).chosen
    assert "bent" in chosen.structure.name and chosen.values["bend"] < 0.0
    simulated = down.respond(PLANT, chosen.values)[0]
    off = (simulated - down.output)[40:]  # it did not rest at the top before
    assert 1.0 - np.linalg.norm(off) / np.linalg.norm(down.output - down.output.mean()) > 0.9


def test_a_curve_that_levels_off_to_both_sides_is_odd():
    levels = np.random.default_rng(4).uniform(-8.0, 8.0, (2, 20))
    names = ("gain", "1 pole", "2 poles")
    wanted = [s for s in PLANT.structures if s.name.partition(",")[0] in names and "dead_time" not in s.free]
    one, other = (staircase(each, seed) for seed, each in enumerate(levels))
    chosen = choose_structure(replace(PLANT, structures=tuple(wanted)), [one]).chosen
    assert chosen.structure.name.endswith("odd curve") and chosen.values["bend"] < 0.0
    off = (other.respond(PLANT, chosen.values)[0] - other.output)[40:]
    assert 1.0 - np.linalg.norm(off) / np.linalg.norm(other.output - other.output.mean()) > 0.9


def test_what_the_model_lacks_is_not_blamed_on_the_test():
    found = fit_plant(of_structure("1 pole"), [staircase(np.arange(8), 1, unit=0.03)])
    (said,) = [note for note in found.notes if "not identifiable: " in note]
    assert "gain" in said and "another test would not" in said
    assert not any("Drive more levels and faster" in note for note in found.notes)


def made_of_a_lag(lag_s, late_s=0.0, hold_s=0.2):
    """Sampled at 100 Hz, the plant itself worked out a hundred times as finely."""
    rng = np.random.default_rng(5)
    command = np.repeat(rng.uniform(-5.0, 5.0, round(8.0 / hold_s)), round(hold_s * RATE_HZ))
    command[:30] = command[30] = 0.0
    fine = np.concatenate((np.zeros(round(late_s * 100.0 * RATE_HZ)), np.repeat(command, 100)))
    decay = np.exp(-1.0 / (100.0 * RATE_HZ * lag_s))
    flow = 2.0 * filtered([0.0, 1.0 - decay], [1.0, -decay], fine)[: 100 * len(command) : 100]
    columns = {"valve [V]": command, "pressure [bar]": flow + 0.02 * rng.standard_normal(len(flow))}
    return experiment(recording("fast", np.arange(len(flow)) / RATE_HZ, columns), PLANT, "valve", "pressure")


def of_structure(name):
    return replace(starting_model("transfer-function"), origin={"structure": name})


def test_a_plant_faster_than_the_samples_is_said_with_the_rate_that_would_tell():
    found = fit_plant(of_structure("gain"), [made_of_a_lag(5e-4)])
    (said,) = [note for note in found.notes if "over within one sample, 0.01 s: it determines the gain" in note]
    hidden_s, rate_hz = (float(text) for text in re.findall(r"above (\S+) s .* at (\S+) Hz", said)[0])
    assert "to one sample, the dead time" in said
    assert 5e-4 < hidden_s < 0.005 and rate_hz == pytest.approx(1.0 / hidden_s, rel=0.05)
    told = fit_plant(of_structure("1 pole"), [made_of_a_lag(2.0 * hidden_s)])
    assert told.model.parameters["lag_time"].value == pytest.approx(2.0 * hidden_s, rel=0.1)


def test_a_pole_between_samples_is_said_with_the_rate_that_shows_it():
    found = fit_plant(of_structure("1 pole"), [made_of_a_lag(0.0025)])
    (said,) = [note for note in found.notes if "a pole" in note and "is no measurement" in note]
    (rate_hz,) = (float(text) for text in re.findall(r"Sample at (\S+) Hz or faster", said))
    assert rate_hz == pytest.approx(10.0 / (np.log(9.0) * 0.0025), rel=0.1)


def test_a_dead_time_between_two_samples_is_told_to_one_sample():
    found = fit_plant(starting_model("transfer-function"), [made_of_a_lag(5e-4, late_s=0.028)])
    late = found.model.parameters["dead_time"]
    assert late.value == pytest.approx(0.028, abs=1.96 * late.std) and late.std < 0.01
    assert any("to one sample, the dead time" in note for note in found.notes)


def test_uneven_stamps_are_taken_as_they_are():
    model = transfer_function([4.0], [0.8, 1.0])
    found = chosen(measured(model, uneven=True), FEW).chosen
    assert found.values["gain"] == pytest.approx(4.0, rel=0.05)
    v = found.values
    total = v["lag_time"] + 2 * v["pair1_damping"] * v["pair1_time"] + v["dead_time"] - v["pair1_zero"]
    assert total == pytest.approx(0.8, rel=0.1)


def test_a_recording_that_does_not_start_at_rest_is_noticed():
    model = transfer_function([4.0], [1.5, 1.0])
    assert chosen(measured(model, start_off=6.0), FEW).chosen.values["start_at_output"] == 1.0


def test_the_simplest_that_predicts_as_well_is_taken():
    base = np.array([1.0, 1.2, 0.9, 1.1])
    best, close, poor = base, base + np.array([0.1, -0.05, 0.05, 0.0]), base + 0.5
    assert simplest_good([best, close, poor], [(3,), (2,), (1,)]) == 1
    assert simplest_good([best, close, poor], [(1,), (2,), (3,)]) == 0
    assert simplest_good([best, best * 1.005], [(2,), (1,)]) == 1  # under one per cent worse
    at_one_place = best * np.array([1.004, 1.002, 1.003, 3.0])
    assert simplest_good([best, at_one_place], [(2,), (1,)]) == 1  # and no evidence anywhere else
    at_two = best * np.array([1.0, 1.0, 2.0, 3.0])
    assert simplest_good([best, at_two], [(2,), (1,)]) == 0
    assert simplest_good([best, at_two], [(2,), (1,)], 1.96) == 1


def fitted(model, noise=0.02, bits=5):
    return fit_plant(starting_model("transfer-function"), [experiment(measured(model, noise, bits=bits), PLANT, "valve",
                                                                      "pressure")])  # fmt: skip


def test_real_poles_are_told_as_time_constants():
    found = fitted(transfer_function([4.0], np.polymul([0.9, 1.0], [0.2, 1.0])))
    assert found.model.origin["structure"] == "2 poles"
    (said,) = found.readings
    assert "are real, with time constants of" in said and said in found.summary().splitlines()[1]
    assert "held" not in found.summary()  # of sections that the form does not have
    slow, slow_width, fast, fast_width = (float(text) for text in re.findall(r"[\d.]+(?= ±| s)", said))
    assert abs(slow - 0.9) < slow_width < 0.1 and abs(fast - 0.2) < fast_width < 0.1


def form(name, bic, **values):
    structure = next(one for one in PLANT.structures if one.name == name)
    return Tried(structure, PLANT.typical | values, bic, 1.0, 1.0)


def test_intervals_hold_forms_that_are_as_probable():
    plain = form("1 pole", 2.0 * np.log(3.0), lag_time=0.14)
    late = form("1 pole, dead time", 0.0, lag_time=0.10, dead_time=0.04)
    pair = form("2 poles", 0.0, pair1_time=0.06, pair1_damping=1.25)  # real poles, of 0.12 and 0.03 s
    excluded = form("3 poles", 7.0, lag_time=9.0, pair1_time=0.5, pair1_damping=0.1)
    choice = StructureChoice(plain, (late, pair, plain, excluded))
    assert [share for _, share in choice.probable] == pytest.approx([3.0 / 7.0, 3.0 / 7.0, 1.0 / 7.0])
    assert choice.form_std("lag_time") == pytest.approx(np.sqrt(3.0 / 7.0 * (0.04**2 + 0.02**2)))
    assert StructureChoice(plain, (plain,)).form_std("lag_time") == 0.0
    told_by_none = replace(late, vague=frozenset({"lag_time"}))
    assert StructureChoice(plain, (told_by_none, plain)).form_std("lag_time") == 0.0


def test_samples_that_are_read_late_are_no_pole_that_nobody_sees():
    step = np.where(np.arange(80) < 10, 0.0, 5.0)
    rng = np.random.default_rng(3)
    level = 3.0 + 2.0 * filtered([1.0 - np.exp(-1.0 / 15.0)], [1.0, -np.exp(-1.0 / 15.0)], step)
    columns = {"valve [V]": step, "pressure [bar]": level + 0.02 * rng.standard_normal(len(level))}
    found = fit_plant(starting_model("transfer-function"), [experiment(recording("r", np.arange(80.0), columns), PLANT,
                                                                      "valve", "pressure")])  # fmt: skip
    lag = found.model.parameters["lag_time"]
    assert found.model.origin["structure"] == "1 pole" and abs(lag.value - 15.0) < 1.96 * lag.std < 0.5
    assert not any("is no measurement" in note for note in found.notes)


@pytest.mark.parametrize("seed", range(3))
def test_the_slower_of_two_pairs_is_the_first_in_every_run(seed):
    """Else parameters of one valve's runs, compared by name, are those of two poles: two of these three came turned."""
    model = transfer_function([10000.0], np.polymul([1.0, 4.0, 25.0], [1.0, 8.0, 400.0]))
    made = experiment(measured(model, 0.05, seed, bits=7), PLANT, "valve", "pressure")
    found = fit_plant(starting_model("transfer-function"), [made], orders=Orders(poles=4)).model.parameters
    for name, true in (("pair1_time", 0.2), ("pair1_damping", 0.4), ("pair2_time", 0.05), ("pair2_damping", 0.2)):
        assert abs(found[name].value - true) < 3.5 * found[name].std


def test_asked_orders_leave_forms_that_have_them_alone():
    made = experiment(measured(transfer_function([2.0], [0.15, 1.0], 0.04)), PLANT, "valve", "pressure")
    start = starting_model("transfer-function")
    found = fit_plant(start, [made], orders=Orders(poles=1, zeros=0, dead_time=False)).model
    assert "dead time" not in found.origin["structure"] and found.origin["structure"].startswith("1 pole")
    assert found.values["dead_time"] == 0.0 and found.values["lag_time"] > 0.16  # it stands for the dead time too
    with pytest.raises(SettingError, match="there are, with a dead time or without: gain; 1 pole; 2 poles; 2 poles, 1"):
        fit_plant(start, [made], orders=Orders(poles=2, zeros=2))
    grown = {s.name: s.after for s in with_orders(PLANT, Orders(poles=4, dead_time=True)).structures}
    assert grown == {"4 poles, 1 zero, dead time": "", "4 poles, 2 zeros, dead time": ""}


def test_a_recording_whose_second_half_stands_still_is_identified():
    time_s, rng = 0.01 * np.arange(600), np.random.default_rng(0)
    command = np.where(time_s < 3.0, np.repeat(rng.uniform(0.0, 1.0, 30), 20), 0.0)
    level = filtered([0.0, 0.05], [1.0, -0.95], command) + 2.0 * 0.95 ** np.arange(600.0)  # begins in motion
    level = np.round(level + 0.3 * np.sin(7.0 * level), 2)
    level[300:] = level[-1]
    made = recording("still", time_s, {"valve [V]": command, "pressure [bar]": level})
    found = fit_plant(starting_model("transfer-function"), [experiment(made, PLANT, "valve", "pressure")])
    assert found.model.origin["fit_percent"]["still"] > 50.0  # its output is bent, which ended in a division by zero


def test_orders_are_asked_of_a_transfer_function_alone():
    made = measured(transfer_function([2.0], [0.15, 1.0]))
    with pytest.raises(SettingError, match="brevini-hpv41 has its form already"):
        hil.identify(made, "brevini-hpv41", poles=2, inputs=["valve"], output="pressure")
    with pytest.raises(SettingError, match="lines of a frequency response"):
        hil.identify(made, "transfer-function", weights="relative", inputs=["valve"], output="pressure")


def test_the_fit_of_unseen_data_is_that_of_another_recording():
    model = transfer_function([2.0], [0.15, 1.0], 0.04)
    sentence = str(chosen(measured(model, noise=0.2), FEW).sentence)
    said = float(re.search(r"a fit of ([\d.]+) %", sentence)[1])
    other = measured(model, noise=0.2, seed=3).values("pressure")
    clean = measured(model, noise=0.0).values("pressure")
    assert said == pytest.approx(100.0 * (1.0 - np.std(other - clean) / np.std(other)), abs=1.5)
