import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import hil
from hil.errors import InputError
from hil.identification.frequency import bands
from hil.identification.frequency.frequency_response import from_polar, from_table
from hil.identification.frequency.held_out import held_out
from hil.identification.frequency.order_choice import fit_together, fit_transfer_function
from hil.identification.frequency.rational import Form
from hil.identification.frequency.right_half_plane import wrong_way
from hil.identification.frequency.table_fit import as_table
from hil.identification.frequency.transfer_function import fit_form
from hil.physics.published.tordal import RUNS
from hil.physics.readings import readings
from hil.physics.transfer_function import transfer_function
from tests.once import once

FREQUENCIES = np.arange(25) * 0.2 + 0.1
TEN = RUNS[1].transfer_function
TEN_COEFFICIENTS = np.array([-150.8, 6361.0, 31.7, 1225.0, 6345.0])


def noisy(model, relative=0.01, seed=None, frequencies=FREQUENCIES):
    """A table of a model with relative complex noise, and the covariance stated."""
    h = model.at(frequencies)
    lines = from_table("lines", frequencies, 20 * np.log10(np.abs(h)), np.degrees(np.angle(h)))
    covariance = np.eye(2) * ((relative * np.abs(h)) ** 2 / 2)[:, None, None]
    if seed is not None:
        rng = np.random.default_rng(seed)
        noise = (rng.normal(size=len(h)) + 1j * rng.normal(size=len(h))) / math.sqrt(2)
        h = h * (1 + relative * noise)
    return replace(lines, response=h, covariance=covariance)


def test_errors_are_at_the_cramer_rao_bound():
    # 25 lines of table 1, 10 %, with 1 % noise: the bound is 1.52, 0.74, 0.73, 0.62, 0.93 % of the coefficients
    fits = [fit_form(noisy(TEN, seed=seed), Form(3, 1)) for seed in range(200)]
    errors = np.array([fit.coefficients / TEN_COEFFICIENTS - 1 for fit in fits])
    rms = 100 * np.sqrt(np.mean(errors**2, axis=0))
    bound = 100 * fit_form(noisy(TEN), Form(3, 1)).coefficient_std / np.abs(TEN_COEFFICIENTS)
    assert bound == pytest.approx([1.52, 0.74, 0.73, 0.62, 0.93], abs=0.006)
    assert np.all(rms / bound < 1.1)
    inside = np.abs(errors * TEN_COEFFICIENTS) < 1.96 * np.array([fit.coefficient_std for fit in fits])
    assert 0.92 <= inside.mean() <= 0.98


def test_misfit_is_one_for_stated_noise_and_widens_the_intervals_beyond_it():
    fine = fit_form(noisy(TEN, seed=1), Form(3, 1))
    assert fine.misfit == pytest.approx(1.0, abs=0.4)
    poor = fit_form(noisy(TEN, seed=1), Form(2, 0))
    assert poor.misfit > 100
    trusting = poor.coefficient_std / math.sqrt(poor.misfit)
    assert np.all(poor.coefficient_std > 10 * trusting)


def test_uncertainty_of_a_table_comes_from_its_residual():
    lines = noisy(TEN, seed=3)
    unknown = replace(lines, covariance=np.full((25, 2, 2), math.nan))
    found = fit_form(unknown, Form(3, 1))
    assert found.weights == "relative"
    assert math.isnan(found.misfit)
    assert np.allclose(found.coefficient_std, fit_form(lines, Form(3, 1)).coefficient_std, rtol=0.35)


