"""A model that lacks something itself: what it left when it was identified is no news in later recordings."""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.question import question_of
from hil.diagnosis.skeleton.gate import before_of, later_of
from hil.diagnosis.skeleton.misfit import scattered
from hil.diagnosis.skeleton.rows import Rows, row_s, rows_of
from hil.diagnosis.skeleton.table import Table, read_table, table_of
from hil.errors import FileError, SettingError
from hil.identification.grey_box.identify import fit_plant
from hil.identification.preparation.content import content_of, is_of_its_origin
from hil.identification.preparation.experiment import Experiment, experiment
from hil.physics.compose import plant
from hil.physics.model import Model, typical_model
from hil.physics.simulate import ActiveEffect, Drive, simulate
from hil.record.recording import recording
from hil.signals.recursion import filtered
from tests.answers import answer
from tests.flap import FLAP, TIME_S, recorded

pytestmark = pytest.mark.xdist_group("a model that lacks something")  # on one worker: it is fitted once

FIRST, WORN = 3.0, 8.0


def wandering(name: str, seed: int) -> Experiment:
    """A flap that its plant describes, read by a sensor whose noise wanders; it is at rest for 5 s first."""
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.uniform(-15.0, 15.0, 40), len(TIME_S) // 40)
    command[:250] = 0.0
    slow, fast = rng.standard_normal((2, len(command)))
    noise = filtered([0.02], [1.0, -0.95], slow) + 0.003 * fast
    return experiment(answer(FLAP, command, 0.02, noise=noise, start=2.5, name=name), FLAP)


@cache
def firsts() -> list[Experiment]:
    return [recorded(f"first-{k}", FIRST, k) for k in (1, 2, 3)]


@pytest.fixture(scope="module")
def lacking():
    """Identified from a unit that sticks, by a plant that does not."""
    model = fit_plant(typical_model(FLAP.name), firsts()).model
    return replace(model, skeleton=made(model, firsts()).as_dict())


def made(model: Model, experiments: list[Experiment]) -> Table:
    found = table_of(model, experiments)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def table(lacking):
    assert lacking.skeleton is not None
    return read_table(json.loads(json.dumps(lacking.skeleton)), lacking)


def z_of(model: Model, table: Table, *later: Experiment) -> float:
    return later_of(table.before, table.rows(model, [e.reading_at(model.read_at) for e in later])).z


def test_an_unchanged_unit_stays_below_the_gate_and_a_worn_one_does_not(lacking, table):
    assert z_of(lacking, table, recorded("a", FIRST, 7), recorded("b", FIRST, 8)) < CRITERIA.alarm
    assert z_of(lacking, table, recorded("a", WORN, 7), recorded("b", WORN, 8)) > CRITERIA.alarm


@pytest.mark.filterwarnings("error")
def test_a_recording_too_short_for_parts_tells_nothing_of_before(lacking):
    whole = recorded("short", FIRST, 5)
    channels = {"motor command [V]": whole.drive.inputs[0, :60], "flap angle [V]": whole.output[:60]}
    short = experiment(recording("short", TIME_S[:60], channels), FLAP)
    assert table_of(lacking, [short]) is None
    with pytest.raises(SettingError, match="--before: too short to tell what an unchanged unit leaves"):
        question_of(lacking, [recorded("later", FIRST, 9)], before=[short])


def test_a_model_file_holds_the_table(lacking, table):
    again, later = made(lacking, firsts()), recorded("later", WORN, 9)
    assert z_of(lacking, again, later) == pytest.approx(z_of(lacking, table, later), rel=1e-2)
    assert len(json.dumps(lacking.skeleton)) < 1_000_000
    assert table.beyond_noise > 1.0  # it left more than noise


def test_coloured_noise_is_nothing_that_the_model_left_out():
    records = [wandering(f"wanders-{k}", k) for k in (1, 2, 3)]
    model = fit_plant(typical_model(FLAP.name), records).model
    assert made(model, records).beyond_noise < CRITERIA.scale


def test_the_scattered_points_are_those_that_kept_tables_were_fitted_to():
    """The 10 000th number of the minimal standard generator is published (C++ standard, minstd_rand)."""
    points = scattered(100, 100)
    assert points[-1, -1] == 399_268_537 / 2_147_483_647
    assert abs(points.mean() - 0.5) < 0.01


def test_numbers_beyond_single_precision_are_kept_at_its_end(lacking, table):
    """As recordings without noise make them."""
    sure = replace(table, before=replace(table.before, information=1e40 * (1.0 + table.before.information)))
    kept = read_table(json.loads(json.dumps(sure.as_dict())), lacking).before.information
    assert np.all(kept == float(np.finfo(np.float32).max))


def asked(model: Model, *later: Experiment, question: str = "") -> Diagnosis:
    return diagnose(model, [e.reading_at(model.read_at) for e in later], question=question).diagnosis


