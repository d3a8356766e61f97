"""Cummins EFC with its measured curve: coil, rotor and hooks of `cummins-efc`, the orifice from a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hil.physics.linear import delayed  # noqa: F401  (the page calls it)
from hil.physics.measured_curve import NODES, bends, curve_parameters, nodes, page_with
from hil.physics.measured_curve import tabulated as throttled  # noqa: F401  (the page calls it so)
from hil.physics.plant import Parameter
from hil.physics.plants import cummins_efc
from hil.physics.stop import speed_after  # noqa: F401  (the page calls it)
from hil.record.recording import Array

OF = cummins_efc.PLANT
_LAW = ("curve_centre", "curve_width", "pressure_span", "closed_pressure")


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float | Array]:
    """Coefficients of one sub-step; the share of the span that the orifice lets through is the curve's."""
    at, pressure = nodes(p)
    span = float(np.ptp(pressure)) or 1.0
    made = cummins_efc.coefficients({**OF.typical, **p}, step_s)
    curve: dict[str, float | Array] = {
        "centre": at,
        "width": bends(at, pressure / span),
        "span": span,
        "closed_pressure": float(pressure[0]),
    }
    return {**made, **curve}


def _typical() -> tuple[Parameter, ...]:
    at = np.concatenate(([0.0], np.linspace(0.8, 2.2, NODES - 2), [4.0]))
    p = OF.typical
    share = 1.0 / (1.0 + np.exp(-(at - p["curve_centre"]) / p["curve_width"]))
    return curve_parameters(at, p["closed_pressure"] + p["pressure_span"] * share, "A", "psi")


PLANT = replace(
    OF,
    name="efc-measured",
    title="Cummins EFC fuel-control valve with a measured curve",
    parameters=(*(one for one in OF.parameters if one.name not in _LAW), *_typical()),
    equations=page_with(OF.equations, globals()),
    coefficients=coefficients,
)