@pytest.mark.parametrize(
    ("model", "form"),
    [
        (transfer_function([3.0], [0.2, 1.0]), Form(1, 0)),
        (transfer_function([2.0, 5.0], [1.0, 2.0, 30.0]), Form(2, 1)),
        (transfer_function([2.0], [1.0, 2.0, 30.0], 0.08), Form(2, 0, dead_time=True)),
        (transfer_function([2.0], [1.0, 2.0, 30.0], 0.08), Form(2, 0, dead_time_s=0.08)),
        (TEN, Form(3, 1)),
        (transfer_function([1.0, 2.0, 200.0], np.poly([-3, -8 + 20j, -8 - 20j])), Form(3, 2)),
        (transfer_function([1.0], np.poly([-3, -5, -8, -20]), 0.03), Form(4, 0, dead_time=True)),
        (transfer_function([1.0, 3.0], np.poly([-2 + 4j, -2 - 4j, -3 + 15j, -3 - 15j, -9])), Form(5, 1)),
        (transfer_function([1.0, 9.0], [1.0, 3.0]), Form(1, 1)),
        (transfer_function([1.0], [1.0, 2.0, -30.0]), Form(2, 0, stable=False)),
    ],
)
def test_exact_data_give_the_model_back(model, form):
    found = fit_form(noisy(model), form)
    assert found.converged
    assert np.allclose(found.model.at(FREQUENCIES), model.at(FREQUENCIES), rtol=1e-6)
    assert np.allclose(found.model.denominator, model.denominator, rtol=1e-3)
    assert found.model.dead_time_s == pytest.approx(model.dead_time_s, abs=1e-6)
    assert found.fit_percent > 99.999


def test_unstable_data_are_fitted_stably_when_asked():
    lines = noisy(transfer_function([1.0], [1.0, 2.0, -30.0]))
    assert fit_form(lines, Form(2, 0)).model.is_stable
    loose = fit_transfer_function(lines, poles=2, zeros=0, dead_time=False, stable=False)
    assert not loose.model.is_stable
    assert "unstable" in " ".join(loose.notes)


def test_zeros_stay_out_of_the_right_half_plane_when_asked():
    found = fit_form(noisy(TEN), Form(3, 1, minimum_phase=True))
    assert not found.model.right_half_plane_zeros.size
    assert found.fit_percent < fit_form(noisy(TEN), Form(3, 1)).fit_percent


def test_orders_are_found_by_evidence():
    found = fit_transfer_function(noisy(TEN, seed=5))
    assert (found.form.poles, found.form.zeros, found.form.dead_time) == (3, 1, False)
    assert len(found.candidates) > 20
    assert found.candidates[0].bic == min(c.bic for c in found.candidates)
    late = transfer_function([30.0], [1.0, 4.0, 30.0], 0.06)
    form = fit_transfer_function(noisy(late, seed=5)).form
    assert (form.poles, form.zeros, form.dead_time) == (2, 0, True)
    simple = fit_transfer_function(noisy(transfer_function([3.0], [0.2, 1.0]), seed=2)).form
    assert (simple.poles, simple.zeros, simple.dead_time) == (1, 0, False)


def test_a_nonlinear_misfit_does_not_buy_poles():
    lines = noisy(transfer_function([3.0], [0.2, 1.0]), relative=1e-4, seed=2)
    ripple = 1 + 0.02 * np.sin(7 * FREQUENCIES) * np.cos(3.1 * FREQUENCIES**2)
    found = fit_transfer_function(replace(lines, response=lines.response * ripple))
    assert found.form.poles <= 2
    assert "a linear model of this form misses the lines" in found.notes[0]


def test_the_right_half_plane_zero_is_explained_and_the_alternative_offered():
    late = transfer_function([1225.0 * 6], np.poly([-6.0, -12 + 32j, -12 - 32j]), 0.03)
    found = fit_transfer_function(noisy(late, relative=0.003, seed=1), poles=3, zeros=1, dead_time=False)
    assert found.model.right_half_plane_zeros.size == 1
    other = found.alternative
    assert other.model.dead_time_s == pytest.approx(0.03, abs=0.002)
    assert other.fit_percent > found.fit_percent
    note = " ".join(found.notes)
    assert "held-out lines prefer the dead time" in note
    assert "a step response decides" in note and "poles 3, zeros 0 and a dead time" in note