def test_the_diagnosis_of_an_unchanged_unit_names_nothing(lacking):
    said = asked(lacking, recorded("later", FIRST, 7), recorded("again", FIRST, 8))
    assert (said.question, said.verdict, said.effects, said.corrected_is) == ("changed", "consistent", (), "nominal")
    assert said.headline.startswith("The unit is unchanged since identification; the model itself reaches ")
    assert ", at identification " in said.headline
    assert said.gate is not None
    assert said.gate["z"] < said.gate["needed"]
    assert said.left_out is not None
    assert said.left_out["verdict"] == "unexplained"
    assert said.as_dict()["table"] is None


@pytest.mark.parametrize("samples", [1, 4])
def test_the_diagnosis_of_a_worn_unit_is_an_alarm(lacking, samples):
    """Recordings may be sampled finer than the rows of the table are."""
    said = asked(lacking, recorded("later", WORN, 7, samples=samples), recorded("again", WORN, 8, samples=samples))
    assert said.verdict == "explained"
    assert "friction" in {name for names in said.not_separable for name in names}
    printed = said.as_dict()["table"]
    assert {"causes", "unknowns", "left", "score", "probability"} < set(printed["rows"][0])
    assert "friction" in {row["name"] for row in printed["rows"]}
    assert "nothing" not in {row["name"] for row in printed["rows"]}  # the gate has refuted it
    assert said.gate is not None
    assert said.gate["is_alarm"]
    assert said.corrected_is == "nominal" or said.held_out.corrected > said.held_out.nominal


def test_a_coarser_channel_is_named_whatever_the_gate_says(lacking):
    """It is read off the recordings: the model itself leaves more than that of them."""
    model = replace(lacking, origin={**lacking.origin, "resolution": 1e-4})
    coarse = [
        replace(e, output=np.round(e.output / 0.02) * 0.02) for e in (recorded("a", FIRST, 7), recorded("b", FIRST, 8))
    ]
    said = asked(model, *coarse)
    assert (said.question, said.verdict, [effect.name for effect in said.effects]) == (
        "changed",
        "explained",
        ["quantisation"],
    )
    assert said.effects[0].probability > 0.9
    assert said.gate is not None
    assert said.gate["z"] < said.gate["needed"]


