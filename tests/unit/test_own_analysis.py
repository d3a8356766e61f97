"""`hil analyse sines`, `flow` and `classes`: recordings that no procedure wrote, against what made them."""

import json
from itertools import pairwise

import numpy as np
import pytest

import hil
from hil.errors import InputError, SettingError
from hil.identification.frequency.sine_segments import found_segments
from hil.identification.preparation.clipped import clipped_note, clipped_samples
from hil.record.recording import recording
from hil.session.flow_analysis import Figure
from hil.session.known_signal import command_for
from hil.signals.interval import exact_limits

RATE_HZ, LAG_S = 200.0, 0.08
FREQUENCIES_HZ = (0.5, 1.0, 2.0, 4.0)


def made(name, command, answer, noise=0.02, command_noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    columns = {
        "valve [%]": command + command_noise * rng.standard_normal(len(command)),
        "flow [l/min]": answer + noise * rng.standard_normal(len(answer)),
    }
    return recording(name, np.arange(len(command)) / RATE_HZ, columns)


def lagged(command, gain):
    from scipy.signal import lfilter

    decay = np.exp(-1.0 / RATE_HZ / LAG_S)
    return gain * lfilter([0.0, 1.0 - decay], [1.0, -decay], command, zi=[decay * command[0] + (1 - decay) * 0.0])[0]


def sines(bias, amplitude, frequencies=FREQUENCIES_HZ, **more):
    parts = [np.full(100, bias)]
    for frequency_hz in frequencies:
        k = np.arange(round(max(5.0, 5.0 * frequency_hz) / frequency_hz * RATE_HZ))
        parts.append(bias + amplitude * np.sin(2.0 * np.pi * frequency_hz * k / RATE_HZ))
    command = np.concatenate(parts)
    return made(f"about {bias:g}", command, lagged(command, 0.9), **more)


def true_response(frequency_hz):
    """Of the lag as sampled: what lies between the command of a sample and the reading of that sample."""
    decay, z = np.exp(-1.0 / RATE_HZ / LAG_S), np.exp(2j * np.pi * np.asarray(frequency_hz) / RATE_HZ)
    return 0.9 * (1.0 - decay) / (z - decay)


@pytest.mark.parametrize("command_noise", [0.0, 0.05])
def test_sines_of_two_files_are_one_response_for_each_level(command_noise):
    recordings = [
        sines(40.0, 5.0, FREQUENCIES_HZ[:2], command_noise=command_noise, seed=1),
        sines(40.0, 5.0, FREQUENCIES_HZ[2:], command_noise=command_noise, seed=2),
        sines(-30.0, 10.0, command_noise=command_noise, seed=3),
    ]
    found = hil.frequency_response(recordings, input="valve", output="flow")
    levels = [(one.bias, one.amplitude) for one in found.responses]
    assert levels == [pytest.approx((40.0, 5.0), rel=1e-3), pytest.approx((-30.0, 10.0), rel=1e-3)]
    assert len(found.tables) == 2
    orders = [(len(fit.model.poles), len(fit.model.zeros)) for fit in found.fits]
    assert orders[0] == orders[1] and all(fit.fit_percent > 95.0 for fit in found.fits)
    assert [fit.model.dc_gain for fit in found.fits] == pytest.approx([0.9, 0.9], abs=0.05)
    for one in found.responses:
        np.testing.assert_allclose(one.frequency_hz, FREQUENCIES_HZ, rtol=1e-3)
        truth = true_response(one.frequency_hz)
        away = np.abs(np.abs(one.response) - np.abs(truth)) / one.gain_std
        turned = np.abs(np.degrees(np.angle(one.response / truth))) / one.phase_std_deg
        assert max(away.max(), turned.max()) < 4.0
        assert np.all(one.gain_std < 0.01)
    model = hil.identify(found.tables[1], "transfer-function", poles=1, zeros=0).model
    assert (model.input, model.output) == ("valve [%]", "flow [l/min]")
    assert model.values["lag_time"] == pytest.approx(LAG_S, abs=4.0 * model.parameters["lag_time"].std)


def sweep(cycle_s, width=2.0):
    """A backlash, a lag and a dead band of 20 behind a triangle that begins and ends at neutral."""
    quarter = np.linspace(0.0, 100.0, round(cycle_s * RATE_HZ / 4.0), endpoint=False)
    up, wait = np.concatenate((quarter, 100.0 - quarter)), np.zeros(100)
    command = np.concatenate((wait, up, -up, wait))
    played, at = np.empty(len(command)), 0.0
    for i, value in enumerate(command.tolist()):
        at = min(max(at, value - width / 2.0), value + width / 2.0)
        played[i] = at
    spool = lagged(played, 1.0)
    return made(f"{cycle_s:g} s", command, 0.875 * np.sign(spool) * np.maximum(np.abs(spool) - 20.0, 0.0), 0.1)


@pytest.fixture(scope="module")
def curve():
    return hil.flow_curve([sweep(10.0), sweep(20.0)], input="valve", output="flow", degree=11)


def test_a_flow_curve_tells_hysteresis_from_lag(curve):
    figures = {one.name: one for one in curve.figures}
    truth = {"hysteresis": 1.0, "lag": 1e3 * LAG_S, "dead_band_positive": 20.0, "dead_band_negative": -20.0,
             "gain_positive": 0.875, "gain_negative": 0.875, "leakage": 0.0,
             "response_high": 0.875 * 79.0, "response_low": -0.875 * 79.0}  # fmt: skip
    for name, value in truth.items():
        assert figures[name].value == pytest.approx(value, abs=4.0 * figures[name].std), name
    assert figures["hysteresis"].std < 0.15
    assert figures["response_high"].value == pytest.approx(0.875 * 79.0, abs=0.4)  # not 70: the loop closes there
    assert curve.polynomial_text.count("u^") == 12
    terms = [term.split("·u^") for term in curve.polynomial_text.split()]
    printed = sum(float(factor) * curve.command ** int(power) for factor, power in terms)
    assert np.abs(printed - curve.polynomial).max() < 1e-6 * np.abs(curve.rising).max()
    assert np.all(np.diff(curve.spline) >= 0.0)


def test_a_sweep_of_one_speed_does_not_call_lag_hysteresis():
    found = hil.flow_curve(sweep(10.0), input="valve", output="flow")
    assert "hysteresis" not in {one.name for one in found.figures}
    assert any("of one speed" in note for note in found.notes)
    high = found.figures[0]
    closed, stands = 0.875 * (79.0 - 40.0 * LAG_S), 0.875 * 80.0  # all hysteresis; all lag, at 40 %/s
    assert max(abs(high.value - closed), abs(high.value - stands)) < 2.5 * high.std


def test_half_a_sweep_says_which_half_is_missing():
    whole = sweep(10.0)
    quarter = round(10.0 * RATE_HZ / 4.0)
    up = whole.rows(100, quarter)
    with pytest.raises(InputError, match="only rises; the falling sweep over the same range is missing"):
        hil.flow_curve(up, input="valve", output="flow")
    with pytest.raises(InputError, match="only falls; the rising sweep over the same range is missing"):
        hil.flow_curve(whole.rows(100 + quarter, quarter), input="valve", output="flow")
    one_side = hil.flow_curve(whole.rows(100, 2 * quarter), input="valve", output="flow")
    assert any("stays on one side of 0 %" in note for note in one_side.notes)
    assert one_side.as_text().startswith("flow [l/min] over valve [%], 0 … ")


def ramps(*levels, per_s=50.0, wait_s=0.0):
    """A command along straight lines from level to level, each at a speed, and what a lag answers."""
    wait = np.zeros(round(wait_s * RATE_HZ))
    parts = [wait + levels[0]]
    for begin, end in pairwise(levels):
        parts += [np.linspace(begin, end, round(abs(end - begin) / per_s * RATE_HZ), endpoint=False), wait + end]
    command = np.concatenate(parts)
    return made("ramps", command, lagged(command, 0.5))


def test_what_is_no_part_of_a_sweep_is_said():
    def notes(one):
        return hil.flow_curve(one, input="valve", output="flow").notes

    assert len(notes(ramps(0.0, 100.0, -100.0, 0.0))) == 1  # of one speed
    assert "from -99.8 to 0 % the command only falls" in notes(ramps(0.0, 100.0, -100.0))[0]
    there, back = ramps(0.0, 60.0, -60.0, 0.0), ramps(0.0, 90.0, per_s=400.0)
    jumped = made("jumped", *(np.concatenate((there.values(n), back.values(n))) for n in ("valve", "flow")))
    assert "goes from -60 to 88 %" in notes(jumped)[0] and "even ramps up and down from -60 to 60 %" in notes(jumped)[0]
    clipped = made("clipped", there.values("valve"), np.minimum(there.values("flow"), 20.0), noise=0.0)
    assert any("is clipped at 20 " in note for note in notes(clipped))
    two = [there, ramps(0.0, 60.0, per_s=20.0)]
    assert any("at 20 %/s the command goes one way only" in note for note in notes(two))


@pytest.mark.parametrize(
    ("recordings", "said"),
    [
        ([ramps(0.0, 90.0), ramps(90.0, 0.0, per_s=20.0)], "rises at 50 and falls at 20 %/s"),
        ([ramps(0.0, 45.0, 90.0, 45.0, 0.0, -90.0, 0.0, wait_s=1.0).rows(800, 2200)], "no falling ramp beside"),
    ],
)
def test_ramps_that_make_no_sweep_are_refused_for_what_they_are(recordings, said):
    with pytest.raises(InputError, match=said):
        hil.flow_curve(recordings, input="valve", output="flow")


def test_a_chirp_is_no_sine_and_what_lies_beside_sines_is_said():
    time_s = np.arange(round(10.0 * RATE_HZ)) / RATE_HZ
    chirp = 20.0 * np.sin(2.0 * np.pi * (0.2 * time_s + 0.3 * time_s**2))
    tone = sines(0.0, 20.0, (2.0,)).values("valve")
    both = made("both", np.concatenate((tone, chirp)), lagged(np.concatenate((tone, chirp)), 1.0))
    found = hil.frequency_response(both, input="valve", output="flow")
    assert found.responses[0].frequency_hz == pytest.approx([2.0], rel=1e-3)
    assert any(note.startswith("both: between ") and "(a chirp, " in note for note in found.notes)
    assert len(hil.frequency_response(sines(0.0, 20.0), input="valve", output="flow").notes) == 1


def test_flow_at_the_prompt_makes_a_curve_that_compose_takes(curve, tmp_path, monkeypatch, prints):
    monkeypatch.chdir(tmp_path)
    hil.write(sweep(10.0), "sweep.csv")
    hil.save_model(hil.identify(hil.frequency_response(sines(40.0, 5.0)).tables[0], "transfer-function", poles=1,
                                zeros=0).model, "lag.json")  # fmt: skip
    found = prints("analyse", "flow", "sweep.csv", "--out", "curve.csv", "--json")
    assert json.loads(found)["schema"] == "hil.flow-curve/1"
    composed = prints("analyse", "compose", "curve.csv", "lag.json", "--out", "both.json")
    assert "valve [%] → flow [l/min]" in composed
    text = (tmp_path / "curve.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "timed.csv").write_text(
        "\n".join([f"time [s],{text[0]}", *(f"{i},{line}" for i, line in enumerate(text[1:]))]), encoding="utf-8"
    )
    assert hil.compose("timed.csv", "lag.json").values == hil.compose("curve.csv", "lag.json").values


def test_sines_at_the_prompt_leave_a_table_for_each_level(tmp_path, monkeypatch, prints):
    monkeypatch.chdir(tmp_path)
    hil.write(sines(40.0, 5.0), "a.csv")
    hil.write(sines(-30.0, 10.0), "b.csv")
    out = prints("analyse", "sines", "a.csv", "b.csv", "--out", "own.csv")
    assert "next: hil identify own_+40_5.csv --plant transfer-function" in out
    assert len(hil.read("own_-30_10.csv")) == len(FREQUENCIES_HZ)
    assert out.count(" / (s + ") == 2  # a transfer function of each, of one structure


@pytest.mark.parametrize(("kind", "word"), [("sines", "no sine in channel"), ("flow", "no sweep in channel")])
def test_a_recording_without_them_is_refused_in_one_line(kind, word, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    steps = np.repeat([0.0, 50.0, -20.0, 30.0], 200)
    hil.write(made("steps", steps, lagged(steps, 1.0)), "steps.csv")
    assert word in refused("analyse", kind, "steps.csv")


def test_a_sine_that_a_coarse_converter_rounds_is_one_and_a_clipped_one_is_not():
    sine = sines(0.0, 5.0, (0.5,), noise=0.0)
    time_s, values = sine.time_s, sine.values("valve")
    rounded = np.round(values / 0.05) * 0.05
    assert len(found_segments(time_s, rounded)) == 1
    assert not found_segments(time_s, np.clip(values, -4.5, 4.5))


@pytest.mark.parametrize("held_s", [0.001, 0.01, 0.02])
@pytest.mark.parametrize("digits", [1, 4, 12])
@pytest.mark.parametrize("frequency_hz", [0.5, 0.73, 3.1])
def test_a_sine_that_a_slower_controller_holds_is_one(held_s, digits, frequency_hz):
    time_s = np.arange(10_000) / 1000.0
    command = np.round(10.0 * np.sin(2.0 * np.pi * frequency_hz * held_s * np.floor(time_s / held_s + 1e-9)), digits)
    (found,) = found_segments(time_s, command)
    assert found.frequency_hz == pytest.approx(frequency_hz, rel=1e-4)
    assert found.amplitude == pytest.approx(10.0 * np.sinc(frequency_hz * held_s), rel=1e-3)
    assert not found_segments(time_s, np.clip(command, -9.0, 9.0))


def test_the_command_that_knows_more_is_named():
    steps = np.repeat([0.0, 50.0, -20.0, 30.0], 200)
    noise = np.random.default_rng(1).standard_normal(800)
    assert "hil analyse step" in command_for(made("", steps, steps), "valve")
    assert "hil analyse flow" in command_for(sweep(10.0), "valve")
    assert "hil analyse sines" in command_for(sines(0.0, 5.0), "valve")
    assert command_for(made("", noise, noise), "valve") is None


def valves(count, lag_s, seed):
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    command = np.where(np.arange(200) < 40, 0.0, 50.0)
    decays = np.exp(-1.0 / (RATE_HZ * lag_s * (1.0 + 0.1 * rng.standard_normal(count))))
    return [
        made(f"{lag_s:g}/{k}", command, lfilter([1.0 - decay], [1.0, -decay], command), 0.2, seed=seed + k)
        for k, decay in enumerate(decays.tolist())
    ]


def test_classes_count_what_they_get_wrong_with_exact_limits():
    good, bad = valves(10, 0.05, 1), valves(5, 0.15, 100)
    found = hil.learn_classes(good, bad, [bad[0]], output="flow")
    assert (found.accepted_bad.count, found.accepted_bad.of) == (0, 5)
    assert found.accepted_bad.limits == pytest.approx((0.0, 1.0 - 0.025**0.2))
    assert found.refused_good.limits == pytest.approx((0.0, 1.0 - 0.025**0.1))
    assert [one.found for one in found.others] == ["bad"]
    alike = hil.learn_classes(good, valves(5, 0.05, 200), output="flow")
    assert alike.accepted_bad.count + alike.refused_good.count >= 4
    with pytest.raises(InputError, match="class 'bad': 4 valves; at least 5 are needed"):
        hil.learn_classes(good, bad[:4], output="flow")
    assert exact_limits(2, 10) == pytest.approx((0.0252, 0.5561), abs=1e-4)  # Clopper, Pearson 1934


def test_the_folder_of_good_valves_may_be_named_second(tmp_path, prints):
    for name, made in (("good", valves(5, 0.05, 1)), ("bad", valves(5, 0.15, 100))):
        (tmp_path / name).mkdir()
        for k, one in enumerate(made):
            hil.write(one, tmp_path / name / f"{k}.csv")
    found = [prints("analyse", "classes", *(tmp_path / n for n in order), "--output", "flow", "--json")
             for order in (("good", "bad"), ("bad", "good"))]  # fmt: skip
    assert found[0] == found[1] and '"good": "good"' in found[0]


def test_classes_of_a_table(tmp_path):
    rng = np.random.default_rng(3)
    rows = [("g", "good", *rng.normal((0.1, 1.0), 0.02)) for _ in range(10)]
    rows += [("b", "bad", *rng.normal((0.3, 1.0), 0.02)) for _ in range(6)]
    path = tmp_path / "valves.csv"
    path.write_text(
        "\n".join(["serial,class,rise [s],leakage [l/min]", *(",".join(map(str, row)) for row in rows)]),
        encoding="utf-8",
    )
    found = hil.learn_classes(path)
    assert (found.good, found.bad) == ("good", "bad")
    assert found.accepted_bad.count == found.refused_good.count == 0


@pytest.mark.parametrize(
    ("settling", "said"),
    [
        (
            lambda k: "nan" if k == 3 else 0.5 + 0.1 * (k % 3),
            "row 5, column 'settling': 'nan' is not a number; mend it",
        ),
        (lambda k: 0.3 + 0.02 * k, "of the good units a feature stays as it is, or follows exactly from others"),
        (lambda k: 0.5 + 0.1 * (k > 9), "of the good units a feature stays as it is, or follows exactly from others"),
    ],
)
def test_a_column_that_tells_no_class_is_named(settling, said, tmp_path):
    rows = "".join(f"{'good' if k < 10 else 'bad'},{0.1 + 0.01 * k:g},{settling(k)}\n" for k in range(16))
    (tmp_path / "valves.csv").write_text(f"class,rise,settling\n{rows}", encoding="utf-8")
    with pytest.raises((InputError, hil.errors.FileError), match=said):
        hil.learn_classes(tmp_path / "valves.csv")


def test_a_clipped_response_is_told_with_its_sines():
    sine = sines(40.0, 20.0, noise=0.01)
    clipped = recording("clipped", sine.time_s, {
        "valve [%]": sine.values("valve"), "flow [l/min]": np.minimum(sine.values("flow"), 45.0),
    })  # fmt: skip
    (note, _) = hil.frequency_response(clipped, input="valve", output="flow").notes
    assert note.startswith("clipped: channel 'flow' is clipped at 45 in ") and note.endswith("it falls short there")
    assert len(hil.frequency_response(sine, input="valve", output="flow").notes) == 1
    slow = np.sin(0.5 * np.pi * np.arange(20000) / 1000.0) + 0.001 * np.random.default_rng(0).standard_normal(20000)
    rounded = 2.4 / 256 * np.round(slow / 2.4 * 256)  # at its highest step for longer than at any other
    assert clipped_samples(rounded)[0] is not None and clipped_note("x", "flow", rounded) == ()


def test_a_step_that_is_held_too_briefly_says_so_and_times_have_intervals():
    command = np.r_[np.zeros(200), np.full(400, 30.0), np.full(60, 60.0)]
    long, brief = hil.step_models(made("steps", command, lagged(command, 2.0)), input="valve", output="flow")
    assert abs(long.rise_s - LAG_S * np.log(9.0)) < 3.0 * long.std_s[0] < 0.1 * long.rise_s
    assert not any("still moves" in note for note in long.notes)
    assert any("still moves by " in note and "hold it longer" in note for note in brief.notes)
    assert long.as_text().startswith("0 → 30: rise 0.17") and " ± 0.00" in long.as_text()


@pytest.mark.parametrize("text", ["nan", "1,inf", "a", "1,,2"])
def test_coefficients_are_numbers(text, refused):
    error = refused("analyse", "loop", "--numerator", text, "--denominator", "1,2")
    assert f"'{text}': coefficients are numbers between commas" in error


def test_a_figure_has_the_digits_that_its_interval_leaves():
    assert str(Figure("response_high", 188.2361, 0.2041, "psi")).split() == [
        "response_high",
        "188.24",
        "±",
        "0.40",
        "psi",
    ]


@pytest.mark.parametrize("band", [0.0, 1.0, -0.02, float("nan")])
def test_a_band_that_is_none_is_told(band):
    with pytest.raises(SettingError, match="% of the change; it must be above 0 and below 100"):
        hil.step_models(rise_s=0.5, settling_s=1.2, band=band)


def test_steps_that_come_at_equal_times_beside_a_sine_are_none():
    """The fit of a frequency runs away on some of them: periodic, but no sine."""
    time_s = np.arange(400) / RATE_HZ
    steps = np.repeat(np.random.default_rng(123).uniform(-80.0, 80.0, 30), 25)
    command = np.concatenate((30.0 * np.sin(2.0 * np.pi * 2.0 * time_s), steps))
    (found,) = hil.frequency_response(
        made("both", command, 0.5 * command, 0.01), input="valve", output="flow"
    ).responses
    assert found.frequency_hz == pytest.approx([2.0], rel=1e-3)