def test_a_good_zero_needs_no_explanation():
    lead = transfer_function([2.0, 20.0], [1.0, 4.0, 30.0])
    found = fit_transfer_function(noisy(lead), poles=2, zeros=1, dead_time=False)
    assert found.alternative is None
    assert found.notes == ()
    assert wrong_way(lead).share == 0.0


def test_bands_agree_with_the_scatter_over_repeats():
    fits = [fit_form(noisy(TEN, seed=seed), Form(3, 1)) for seed in range(60)]
    at = np.array([0.3, 1.2, 4.0])
    stated = bands.bode_band(fits[0], at)
    scattered = [20 * np.log10(np.abs(fit.model.at(at))) for fit in fits]
    assert np.allclose(np.std(scattered, axis=0), stated.magnitude_std_db, rtol=0.4)
    phases = [np.degrees(np.unwrap(np.angle(fit.model.at(at)))) for fit in fits]
    assert np.allclose(np.std(phases, axis=0), stated.phase_std_deg, rtol=0.4)


def test_held_out_errors_have_the_size_of_the_noise_for_the_right_form():
    lines = noisy(TEN, seed=1)
    right = held_out(lines, fit_form(lines, Form(3, 1)))
    assert right.shape == (23,)
    assert np.mean(right) == pytest.approx(2.0, abs=1.2)
    assert np.mean(held_out(lines, fit_form(lines, Form(2, 0)))) > 50
    few = noisy(TEN, frequencies=FREQUENCIES[:3])
    assert held_out(few, fit_form(few, Form(3, 1))).size == 0


def test_summary_states_coefficients_with_intervals():
    text = fit_transfer_function(noisy(TEN, seed=1), poles=3, zeros=1, dead_time=False).summary()
    assert "b1" in text and "±" in text and "zeros 42" in text and "note:" in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"poles": 2, "zeros": 3}, "no more zeros than poles"),
        ({"poles": 0, "zeros": 0}, "at least one pole"),
        ({"poles": 3, "zeros": 1, "dead_time": -0.1}, "no negative dead time"),
    ],
)
def test_impossible_forms_are_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        fit_transfer_function(noisy(TEN), **{"dead_time": False} | arguments)


def test_too_few_lines_are_refused():
    with pytest.raises(InputError, match="2 frequencies for 5 unknowns; at least 3"):
        fit_form(noisy(TEN, frequencies=FREQUENCIES[:2]), Form(3, 1))


def test_lines_of_several_amplitudes_that_no_form_comes_near_are_fitted_all_the_same():
    rates = ((25.0, 0.7, 0.19, 0.047), (38.0, 0.5, 0.16, 0.022), (22.0, 0.4, 0.155, 0.047), (30.0, 0.5, 0.16, 0.0))
    each = [
        transfer_function([0.85], np.polymul([lag, 1.0], [1 / w**2, 2 * z / w, 1.0]), late) for w, z, lag, late in rates
    ]
    frequency_hz = np.repeat(FREQUENCIES, len(each))
    response = np.array([one.at(FREQUENCIES) for one in each]).T.ravel()
    stds = np.full(len(response), 4e-4)
    for seed in (0, 2, 4):
        scattered = response * (1.0 + np.random.default_rng(seed).normal(0.0, 1e-4, len(response)))
        together = from_polar("all", frequency_hz, scattered, stds, stds, ("%", "l/min"))
        found = fit_transfer_function(together)
        assert found.fit_percent > 50.0
        assert any("misses the lines by more than their noise" in note for note in found.notes)


