import math
from dataclasses import replace

import numpy as np
import pytest

from hil.errors import InputError
from hil.identification.frequency.bandwidth import (
    bandwidth,
    magnitude_crossing,
    phase_crossing,
)
from hil.identification.frequency.frequency_response import average, from_fits, from_polar, from_table
from hil.identification.frequency.measuring_chain import MeasuringChain, check_chain, corrected
from hil.identification.frequency.sine_segments import (
    declared_segments,
    found_segments,
    frequency_responses,
    hum_beneath,
)
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import transfer_function
from hil.record.recording import recording
from hil.signals.sine_fit import sine_fit
from hil.signals.stepped_sine import sine

MODEL = transfer_function([40.0], [1.0, 12.0, 50.0], 0.02)
RATE_HZ = 500.0


def respond(command, rate_hz=RATE_HZ):
    definition = plant("transfer-function")
    values = definition.typical | MODEL.to_parameters() | {"offset": 3.0}
    return simulate(definition, values, Drive(command[None, :], math.nan, 1 / rate_hz))[0]


def bench(command, noise=0.0, meta=None, seed=0):
    output = respond(command) + noise * np.random.default_rng(seed).normal(size=len(command))
    time_s = np.arange(len(command)) / RATE_HZ
    return recording("bench", time_s, {"command [%]": command, "flow [l/min]": output}, meta)


def stepped(frequencies, amplitude=10.0, bias=50.0, periods=4):
    return [sine(f, amplitude, RATE_HZ, max(periods, math.ceil(3 * f)), bias=bias) for f in frequencies]


def hold():
    return MeasuringChain(hold_s=1 / RATE_HZ)


FREQUENCIES = (0.2, 0.5, 0.9, 1.3, 2.0, 3.0)


def test_sines_are_found_in_a_plain_recording():
    made = bench(np.concatenate([np.full(300, 50.0), *stepped(FREQUENCIES)]), noise=0.01)
    (response,) = frequency_responses(made, "command", "flow")
    assert np.allclose(response.frequency_hz, FREQUENCIES, rtol=1e-4)
    assert (response.input_unit, response.output_unit) == ("%", "l/min")
    assert (response.amplitude, response.bias) == (pytest.approx(10, rel=1e-3), pytest.approx(50, rel=1e-3))
    exact = MODEL.at(response.frequency_hz)
    assert np.all(np.abs(corrected(response, hold()).response / exact - 1) < 0.01)


def test_tests_at_several_levels_become_responses_of_their_own():
    blocks = [
        *stepped((0.5, 1.3)),
        *stepped((0.5, 1.3), amplitude=20.0, bias=-50.0),
        *stepped((0.5, 1.3), amplitude=5.0),
    ]
    made = bench(np.concatenate(blocks))
    responses = frequency_responses(made, "command", "flow")
    levels = sorted((round(r.amplitude), round(r.bias)) for r in responses)
    assert levels == [(5, 50), (10, 50), (20, -50)]


def test_few_samples_per_period_leave_fewer_harmonics_to_all():
    command = np.concatenate([sine(f, 10.0, RATE_HZ, 40, bias=50.0) for f in (5.0, 20.0, 80.0)])
    (response,) = frequency_responses(bench(command), "command", "flow")
    assert response.harmonics.shape == (3, 2)  # up to the third: 240 of 250 Hz


def test_no_sine_is_found_where_there_is_none():
    still = np.concatenate([np.full(200, level) for level in (0.0, 30.0, -20.0, 50.0)])
    assert found_segments(np.arange(len(still)) / RATE_HZ, still) == []
    square = np.tile(np.repeat([0.0, 1.0], 50), 10)
    assert found_segments(np.arange(len(square)) / RATE_HZ, square) == []
    with pytest.raises(InputError, match="no sine in channel"):
        frequency_responses(bench(still), "command", "flow")


