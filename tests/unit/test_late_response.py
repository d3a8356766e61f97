"""A response whose recording starts after the command's: what was commanded before it is not thrown away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import experiment
from hil.identification.preparation.gaps import filled
from hil.physics.compose import plant
from hil.record.recording import Recording
from hil.record.table.assemble import assemble
from hil.record.table.columns import Column, Table
from hil.signals.recursion import filtered

STEP_S, LAG_S = 0.01, 0.3
TIME_S = STEP_S * np.arange(600)
COMMAND = np.where(TIME_S < 1.95, 0.0, np.where(TIME_S < 4.0, 4.0, 1.0))


def logged(flow: np.ndarray, late_s: float, gap_s: tuple[float, float] = (0.0, 0.0)) -> Recording:
    """The command from 0 s on and the flow from `late_s` on but for a gap, as two loggers write them."""
    t = TIME_S
    kept = (t >= late_s - 1e-9) & ~((t >= gap_s[0]) & (t < gap_s[1]))
    time_s = Column("time", TIME_S, "s")
    late = [Column("time", TIME_S[kept], "s"), Column("flow", flow[kept], "l/min")]
    found = assemble("x", [Table("a", [time_s, Column("command", COMMAND, "%")]), Table("b", late)])
    assert isinstance(found, Recording)
    return found


def lagging() -> np.ndarray:
    decay = np.exp(-STEP_S / LAG_S)
    noise = 0.02 * np.random.default_rng(0).standard_normal(len(TIME_S))
    flow: np.ndarray = 2.0 * filtered([0.0, 1.0 - decay], [1.0, -decay], COMMAND) + noise
    return flow


@pytest.mark.parametrize("late_s", [0.0, 2.0])
@pytest.mark.parametrize("gap_s", [(0.0, 0.0), (3.0, 3.4), (3.9, 5.5)])
def test_a_late_start_or_a_gap_of_the_response_alone_takes_nothing_of_the_command(late_s, gap_s):
    read = logged(lagging(), late_s, gap_s)
    said = any("flow begins 2 s after" in said and "known before" in said for said in read.meta.get("assumed", ()))
    assert said is (late_s == 2.0)
    start = replace(starting_model("transfer-function"), origin={"structure": "1 pole"})
    found = fit_plant(start, [experiment(read, start.definition, "command", "flow")])
    lag = found.model.parameters["lag_time"]
    assert found.fits["x"] > 98.5 and lag.std is not None and lag.std < 0.002
    assert lag.value == pytest.approx(LAG_S, abs=4.0 * lag.std)


def test_a_gap_on_stamps_off_every_grid_takes_nothing_of_the_command():
    read = logged(lagging(), 2.0, (3.0, 3.4))
    shifted = replace(read.own["flow"], time_s=read.own["flow"].time_s + 0.0033)
    e = experiment(replace(read, own={**read.own, "flow": shifted}), plant("transfer-function"), "command", "flow")
    kept, said = filled(e, LAG_S, forgets=True)
    assert kept is e and e.grid_s is not None and e.grid_s[0] < 0.01
    assert said == [
        "x: gaps in the samples: 1, the longest 0.41 s at 2.993 s, in the output; the command is known in between"
    ]


@pytest.mark.parametrize(("gap_s", "count"), [((0.0, 0.0), 300), ((4.0, 4.5), 250)])
def test_an_integrator_stands_where_its_late_response_begins(gap_s, count):
    position = 3.0 + 5.0 * STEP_S * np.concatenate(([0.0], np.cumsum(COMMAND)[:-1]))
    linear = plant("transfer-function")
    e = experiment(logged(position, 3.0, gap_s), linear, "command", "flow", 0.0)
    drives = linear.typical | {"gain": 0.0, "integrator_gain": 5.0, "start_at_output": 1.0}
    assert int(e.valid.sum()) == count and e.is_late
    np.testing.assert_allclose(e.respond(linear, drives)[0][e.valid], e.valid_output, atol=1e-6)


def test_a_response_without_a_late_start_is_bound_as_before():
    e = experiment(logged(lagging(), 0.0), plant("transfer-function"), "command", "flow")
    assert e.grid_s is None and not e.is_late and len(e.output) == len(TIME_S)