def test_time_constants_and_oscillations_come_first_each_with_two_digits_of_its_interval():
    real = transfer_function([2.0], np.polymul([0.3, 1.0], [0.1, 1.0]))
    text = fit_transfer_function(noisy(real, seed=1), poles=2, zeros=0, dead_time=False).summary().splitlines()
    constants = [line.split() for line in text if line.startswith("  time constant")]
    for words, truth in zip(constants, (0.3, 0.1), strict=True):
        value, half = float(words[2]), float(words[4])
        assert abs(value - truth) < 2.0 * half < 0.1
        assert len(words[2].partition(".")[2]) == len(words[4].partition(".")[2])
    assert text[0].startswith("2 poles, 0 zeros") and text[1].split()[0] == "gain" and "0j" not in "".join(text)

    turning = transfer_function([2.0], [1 / 20.0**2, 2 * 0.3 / 20.0, 1.0])
    text = fit_transfer_function(noisy(turning, seed=1), poles=2, zeros=0, dead_time=False).summary()
    read = {
        words[0]: float(words[1]) for words in map(str.split, text.splitlines()) if words[0] in ("frequency", "damping")
    }
    assert read == pytest.approx({"frequency": 20.0, "damping": 0.3}, rel=0.05)


def test_the_dead_time_is_as_uncertain_as_forms_that_fit_as_well_leave_it():
    below = np.polymul([1 / 7.0, 1.0], [1 / 33.0**2, 1 / 33.0, 1.0])
    ten_lines = np.array([0.1, 0.3, 0.7, 1.1, 1.5, 1.9, 2.5, 3.3, 4.1, 4.9])
    late = transfer_function([1.0], below, 0.02)
    fits = [fit_transfer_function(noisy(late, 0.003, seed, ten_lines)) for seed in (0, 1, 2, 3)]
    stated = [fit for fit in fits if fit.form.dead_time]
    assert len(stated) >= 2
    for fit in stated:
        assert abs(fit.model.dead_time_s - 0.02) < 1.96 * fit.coefficient_std[-1]
        assert fit.coefficient_std[-1] > fit.scatter[-1]
        assert ("not identifiable" in fit.summary()) is math.isinf(fit.form_std_s)


def test_a_dead_time_that_no_line_tells_leaves_a_model_file_that_is_read(tmp_path):
    below = np.polymul([1 / 7.0, 1.0], [1 / 33.0**2, 1 / 33.0, 1.0])
    few_lines = np.array([0.5, 1.0, 2.0, 4.0])
    for seed in range(8):
        table = as_table(noisy(transfer_function([1.0], below, 0.02), 0.003, seed, few_lines), "u", "y")
        found = hil.identify([table], "transfer-function", poles=3, zeros=0, dead_time=True).model
        hil.save_model(found, tmp_path / "model.json")
        assert hil.load_model(tmp_path / "model.json").covariance == found.covariance
        assert np.isfinite(found.covariance.matrix).all()


def third_order(rate, frequency, damping, late):
    """A pilot of first and a spool of second order behind a dead time."""
    below = np.polymul([1 / rate, 1.0], [1 / frequency**2, 2 * damping / frequency, 1.0])
    return transfer_function([1.0], below, late)


RATES = (5.0, 6.0, 7.0, 8.0)


@cache
def fits_of_a_valve(part):
    """The forms, slowest poles, dead times and their deviations of five seeds of a valve; workers share the parts."""

    def fitted(seed):
        valve = [third_order(rate, 33.0, 0.4, 0.02) for rate in RATES]
        fits = fit_together([noisy(one, 0.01, 10 * seed + k) for k, one in enumerate(valve)])
        late = [(fit.model.dead_time_s, fit.coefficient_std[-1]) for fit in fits if fit.form.dead_time]
        return {fit.form for fit in fits}, [min(abs(fit.model.poles)) for fit in fits], late

    return once(f"valve-{part}", lambda: [fitted(seed) for seed in range(5 * part, 5 * part + 5)])


@pytest.mark.parametrize("part", range(4))
def test_one_form_is_chosen_for_all_responses_of_a_valve_and_parameters_move(part):
    for forms, slowest, _ in fits_of_a_valve(part):
        assert len(forms) == 1
        assert slowest == pytest.approx(RATES, rel=0.25)


def test_dead_times_of_a_valve_lie_within_their_intervals():
    late = [one for part in range(4) for *_, late in fits_of_a_valve(part) for one in late]
    inside = [abs(time_s - 0.02) < 1.96 * std_s for time_s, std_s in late]
    assert len(inside) >= 60 and np.mean(inside) >= 0.93


