"""How long a plant takes to follow its command."""

from dataclasses import replace

import numpy as np

from hil.identification.preparation.experiment import for_model
from hil.identification.preparation.time_constant import time_constant_s
from hil.physics.model import typical_model
from hil.record.recording import recording


def test_what_moves_by_itself_within_the_dead_band_does_not_follow_the_command():
    """A leaking seal lets the piston of a closed valve creep for a minute; that of an open one moves at once."""
    plant = typical_model("hydraforce-open-loop")
    leaks = {**plant.parameters, "piston_leakage": replace(plant.parameters["piston_leakage"], value=70.0)}
    time_s = np.arange(0.0, 20.0, 0.002)
    made = recording("open", time_s, {"current [A]": np.sign(np.sin(time_s)), "position [mm]": np.sin(time_s)})
    assert 1.0 < time_constant_s(replace(plant, parameters=leaks), for_model(plant, made)) < 3.0
