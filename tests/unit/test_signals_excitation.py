import numpy as np
import pytest

from hil.errors import SettingError
from hil.signals.multisine import odd_multisine
from hil.signals.ramps import ramp, triangle
from hil.signals.sine_fit import sine_fit
from hil.signals.steady import is_steady
from hil.signals.stepped_sine import check_frequencies, reference_and_band, sine
from hil.signals.steps import CUSTOMARY_STEPS, step_sequence
from tests.binary_sequence import binary_sequence


def test_sine_has_whole_periods_bias_and_phase():
    wave = sine(0.5, 3.0, 100.0, 4, bias=50.0, phase_rad=np.pi / 2)
    assert len(wave) == 800
    assert wave[0] == pytest.approx(53.0)
    assert wave.mean() == pytest.approx(50.0)


def test_multisine_excites_only_its_lines_and_peaks_where_told():
    made = odd_multisine(0.1, 4.9, 0.1, 1000.0, 20.0, seed=3)
    lines = np.abs(np.fft.rfft(made.period)) / len(made.period) * 2
    others = np.setdiff1d(np.arange(len(lines)), made.excited)
    assert np.max(lines[others]) < 1e-12
    assert np.ptp(lines[made.excited]) < 1e-12
    assert np.max(np.abs(made.period)) == pytest.approx(20.0)
    assert set(made.odd_detection).isdisjoint(made.excited)
    assert all(line % 2 for line in made.odd_detection) and not any(line % 2 for line in made.even_detection)
    assert made.excited[0] == 1 and made.excited[-1] == 49


def test_multisine_crest_is_optimised_and_seeded():
    raw = odd_multisine(0.1, 4.9, 0.05, 1000.0, 1.0, crest_iterations=0)
    good = odd_multisine(0.1, 4.9, 0.05, 1000.0, 1.0)
    assert good.crest_factor < 1.7 < 2.5 < raw.crest_factor
    assert np.array_equal(good.period, odd_multisine(0.1, 4.9, 0.05, 1000.0, 1.0).period)
    assert not np.array_equal(good.period, odd_multisine(0.1, 4.9, 0.05, 1000.0, 1.0, seed=1).period)


def test_multisine_repeats_about_a_bias_and_says_what_it_is():
    made = odd_multisine(0.5, 4.5, 0.5, 100.0, 5.0)
    wave = made.signal(3, bias=50.0)
    assert len(wave) == 600
    assert np.array_equal(wave[:200], wave[400:])
    assert made.as_part()["excited"] == made.excited.tolist()


def test_multisine_without_detection_lines_excites_every_odd_line():
    assert odd_multisine(1.0, 9.0, 1.0, 200.0, 1.0, group=0).excited.tolist() == [1, 3, 5, 7, 9]


def test_multisine_without_a_line_is_refused():
    with pytest.raises(SettingError, match="no odd multiple"):
        odd_multisine(2.0, 2.0, 1.0, 1000.0, 1.0)


def test_ramps_and_triangles():
    assert ramp(0.0, 10.0, 1.0, 10.0).tolist() == list(range(11))
    wave = triangle(-100.0, 100.0, 8.0, 50.0, cycles=2)
    assert len(wave) == 801
    assert (wave.min(), wave.max(), wave[0], wave[-1]) == (-100.0, 100.0, 0.0, 0.0)
    assert np.allclose(np.abs(np.diff(wave)), 1.0)  # 400 % of travel in 400 samples, one rate
    with pytest.raises(SettingError, match="must lie between"):
        triangle(10.0, 20.0, 1.0, 100.0)
    with pytest.raises(SettingError, match="4 are needed"):
        triangle(-1.0, 1.0, 0.01, 100.0)
    with pytest.raises(SettingError, match="no sample"):
        ramp(0.0, 1.0, 0.001, 10.0)


def test_steps_and_binary_sequences():
    assert step_sequence(CUSTOMARY_STEPS["paper"], 0.02, 100.0).tolist() == [0, 0, 80, 80, 0, 0]
    wave = binary_sequence(-1.0, 1.0, 0.01, 1000.0, bits=7)
    assert len(wave) == 1270
    assert wave.sum() == 10.0  # one clock more high than low
    spectrum = np.abs(np.fft.rfft(wave[::10]))[1:]
    assert np.ptp(spectrum) < 1e-9 * spectrum.max()  # flat: maximum length
    with pytest.raises(SettingError, match="0 levels"):
        step_sequence((), 1.0, 10.0)


def _periods(transient, noise=0.0, count=6, seed=0):
    """Fits of successive one-second periods of a sine whose start fades by exp(−1) a period."""
    rng = np.random.default_rng(seed)
    t = np.arange(count * 200) / 200.0
    y = 10 * np.sin(2 * np.pi * t) + transient * np.exp(-t) + noise * rng.normal(size=len(t))
    return [sine_fit(t[i : i + 200], y[i : i + 200], 1.0, harmonics=2) for i in range(0, len(t), 200)]


def test_a_fading_transient_is_not_steady_until_it_has_faded():
    fits = _periods(transient=1.0)
    verdicts = [is_steady(fits[: n + 1]) for n in range(len(fits))]
    assert verdicts == [False, False, False, True, True, True]
    # what is called still to come is what comes
    left = max(abs(fits[2].phasor - 10), abs(fits[2].offset)) / 10
    assert not is_steady(fits[:3], 0.7 * left) and is_steady(fits[:3], 1.3 * left)


def test_what_noise_hides_is_called_steady():
    verdicts = [is_steady(_periods(transient=0.0, noise=3.0, seed=s)[:2]) for s in range(50)]
    assert sum(verdicts) >= 47
    assert not is_steady(_periods(transient=30.0, noise=3.0)[:2])


def test_a_reference_and_a_band_of_few_sines_end_at_the_top_frequency():
    assert reference_and_band(4.9) == (0.1, 0.728, 1.07, 1.56, 2.29, 3.35, 4.9)
    assert reference_and_band(0.5)[0] == pytest.approx(0.0743 / 2.0)
    assert reference_and_band(50.0)[:2] == (1.02, 7.43)
    check_frequencies(reference_and_band(10.0), 200.0)