def test_dead_times_that_disagree_widen_each_others_intervals():
    apart = [noisy(third_order(7.0, 33.0, 0.4, late), 0.003, k) for k, late in enumerate((0.02, 0.03, 0.04))]
    fits = fit_together(apart, poles=3, zeros=0, dead_time=True)
    for fit in fits:
        assert fit.form_std_s == pytest.approx(0.01, rel=0.3)
        assert abs(fit.model.dead_time_s - 0.03) < 1.96 * fit.coefficient_std[-1]
    (alone,) = fit_together(apart[:1], poles=3, zeros=0, dead_time=True)
    assert alone.form_std_s == 0.0


def test_a_response_within_its_noise_has_no_say_in_the_form():
    late = third_order(7.0, 33.0, 0.4, 0.02)
    clear = [noisy(late, 0.003, seed) for seed in (0, 1)]
    lost = noisy(late, 5.0, 2)
    with_it, without = fit_together([*clear, lost]), fit_together(clear)
    assert with_it[2] is None
    assert [fit.form for fit in with_it[:2]] == [fit.form for fit in without]


def test_lines_that_alone_ask_for_another_form_are_named():
    plain = [noisy(third_order(7.0, 33.0, 0.4, 0.02), 0.003, seed) for seed in (0, 1, 2)]
    resonant = third_order(7.0, 33.0, 0.4, 0.02).at(FREQUENCIES) * (
        1 + 0.05 * np.exp(-((FREQUENCIES - 2.5) ** 2) / 0.1)
    )
    other = replace(plain[0], response=resonant)
    fits = fit_together([*plain, other])
    assert len({fit.form for fit in fits}) == 1
    assert ["ask for another" in " ".join(fit.notes) for fit in fits] == [False, False, False, True]


def test_the_covariance_of_a_dead_time_holds_its_form():
    fit = fit_transfer_function(noisy(third_order(7.0, 33.0, 0.4, 0.02), 0.003, 1), poles=3, zeros=0, dead_time=True)
    wide = replace(fit, form_std_s=0.01)
    grown = wide.coefficient_covariance - fit.coefficient_covariance
    assert grown[-1, -1] == pytest.approx(1e-4)
    assert np.count_nonzero(grown) == 1
    assert wide.coefficient_std[-1] == pytest.approx(math.hypot(fit.scatter[-1], 0.01))


def test_readings_scatter_as_their_intervals_say():
    late = transfer_function([1225.0 * 6 * 0.8], np.poly([-6.0, -12 + 32j, -12 - 32j]), 0.03)
    fits = [fit_form(noisy(late, 0.01, seed), Form(3, 0, dead_time=True)) for seed in range(60)]
    rows = [
        readings(f.model.numerator, f.model.denominator, f.model.dead_time_s, f.coefficient_covariance) for f in fits
    ]
    assert [one.name for one in rows[0]] == ["gain", "dead time", "time constant", "frequency", "damping"]
    spread = np.std([[one.value for one in row] for row in rows], axis=0)
    assert spread == pytest.approx([one.std for one in rows[0]], rel=0.35)
    zero = readings(np.array([2.0, 20.0]), np.array([1.0, 4.0, 30.0]), 0.0, np.zeros((0, 0)), "mm")
    assert zero[0] == ("gain", 20.0 / 30.0, None, "mm") and zero[-1] == ("zero", -10.0, None, "rad/s")
    assert readings(np.array([1.0]), np.array([1.0, 5.0, 0.0]), 0.0, np.zeros((0, 0))) == []


def test_a_double_pole_has_time_constants_that_are_not_identifiable():
    found = readings(np.array([4.0]), np.array([1.0, 4.0, 4.0]), 0.0, np.eye(3))
    assert [one.value for one in found[1:]] == pytest.approx([0.5, 0.5], rel=1e-6)
    assert [one.std for one in found[1:]] == [math.inf, math.inf]
