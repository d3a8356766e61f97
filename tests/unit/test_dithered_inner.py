"""A diagnosis does not take the ripple of a dither, whose phase no recording holds, for a misfit of inner signals."""

from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.intake.problem import pose
from hil.identification.grey_box.identify import starting_model
from hil.identification.preparation.experiment import experiment
from hil.physics.simulate import Drive, simulate
from hil.record.recording import recording

NOISE_V = 0.02


def test_the_ripple_of_a_dither_counts_as_noise_of_the_coils_voltage():
    model = starting_model("efc-drive")
    time_s, command = np.arange(1200) * 1e-3, np.repeat([1.3, 1.6, 1.4], 400)
    fine_s = np.arange(24_000) * 5e-5
    wave = np.repeat(command, 20) + 0.02 * np.sin(2.0 * np.pi * 125.0 * fine_s + 0.7)
    rows = simulate(model.definition, model.values, Drive(wave[None], 0.0, 5e-5))[:, ::20]
    stds = np.array([[0.5], [0.002], [NOISE_V], [0.1], [0.5], [0.5]])
    rows += stds * np.random.default_rng(1).standard_normal(rows.shape)
    names = [f"{s.name} [{s.unit}]" for s in (model.definition.output, *model.definition.observed)]
    made = recording("r", time_s, {"current [A]": command} | dict(zip(names, rows, strict=True)))
    how = {"low": 0.0, "high": 3.0, "dither_amplitude": 0.02, "dither_hz": 125.0}
    dithered = experiment(replace(made, meta={"driven": {"current": how}}), model.definition)
    (noise,) = pose(model, [dithered]).observed_noise
    (plain,) = pose(model, [experiment(made, model.definition)]).observed_noise
    off = rows[2] - dithered.respond(model.definition, model.values)[2]
    assert noise["coil voltage"] == pytest.approx(float(off.std()), rel=0.3)
    assert noise["coil voltage"] > 2.0 * NOISE_V
    assert noise["coil temperature"] == pytest.approx(plain["coil temperature"], rel=0.01)