def test_a_reading_that_stands_for_long_is_named_whatever_the_gate_says(lacking):
    stuck = recorded("a", FIRST, 7)
    stuck.output[len(stuck.output) // 2 :] = stuck.output[len(stuck.output) // 2]
    said = asked(lacking, stuck, recorded("b", FIRST, 8))
    assert (said.question, said.verdict, [effect.name for effect in said.effects]) == (
        "changed",
        "explained",
        ["dropout"],
    )
    assert said.gate is not None
    assert said.gate["z"] < said.gate["needed"]


def test_a_small_change_of_a_parameter_is_found_from_starts_that_are_far_too_large(lacking):
    """The starts of the place at rest are a quarter of it away, the change a twenty-fifth (a load force was named)."""
    said = asked(lacking, recorded("later", FIRST, 7, rest=2.6), recorded("again", FIRST, 8, rest=2.6))
    assert [one.name for one in said.changed_parameters] == ["rest"]


def test_the_scale_is_held_within_what_recordings_of_before_say_of_it(table):
    """Student's t of two degrees of freedom is 4.303."""
    known = replace(table.before, reach=(1.0, 1.0, 1.0), uneven=0.3)
    assert known.within(4) == pytest.approx(np.exp(4.303 * 0.3 * np.sqrt(1 / 3 + 1 / 4)), rel=1e-3)
    assert replace(known, uneven=0.0).within(4) == 1.0


def test_a_plant_that_adds_up_its_errors_is_led_back_to_the_recording():
    """A force that the model lacks would carry it 0.49 m away in 20 s; led back it stands 4.2 mm off."""
    axis, force = plant("linear-axis"), np.zeros((1, len(TIME_S)))
    pushed = simulate(
        axis, axis.typical, Drive(force, 0.0, 0.02), [ActiveEffect("load_force", "force", {"force": 5.0})]
    )
    e = experiment(recording("pushed", TIME_S, {"force [N]": force[0], "position [m]": pushed[0]}), axis)
    assert abs(pushed[0, -1]) > 0.4
    rows = rows_of(typical_model(axis.name), [e], (), {"output": 1.0}, 0.1)
    assert np.abs(rows.misfit[-1]) == pytest.approx(0.0042, rel=0.1)


def test_a_cylinder_adds_up_its_errors():
    cylinder = plant("hydraforce-open-loop")
    assert not cylinder.forgets(cylinder.typical)


def test_rows_of_a_plant_that_adds_up_are_as_short_as_its_observer_asks():
    """Its step response ends at the stop after 13 s; rows of nearly a second heard no change."""
    cylinder = plant("hydraforce-open-loop")
    current, place = 0.6 * np.sign(np.sin(TIME_S)), np.zeros(len(TIME_S))
    e = experiment(recording("a", TIME_S, {"current [A]": current, "position [mm]": place}), cylinder)
    assert row_s(typical_model(cylinder.name), [e]) == pytest.approx(0.5 / 15.0)


def test_each_channel_has_a_skeleton_misfit_of_its_own():
    """What misleads the output one way may mislead a pressure the other way."""
    count, rng = 2400, np.random.default_rng(3)
    changes = rng.standard_normal((5, count)).astype(np.float32)
    place = np.arange(count)
    channel, recorded_in = place // 400 % 2, place // 800
    misfit = np.where(channel == 0, 30.0, -30.0) * changes[0] + rng.standard_normal(count)
    state = rng.standard_normal((count, 3))
    rows = Rows(misfit, changes, state, recorded_in, channel, place // 100, np.ones(count, dtype=np.bool_), 1)
    assert before_of(rows).left < 0.01


@pytest.mark.parametrize(("alike", "left"), [(1.0, (0.0, 0.15)), (0.0, (0.9, 1.05))])
def test_what_recordings_of_before_do_not_share_is_not_taken_off(alike, left):
    """Where each is misled its own way, what one fit leaves of another is no more than it was."""
    count, rng = 2400, np.random.default_rng(4)
    changes = rng.standard_normal((40, count)).astype(np.float32)
    place = np.arange(count)
    shared, own = rng.standard_normal(40), rng.standard_normal((3, 40))
    ways = alike * shared + (1.0 - alike) * own
    misfit = np.einsum("ij,ji->i", ways[place // 800], changes) + rng.standard_normal(count)
    every = np.ones(count, dtype=np.bool_)
    state = rng.standard_normal((count, 3))
    before = before_of(Rows(misfit, changes, state, place // 800, 0 * place, place // 100, every, 1))
    assert left[0] < before.left < left[1]


def test_no_alarm_below_what_recordings_of_before_reach_themselves(table):
    """A cylinder of four edges, unchanged, reached 7.4; its own first recordings had reached 16.9."""
    before = replace(table.before, reach=(1.0, 16.9, 7.2))
    assert before.needed(alone=True) == 16.9 and before.needed(alone=False) == 7.2
    assert replace(table.before, reach=(1.0, 2.0)).needed(alone=True) == CRITERIA.alarm


def test_the_question_follows_the_content_and_not_the_name(lacking):
    renamed = replace(firsts()[0], name="elsewhere.csv")
    assert content_of(renamed) == content_of(firsts()[0])
    assert question_of(lacking, [renamed]).asked == "left_out"
    same_name = recorded("first-1", FIRST, 77)
    assert not is_of_its_origin(lacking, same_name)
    assert question_of(lacking, [same_name]).asked == "changed"
    assert question_of(lacking, [same_name], "left_out").asked == "left_out"


def test_without_a_table_only_what_is_left_out_can_be_asked(lacking):
    bare = replace(lacking, skeleton=None)
    assert question_of(bare, [recorded("later", FIRST, 7)]).asked == "left_out"
    with pytest.raises(SettingError, match="--before RECORDING"):
        question_of(bare, [recorded("later", FIRST, 7)], "changed")
    with pytest.raises(SettingError, match="changed, left_out"):
        question_of(bare, [], "why")
    older = replace(lacking, skeleton={"version": 1, "library": "another"})
    assert question_of(older, [recorded("later", FIRST, 7)]).asked == "left_out"
    assert "another version" in question_of(older, [recorded("later", FIRST, 7)]).warnings[0]
    given = question_of(bare, [recorded("later", WORN, 7)], before=firsts())
    assert given.asked == "changed"
    assert given.table is not None


def test_a_library_that_has_changed_is_said(lacking):
    assert lacking.skeleton is not None
    kept = {**lacking.skeleton, "library": "another", "columns": [
        ["gone", *column[1:]] if k == 0 else column for k, column in enumerate(lacking.skeleton["columns"])
    ]}  # fmt: skip
    asked_now = question_of(replace(lacking, skeleton=kept), [recorded("later", FIRST, 7)])
    assert "library has changed" in asked_now.warnings[0]
    assert asked_now.table is not None
    assert len(asked_now.table.columns) == len(kept["columns"]) - 1


@pytest.mark.parametrize(("key", "value"), [("arrays", {}), ("scale", "x"), ("columns", [[1]])])
def test_a_damaged_table_is_refused(lacking, key, value):
    assert lacking.skeleton is not None
    damaged = replace(lacking, skeleton={**lacking.skeleton, key: value})
    with pytest.raises(FileError, match="skeleton: cannot be read"):
        question_of(damaged, [recorded("later", FIRST, 9)])


def test_an_array_unpacks_no_further_than_a_table_can_be(lacking):
    assert lacking.skeleton is not None
    bomb = base64.b64encode(zlib.compress(bytes(1 << 25), 9)).decode()
    arrays = {**lacking.skeleton["arrays"], "rms": f"{1 << 23}:{bomb}"}
    with pytest.raises(FileError, match="skeleton: cannot be read"):
        question_of(replace(lacking, skeleton={**lacking.skeleton, "arrays": arrays}), [recorded("later", FIRST, 9)])
