"""A meter that stands at zero to the last bit: no figure is made of it, and no evaluation breaks."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hil
from hil.errors import InputError
from hil.session.procedure import load_procedure

CASES: list[tuple[str, str, dict[str, Any]]] = [
    ("flow_over_pressure_drop", "four-way-lab", {"supplies": (50, 100, 150), "hold_s": 1, "rate_hz": 200}),
    ("threshold", "brevini-hpv41", {"speed": 1, "reach": 2, "biases": (60,), "rate_hz": 200}),
    ("frequency_response", "brevini-hpv41", {"frequencies": (1, 2), "amplitudes": (20,), "measure_s": 0.5}),
    ("flow_curve", "brevini-hpv41", {"cycle_s": 12}),
]


@pytest.mark.parametrize(("procedure", "bench", "settings"), CASES, ids=[name for name, _, _ in CASES])
def test_a_dead_meter_gives_no_figure(procedure, bench, settings, tmp_path):
    hil.run(procedure, bench, tmp_path / "run", settings=settings)
    run = hil.read(tmp_path / "run")
    flow = replace(run.channels["flow"], values=np.zeros(len(run.time_s)))
    try:
        found = load_procedure(procedure).evaluate(replace(run, channels={**run.channels, "flow": flow}))
    except InputError:
        return
    for one in found.measured:
        assert one.value is None or (math.isfinite(one.value) and math.isfinite(one.std or 0.0)), one.name
