import math
from itertools import pairwise

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.papers.step_models import step_models
from hil.identification.step.step_estimate import measured_steps
from hil.identification.step.step_response import second_order_from_step, step_figures
from hil.physics.transfer_function import transfer_function
from hil.record.recording import recording
from hil.signals.recursion import filtered
from procedures._statistics import extreme
from procedures.step_response import OVERSHOOT

RATE_HZ = 500.0
FIRST = transfer_function([1.0], [0.1, 1.0], 0.05)


def bench(model, levels, noise=0.0, seed=0, hold_s=2.0):
    """A linear model's response to steps, each held until it has settled."""
    n = round(hold_s * RATE_HZ)
    time_s = np.arange(n) / RATE_HZ
    output = [np.full(n, levels[0])]
    for before, after in pairwise(levels):
        output.append(before + (after - before) * model.step(time_s))
    y = np.concatenate(output)
    y = y + noise * np.random.default_rng(seed).normal(size=len(y))
    columns = {"command [%]": np.repeat(levels, n), "flow [l/min]": y}
    return recording("steps", np.arange(len(y)) / RATE_HZ, columns)


def test_figures_of_a_first_order_lag_with_dead_time():
    time_s = np.arange(0, 2, 1e-4)
    figures = step_figures(time_s, FIRST.step(time_s), start=0.0, final=1.0)
    assert figures.rise_s == pytest.approx(0.1 * math.log(9), abs=2e-4)
    assert figures.response_s == pytest.approx(0.05 + 0.1 * math.log(10), abs=2e-4)
    assert figures.settling_s == pytest.approx(0.05 + 0.1 * math.log(50), abs=2e-4)
    assert figures.band_entry_s == pytest.approx(figures.settling_s, abs=1e-4)
    assert figures.onset_s == pytest.approx(0.05 - 0.1 * math.log(0.98), abs=2e-4)
    assert figures.overshoot == 0.0


def test_settling_counts_the_overshoot_and_reaching_does_not():
    ring = transfer_function([100.0], [1.0, 4.0, 100.0])
    time_s = np.arange(0, 4, 1e-3)
    figures = step_figures(time_s, ring.step(time_s), start=0.0, final=1.0)
    assert figures.overshoot == pytest.approx(math.exp(-math.pi * 0.2 / math.sqrt(0.96)), abs=1e-3)
    assert figures.settling_s > 4 * figures.band_entry_s
    wide = step_figures(time_s, ring.step(time_s), start=0.0, final=1.0, band=0.1)
    assert wide.settling_s < figures.settling_s


def test_every_step_of_a_recording_is_measured_with_honest_uncertainty():
    levels = (0.0, 50.0, 20.0, -40.0)
    found = [measured_steps(bench(FIRST, levels, 0.2, seed), "command", "flow") for seed in range(12)]
    assert [(s.from_command, s.to_command) for s in found[0]] == [(0, 50), (50, 20), (20, -40)]
    assert found[0][0].noise_std == pytest.approx(0.2, rel=0.1)
    for i in range(3):
        rises = [steps[i].figures.rise_s for steps in found]
        stated = np.mean([steps[i].std.rise_s for steps in found])
        assert np.mean(rises) == pytest.approx(0.1 * math.log(9), rel=0.03)
        assert 0.7 < stated / np.std(rises) < 2.2  # on the safe side: noise of the base and of the draw both count
        assert found[0][i].figures.final == pytest.approx(levels[i + 1], abs=0.1)
        assert found[0][i].figures.overshoot < 0.02


def test_noise_is_no_motion_at_the_end_of_a_step_and_creep_is():
    levels = (0.0, 50.0, 20.0, -40.0)
    steps = [one for seed in range(12) for one in measured_steps(bench(FIRST, levels, 0.2, seed), "command", "flow")]
    assert sum(one.moving != 0.0 for one in steps) <= 1
    slow = transfer_function([0.15, 1.0], [0.2 * 0.02, 0.22, 1.0])  # three quarters at once, the rest in 1 s
    for seed in range(4):
        (creeping,) = measured_steps(bench(slow, (0.0, 50.0), 0.02, seed, hold_s=0.6), "command", "flow")
        assert creeping.moving > 0.0


def test_a_dead_time_is_said_only_where_settling_is_known_so_well():
    assert "dead time of 0.109 s" in str(step_models(0.2, 0.465, std_s=(0.01, 0.01)).notes[0])
    for std_s in ((0.01, 0.1), (0.1, 0.01), (0.01, math.inf)):
        assert not step_models(0.2, 0.465, std_s=std_s).notes


@pytest.mark.parametrize("corner_hz", [100.0, 40.0, 15.0])
def test_coloured_noise_is_no_overshoot_and_widens_what_is_stated(corner_hz):
    keep = math.exp(-2.0 * math.pi * corner_hz / RATE_HZ)
    rises, stated = [], []
    for seed in range(12):
        plain = bench(FIRST, (0.0, 50.0))
        white = np.random.default_rng(seed).normal(size=len(plain) + 500)
        noise = filtered([1.0 - keep], [1.0, -keep], white)[500:]
        noisy = plain.values("flow") + 0.2 * noise / noise.std()
        columns = {"command [%]": plain.values("command"), "flow [l/min]": noisy}
        (found,) = measured_steps(recording("noisy", plain.time_s, columns), "command", "flow")
        assert found.figures.overshoot < 4.0 * found.std.overshoot
        assert found.noise_std == pytest.approx(0.2, rel=0.35)
        rises.append(found.figures.rise_s)
        stated.append(found.std.rise_s)
    assert 0.6 < np.mean(stated) / np.std(rises) < 2.2


