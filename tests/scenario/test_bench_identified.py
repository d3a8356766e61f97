"""The loop: a simulated bench is driven, recorded, and its parameters are found again in the recording."""

import numpy as np

from hil.identification.grey_box.identify import fit_plant, starting_model
from hil.identification.preparation.experiment import experiment
from hil.record.read import read_recording
from tests.bench_files import bench_file
from tests.driven import silent_rig

TRUTH = {"dead_time": 0.03, "pilot_rate": 9.0, "dead_band": 17.0, "full_flow": 64.0}


def test_parameters_of_the_simulated_valve_are_found_again(tmp_path):
    path = bench_file(tmp_path / "bench.toml", "brevini-hpv41", simulation={"parameters": TRUTH})
    with silent_rig(path, tmp_path / "run") as rig:
        for level in (40.0, 70.0, 30.0, -50.0, -80.0, -40.0, 60.0, 100.0, 55.0):
            rig.play(np.full(round(rig.rate_hz), level), part={"kind": "level", "level": level})
    start = starting_model("brevini-hpv41", ())
    model = fit_plant(start, [experiment(read_recording(tmp_path / "run"), start.definition)], ()).model
    for name, true in TRUTH.items():
        found = model.parameters[name]
        assert found.std is not None and found.std < 0.05 * true, name
        assert abs(found.value - true) < 4.0 * found.std, name