def test_declared_parts_are_taken_as_they_are_and_neighbours_joined():
    command = np.concatenate(stepped((0.5, 2.0)))
    half = 2 * round(RATE_HZ / 0.5)
    part = {"kind": "sine", "amplitude": 10.0, "bias": 50.0}
    parts = [
        {"kind": "note"},
        part | {"frequency_hz": 0.5, "first": half // 2, "count": half},
        part | {"frequency_hz": 0.5, "first": half // 2 + half, "count": half // 2},
        part | {"frequency_hz": 2.0, "first": 4 * round(RATE_HZ / 0.5) + 500, "count": 1000},
    ]
    made = bench(command, meta={"parts": parts})
    segments = declared_segments(made)
    assert [(s.frequency_hz, s.count) for s in segments] == [(0.5, half + half // 2), (2.0, 1000)]
    (response,) = frequency_responses(made, "command", "flow")
    assert np.allclose(corrected(response, hold()).response, MODEL.at(np.array([0.5, 2.0])), rtol=2e-3)


def test_settling_is_cut_off_until_the_response_is_steady():
    slow = transfer_function([1.0], [5.0, 1.0])
    definition = plant("transfer-function")
    command = np.concatenate([np.zeros(100), sine(0.2, 10.0, RATE_HZ, 8)])
    values = definition.typical | slow.to_parameters()
    output = simulate(definition, values, Drive(command[None, :], math.nan, 1 / RATE_HZ))[0]
    columns = {"command [%]": command, "flow [l/min]": output}
    made = recording("slow", np.arange(len(command)) / RATE_HZ, columns)
    (response,) = frequency_responses(made, "command", "flow")
    error = abs(
        response.divided_by(hold().at(response.frequency_hz), "hold").response[0] / slow.at(np.array([0.2]))[0] - 1
    )
    assert error < 0.01
    all_periods = sine_fit(made.time_s[100:], output[100:], 0.2).phasor / 10 * np.exp(2j * np.pi * 0.2 * 0.2)
    assert abs(all_periods / slow.at(np.array([0.2]))[0] - 1) > 2 * error


def test_stated_covariance_is_the_scatter_over_repeats():
    command = np.concatenate(stepped((0.5, 2.0)))
    part = {"kind": "sine", "amplitude": 10.0, "bias": 50.0}
    parts = [
        part | {"frequency_hz": 0.5, "first": 2000, "count": 2000},
        part | {"frequency_hz": 2.0, "first": 4250, "count": 1250},
    ]
    found = [
        frequency_responses(bench(command, 0.5, {"parts": parts}, seed), "command", "flow")[0] for seed in range(60)
    ]
    responses = np.array([r.response for r in found])
    stated = np.mean([r.covariance[:, 0, 0] for r in found], axis=0)
    assert np.allclose(np.var(responses.real, axis=0), stated, rtol=0.5)
    relative = np.array([np.abs(r.normalised().response[1]) for r in found])
    stated_db = np.mean([r.normalised().magnitude_std_db[1] for r in found])
    assert np.std(20 * np.log10(relative)) == pytest.approx(stated_db, rel=0.3)
    # of its own reference a response has no spread, but for what rounding leaves
    assert found[0].normalised().magnitude_std_db[0] < 1e-6 * stated_db
    assert found[0].normalised().magnitude_db[0] == pytest.approx(0.0, abs=1e-12)


def test_harmonics_and_distortion():
    t = np.arange(4000) / RATE_HZ
    u = np.sin(2 * np.pi * 0.5 * t)
    y = 2 * u + 0.2 * np.sin(3 * 2 * np.pi * 0.5 * t + 1)
    response = from_fits("x", [(sine_fit(t, u, 0.5), sine_fit(t, y, 0.5))], ("1", "1"))
    assert response.distortion[0] == pytest.approx(0.1, rel=1e-6)
    assert abs(response.harmonics[0, 1]) == pytest.approx(0.1, rel=1e-6)


def test_a_channel_that_stands_still_to_the_last_bit_is_refused():
    t = np.arange(1000) / RATE_HZ
    still, moving = (sine_fit(t, size * np.sin(np.pi * t), 0.5) for size in (0.0, 1.0))
    with pytest.raises(InputError, match=r"the input does not move at 0\.5 Hz"):
        from_fits("x", [(still, moving)], ("1", "1"))
    with pytest.raises(InputError, match=r"the output does not move at 0\.5 Hz"):
        from_fits("x", [(moving, still)], ("1", "1"))
    with pytest.raises(InputError, match="no sine"):
        from_fits("x", [], ("1", "1"))


PAPER = np.arange(25) * 0.2 + 0.1


def table(model=MODEL, frequencies=PAPER):
    h = model.at(frequencies)
    return from_table("table", frequencies, 20 * np.log10(np.abs(h)), np.degrees(np.angle(h)))


def test_phase_is_unwrapped_beyond_360_degrees():
    late = transfer_function([1.0], [0.1, 1.0], 0.3)
    assert table(late).phase_deg[-1] < -500


def test_a_mean_needs_one_grid():
    mean = average([table(), table()])
    assert np.allclose(mean.response, table().response)
    with pytest.raises(InputError, match="other frequencies than"):
        average([table(), table(frequencies=np.array([0.1, 0.2]))])


def test_crossings_come_with_uncertainty_or_say_not_reached():
    command = np.concatenate(stepped(FREQUENCIES))
    found = []
    for seed in range(30):
        (response,) = frequency_responses(bench(command, 1.0, seed=seed), "command", "flow")
        found.append(phase_crossing(response, -90.0))
    spread = np.std([c.frequency_hz for c in found])
    assert np.mean([c.std_hz for c in found]) == pytest.approx(spread, rel=0.4)
    never = magnitude_crossing(table(frequencies=np.array([0.1, 0.2, 0.3])), -3.0)
    assert never.frequency_hz is None
    assert str(never) == "-3 dB: not reached up to 0.3 Hz"
    assert str(phase_crossing(table(), -90.0)).startswith("-90 °: 1.0")


@pytest.mark.parametrize(("std", "below_hz"), [(None, 3.0), (0.001, 3.0), (1.0, None)])
def test_a_response_that_begins_below_a_level_bounds_its_crossing_from_above(std, below_hz):
    frequencies = np.array([3.0, 4.0, 6.0])
    late = from_polar("bench", frequencies, MODEL.at(frequencies))
    assert np.all(late.phase_deg < -90.0)
    if std is not None:
        late = replace(late, covariance=np.tile((std * abs(late.response[0])) ** 2 * np.eye(2), (3, 1, 1)))
    found = phase_crossing(late, -90.0)
    assert found.frequency_hz is None and found.beyond_hz == 0.0
    assert found.below_hz == (None if below_hz is None else pytest.approx(below_hz))
    if below_hz is not None:
        assert str(found) == "-90 °: below 3 Hz"


@pytest.mark.parametrize(("noise", "least_told"), [(0.003, 1.0), (0.03, 1.0), (0.06, 0.9)])
def test_the_crossing_of_a_flat_noisy_curve_is_held_by_its_interval(noise, least_told):
    # a small amplitude within friction: 4 dB over a decade; the slope at a noisy crossing alone would hold too few
    frequencies = np.array([0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0])
    size = np.interp(np.log(frequencies), np.log([0.2, 1.0, 4.0, 15.0]), [1.0, 0.85, 0.65, 0.2])
    clean = from_polar("bench", frequencies, size * np.exp(-0.2j * frequencies))
    covariance = np.tile(noise**2 * np.eye(2), (len(frequencies), 1, 1))
    wanted = [(crossing, level, crossing(clean, level).frequency_hz) for crossing, level in
              ((magnitude_crossing, -3.0), (phase_crossing, -90.0))]  # fmt: skip
    rng, held, told, bounds = np.random.default_rng(0), [], [], []
    for _ in range(120):
        parts = noise * rng.normal(size=(2, len(frequencies)))
        noisy = replace(clean, response=clean.response + parts[0] + 1j * parts[1], covariance=covariance)
        for crossing, level, truth in wanted:
            found = crossing(noisy, level)
            told.append(found.frequency_hz is not None)
            if found.frequency_hz is None:
                bounds.append(found.beyond_hz <= truth)
            else:
                held.append(abs(found.frequency_hz - truth) <= 2.0 * found.std_hz)
    assert np.mean(told) >= least_told
    assert 0.92 <= np.mean(held) <= 0.985
    assert all(bounds)


def test_what_lies_between_sparse_lines_is_in_the_interval_of_a_crossing():
    valve = transfer_function([1.0], np.polymul([2e-6, 2e-3, 1.0], [1 / 250.0, 1.0]), 0.001)  # 39 Hz, in the last gap
    dense, sparse = np.geomspace(1.02, 50.0, 200), np.array([1.02, 7.43, 10.9, 15.9, 23.3, 34.2, 50.0])
    truth = phase_crossing(from_polar("bench", dense, valve.at(dense)), -90.0).frequency_hz
    quiet = replace(from_polar("bench", sparse, valve.at(sparse)), covariance=np.tile(1e-12 * np.eye(2), (7, 1, 1)))
    found = phase_crossing(quiet, -90.0)
    assert abs(found.frequency_hz - truth) > 20.0 * 1e-6 * truth  # far beyond what the lines' noise makes
    assert abs(found.frequency_hz - truth) <= 2.0 * found.std_hz
    assert found.std_hz < 0.003 * truth


def test_the_reference_is_in_every_line_alike():
    frequencies = np.array([0.2, 0.4, 0.65, 1.15, 2.5])
    covariance = np.tile(1e-12 * np.eye(2), (5, 1, 1))
    covariance[0] = 1e-4 * np.eye(2)  # the reference alone is uncertain, by 0.087 dB
    made = replace(from_polar("bench", frequencies, MODEL.at(frequencies)), covariance=covariance)
    gain = np.abs(made.response[0])
    shifted = [magnitude_crossing(made, -3.0 + sign * 20.0 * math.log10(1.0 + 0.01 / gain)) for sign in (1.0, -1.0)]
    apart = (shifted[1].frequency_hz - shifted[0].frequency_hz) / 2.0
    assert magnitude_crossing(made, -3.0).std_hz == pytest.approx(apart, rel=0.02)


def test_lines_that_nothing_passes_do_not_bend_a_crossing():
    frequencies = np.array([0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0])
    heard = MODEL.at(frequencies)
    for lost in (1e-3, 1e-6):
        response = np.concatenate((heard, lost * heard[:1] * np.exp([1.0j, 3.0j])))
        made = from_polar("bench", np.append(frequencies, [14.0, 20.0]), response)
        noisy = replace(made, covariance=np.tile(1e-4 * np.eye(2), (10, 1, 1)))
        alone = noisy.select(np.arange(10) < 8)
        assert magnitude_crossing(noisy, -3.0).frequency_hz == magnitude_crossing(alone, -3.0).frequency_hz
        assert phase_crossing(noisy, -90.0).frequency_hz == phase_crossing(alone, -90.0).frequency_hz
        far = magnitude_crossing(noisy, -60.0)  # none that is heard is so low: all lines count, and do not tell it
        assert far.frequency_hz is None
        assert 4.0 <= far.beyond_hz < 20.0


def test_the_reference_rule_is_held():
    found = bandwidth(table())
    assert "the rule asks for 5 % or less" in found.notes[0]
    assert bandwidth(table(frequencies=np.geomspace(0.01, 20.0, 60))).notes == ()
    high = bandwidth(table(frequencies=np.array([6.0, 8.0, 10.0])))
    assert "the rule asks for 5 Hz or less" in high.notes[0]


def test_the_measuring_chain_is_held_against_one_per_cent_and_taken_out():
    chain = MeasuringChain(sensor_lag_s=0.002)
    checked = check_chain(chain, np.array([0.1, 0.5, 1.0, 4.9]))
    assert checked.broken_from_hz == 1.0  # 2 ms is 0.72° at 1 Hz
    assert checked.phase_deg[-1] == pytest.approx(-3.5, abs=0.05)
    assert "from 1 Hz on" in checked.sentence
    fine = check_chain(MeasuringChain(skew_s=14e-6), np.array([0.1, 4.9]))
    assert fine.broken_from_hz is None
    assert fine.phase_deg[-1] == pytest.approx(0.025, abs=1e-3)
    assert "less than 1 %" in fine.sentence
    clean = table()
    spoiled = clean.divided_by(1 / chain.at(clean.frequency_hz), "spoiled")
    assert np.allclose(corrected(spoiled, chain).response, clean.response)
    assert "sensor lag 2 ms" in corrected(spoiled, chain).corrections[-1]


def _in_parts(frequencies, waves):
    edges = np.cumsum([0, *map(len, waves)])
    return {"parts": [
        {"kind": "sine", "frequency_hz": f, "first": int(a), "count": len(wave), "amplitude": 10.0, "bias": 50.0}
        for f, wave, a in zip(frequencies, waves, edges, strict=False)
    ]}  # fmt: skip


@pytest.mark.parametrize("hum", [0.0, 0.5])
def test_a_tone_beneath_sines_is_told_from_their_harmonics(hum):
    frequencies = [0.4, 0.7, 2.0]
    waves = stepped(frequencies)
    command = np.concatenate(waves)
    made = bench(command, 0.05, _in_parts(frequencies, waves))
    bent = made.values("flow") + 0.002 * made.values("flow") ** 2  # harmonics of its own
    bent = bent + hum * np.sin(2.0 * np.pi * 50.0 * made.time_s)
    made = recording("bench", made.time_s, {"command [%]": command, "flow [l/min]": bent}, made.meta)
    found = hum_beneath(made, "flow", declared_segments(made))
    assert found == pytest.approx(50.0, abs=0.05) if hum else found is None


def test_a_straight_drift_is_no_gain():
    frequencies = [0.4, 0.7]
    waves = stepped(frequencies)
    command = np.concatenate(waves)
    still = bench(command, 0.0, _in_parts(frequencies, waves))
    drifting = recording(
        "bench", still.time_s,
        {"command [%]": command, "flow [l/min]": still.values("flow") + 0.5 * still.time_s}, still.meta,
    )  # fmt: skip
    (plain,), (found,) = (frequency_responses(one, "command", "flow") for one in (still, drifting))
    assert np.abs(found.response / plain.response - 1.0).max() < 1e-4