def test_what_is_no_step_response_is_said():
    with pytest.raises(InputError, match="does not change"):
        step_figures(np.arange(100.0), np.ones(100))
    with pytest.raises(InputError, match="does not reach 90 %"):
        step_figures(np.arange(100.0), np.linspace(0, 0.5, 100), start=0.0, final=1.0)
    still = recording("r", np.arange(50.0), {"command [%]": np.linspace(0, 1, 50), "flow [l/min]": np.ones(50)})
    with pytest.raises(InputError, match="holds no step"):
        measured_steps(still, "command", "flow")


def test_times_of_no_second_order_model_are_refused():
    with pytest.raises(InputError, match="no underdamped"):
        second_order_from_step(2.0, 1.0)


def test_a_dead_time_that_noise_alone_could_make_is_not_told():
    time_s, command = np.arange(4000) / 1000.0, np.repeat([0.0, 1.0], 2000)
    late = np.maximum(time_s - 2.06, 0.0)
    clean = 30.0 * -np.expm1(-late / 0.03)
    told = {}
    for noise in (0.02, 3.0):
        values = clean + noise * np.random.default_rng(3).normal(size=len(time_s))
        (told[noise],) = measured_steps(
            recording("steps", time_s, {"command [A]": command, "pressure [psi]": values}), "command", "pressure"
        )
    assert told[0.02].figures.onset_s == pytest.approx(0.0606, abs=2.0 * told[0.02].std.onset_s)
    assert told[0.02].std.onset_s < 3e-4
    assert math.isinf(told[3.0].std.onset_s)


def test_a_foot_that_a_smooth_estimate_rounds_is_timed_as_well_as_is_said():
    time_s, command = np.arange(4000) / 1000.0, np.repeat([0.0, 1.0], 2000)
    late = np.maximum(time_s - 2.02, 0.0)
    # an integrator behind a valve: the way begins with the cube of time
    clean = 24.0 * (1.0 - np.exp(-late / 0.3) * (1.0 + late / 0.3 + late**2 / 0.18))
    truth = 0.02 + float(np.interp(0.02 * 24.0, clean[2000:3000], np.maximum(late[2000:3000], 0.0)))
    off = []
    for seed in range(6):
        values = clean + 0.1 * np.random.default_rng(seed).normal(size=len(time_s))
        (found,) = measured_steps(
            recording("steps", time_s, {"command [A]": command, "way [mm]": values}), "command", "way"
        )
        off.append((found.figures.onset_s - truth) / found.std.onset_s)
    assert np.sqrt(np.mean(np.square(off))) < 1.6
    assert np.max(np.abs(off)) < 3.0


def one_step(clean, seed, noise, grid=0.0, shift=0.0):
    """A step at half time, read with noise by a converter whose codes lie `grid` apart."""
    values = clean + noise * np.random.default_rng(seed).normal(size=len(clean))
    if grid:
        values = grid * (np.rint(values / grid + shift) - shift)
    command = np.repeat([0.0, 1.0], len(clean) // 2)
    columns = {"command [A]": command, "way [mm]": values}
    return measured_steps(recording("step", np.arange(len(clean)) / 1000.0, columns), "command", "way")[0]


def test_an_overshoot_that_a_smoothed_corner_could_make_is_a_bound_that_holds():
    late = np.maximum(np.arange(-4000, 4000) / 1000.0 - 0.05, 0.0)
    # a spool closes with a corner and leaves a leak that comes back slowly: 0.22 % beyond
    shut, truth = np.minimum(late / 0.2, 1.0), 0.0022
    clean = -50.0 * (shut + truth * shut**20 * np.exp(-np.maximum(late - 0.2, 0.0) / 0.3))
    for seed in range(6):
        found = one_step(clean, seed, 0.3)
        told = extreme(OVERSHOOT, found.figures.overshoot, found.std.overshoot, made_by_noise=found.made_by_noise)
        assert told.relation == "<" and told.value > truth
    ring = transfer_function([100.0], [1.0, 4.0, 100.0])
    found = one_step(np.concatenate((np.zeros(4000), 50.0 * ring.step(np.arange(4000) / 1000.0))), 0, 0.3)
    told = extreme(OVERSHOOT, found.figures.overshoot, found.std.overshoot, made_by_noise=found.made_by_noise)
    assert told.relation == "=" and told.value == pytest.approx(0.527, abs=2.0 * found.std.overshoot)


def test_levels_that_stand_on_one_code_are_known_to_what_rounding_hides():
    late, grid = np.maximum(np.arange(-3000, 3000) / 1000.0 - 0.02, 0.0), 0.254
    off, stds = [], []
    for seed in range(5):
        shift = float(np.random.default_rng(seed + 100).random())
        found = one_step(24.0 * -np.expm1(-late / 0.3), seed, 0.02, grid, shift)
        off.append(found.figures.final - found.figures.start - 24.0)
        stds.append(found.change_std)
    assert np.mean(stds) == pytest.approx(grid / math.sqrt(6.0), rel=0.25)
    assert np.max(np.abs(off)) < grid
