"""What acts is what a converter and a current drive make of a command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.daq.channel import OutputChannel, Pwm
from hil.identification.preparation.driven import FINER, PHASES, as_driven, with_dither
from hil.identification.preparation.experiment import experiment
from hil.physics.compose import plant
from hil.physics.simulate import Drive, simulate
from hil.record.folder import read
from hil.record.recording import Recording, recording
from tests.driven import silent_rig


def recorded(**how: float) -> Recording:
    time_s = np.arange(100) * 0.01
    command = np.linspace(0.0, 1.0, 100)
    made = recording("made", time_s, {"current [A]": command, "pressure [psi]": 100.0 * command})
    return replace(made, meta={"driven": {"current": how}})


def test_a_command_acts_as_the_nearest_level_of_the_converter():
    acted = as_driven(recorded(low=-1.2, high=0.9, step=0.05)).values("current")
    assert acted * 20.0 == pytest.approx(np.rint(acted * 20.0), abs=1e-9)
    assert np.abs(acted - np.linspace(0.0, 1.0, 100))[:90].max() <= 0.025 + 1e-12
    assert acted.max() == pytest.approx(0.9)


@pytest.mark.parametrize("high", [1.0, 0.0], ids=["as recorded now", "as versions before recorded it"])
def test_a_digital_line_acts_at_both_its_ends(high):
    line = OutputChannel("load orifice", "do0", "digital", "A", 0.0, 1.0, step=1.0)
    assert line.driven["high"] == 1.0
    acted = as_driven(recorded(**{**line.driven, "high": high})).values("current")
    assert (acted[0], acted[-1]) == (0.0, 1.0)


def test_a_current_drive_that_cannot_pull_adds_the_mean_of_what_its_dither_lacks():
    acted = as_driven(recorded(low=0.0, high=3.0, dither_amplitude=0.2)).values("current")
    turns = np.linspace(0.0, 2.0 * np.pi, 20_000, endpoint=False)
    for told, mean in zip(np.linspace(0.0, 1.0, 100)[::7], acted[::7], strict=True):
        assert mean == pytest.approx(np.mean(np.clip(told + 0.2 * np.sin(turns), 0.0, 3.0)), abs=1e-6)


def dithered(hz: float) -> Recording:
    return recorded(low=0.0, high=3.0, dither_amplitude=0.2, dither_hz=hz)


def test_opposite_phases_of_a_dither_have_the_command_as_their_mean_but_near_the_end_of_the_range():
    made = with_dither(dithered(10.0))
    one, opposite = made[0].values("current"), made[PHASES // 2].values("current")
    told = np.repeat(np.linspace(0.0, 1.0, 100), FINER)
    assert (one + opposite)[told > 0.2] == pytest.approx(2.0 * told[told > 0.2])
    assert one.min() == 0.0 and (one + opposite - 2.0 * told)[told < 0.1].mean() > 0.05


def test_samples_too_far_apart_carry_no_dither():
    assert with_dither(dithered(25.0)) and not with_dither(dithered(26.0))
    assert not with_dither(recorded(low=0.0, high=3.0, dither_amplitude=0.2))


def test_a_coil_that_cannot_be_driven_below_0_v_keeps_more_current_than_the_mean_of_its_dither():
    drive, time_s = plant("efc-drive"), np.arange(2000) * 1e-3
    command = np.where(time_s < 1.5, 0.0, 1.5)
    made = recording("made", time_s, {"current [A]": command, "pressure [psi]": command})
    how = {"low": 0.0, "high": 3.0, "dither_amplitude": 0.02, "dither_hz": 125.0}
    told = experiment(replace(made, meta={"driven": {"current": how}}), drive)
    held = told.respond(drive, drive.typical)[1]
    wave = np.clip(np.repeat(command, 20) + 0.02 * np.sin(2.0 * np.pi * 125.0 * np.arange(40_000) * 5e-5), 0.0, 3.0)
    whole = simulate(drive, drive.typical, Drive(wave[None], 0.0, 5e-5))[1].reshape(-1, 20).mean(axis=1)
    assert whole[500:1500].mean() > 0.012  # of the dither itself 0.0064 A are left
    assert held[500:1500].mean() == pytest.approx(whole[500:1500].mean(), abs=5e-4)


def test_a_coil_has_settled_on_its_dither_before_the_first_sample():
    drive, time_s = plant("efc-drive"), np.arange(400) * 1e-3
    command = np.where(time_s < 0.3, 0.0, 1.5)
    made = recording("made", time_s, {"current [A]": command, "pressure [psi]": command})
    how = {"low": 0.0, "high": 3.0, "dither_amplitude": 0.02, "dither_hz": 125.0}
    current = experiment(replace(made, meta={"driven": {"current": how}}), drive).respond(drive, drive.typical)[1]
    periods = current[:296].reshape(-1, 8).mean(axis=1)
    assert periods.min() > 0.012  # from the mean of the dither on it would rise from 0.0064 A
    assert np.ptp(periods) < 1e-4


def test_the_phase_of_a_dither_that_is_cut_off_does_not_matter_but_for_its_ripples():
    drive, time_s = plant("efc-drive"), np.arange(160) * 1e-3
    command = np.full(160, 0.01)  # half of the dither is above it
    made = recording("made", time_s, {"current [A]": command, "pressure [psi]": command})
    how = {"low": 0.0, "high": 3.0, "dither_amplitude": 0.02, "dither_hz": 125.0}
    told = experiment(replace(made, meta={"driven": {"current": how}}), drive)
    assert told.ripples is not None
    turned = replace(told, ripples=np.roll(told.ripples, 1, axis=0))  # by an eighth
    apart = turned.respond(drive, drive.typical)[2] - told.respond(drive, drive.typical)[2]  # the coil's voltage
    waves = np.array([rows[2] for rows in told.by_dither(drive, drive.typical)])
    left = apart - np.linalg.lstsq(waves.T, apart, rcond=None)[0] @ waves
    first = waves[:2]  # its fundamental alone does not explain it
    by_first = apart - np.linalg.lstsq(first.T, apart, rcond=None)[0] @ first
    assert np.linalg.norm(left) < 0.1 * np.linalg.norm(by_first)


def test_an_experiment_is_driven_by_what_acted_and_a_plain_file_by_what_it_says():
    efc = plant("cummins-efc")
    told = recorded(low=0.0, high=3.0, step=0.1)
    assert np.unique(np.round(experiment(told, efc).drive.inputs[0], 9)).size == 11
    assert np.array_equal(experiment(replace(told, meta={}), efc).drive.inputs[0], told.values("current"))


def test_an_output_says_how_it_is_driven():
    channel = OutputChannel("current", "pwm0", "pwm_current", "A", 0.0, 3.0, pwm=Pwm(1000.0, 125.0, 0.05), step=0.5)
    assert channel.driven == {
        "low": 0.0, "high": 2.5, "step": 0.5, "dither_amplitude": 0.05, "dither_hz": 125.0
    }  # fmt: skip


def test_the_header_of_a_run_knows_how_its_outputs_are_driven(tmp_path):
    with silent_rig("hydraforce-open-loop", tmp_path / "run") as rig:
        rig.hold(0.1)
    header = read(tmp_path / "run").meta["driven"]["current"]
    assert header["step"] == pytest.approx(0.12 * 20.0 / 2**16)
    assert (header["low"], header["high"]) == pytest.approx((-1.2, 1.2 - header["step"]))
