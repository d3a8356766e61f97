"""Brevini HPV41 with its measured flow curve: pilot, spool and hooks of `brevini-hpv41`, the edge from a sweep."""

from __future__ import annotations

import inspect
import math  # noqa: F401  (the page calls it)
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hil.physics.effect import compiled
from hil.physics.linear import delayed  # noqa: F401  (the page calls it)
from hil.physics.measured_curve import NODES, bends, curve_parameters, nodes, page_with, tabulated
from hil.physics.plant import Parameter
from hil.physics.plants import brevini_hpv41
from hil.record.recording import Array

OF = brevini_hpv41.PLANT
_LAW = ("dead_band", "full_flow", "curve_exponent")


@compiled
def metered(opening: float, at: Array, full_flow: float, share: Array) -> float:
    """The measured flow at an opening; behind the bends of `share` stands that of the first node."""
    return full_flow * (share[24] + tabulated(opening, at, share))


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float | Array]:
    """Coefficients of one sub-step."""
    at, flow = nodes(p)
    full_flow = float(np.abs(flow).max()) or 1.0
    share = np.append(bends(at, flow / full_flow), flow[0] / full_flow)
    made = brevini_hpv41.coefficients({**OF.typical, **p}, step_s)
    return {**made, "dead_band": at, "full_flow": full_flow, "exponent": share}


def _typical() -> tuple[Parameter, ...]:
    at, p = np.linspace(-100.0, 100.0, NODES), OF.typical
    metered = inspect.unwrap(brevini_hpv41.metered)  # 24 values: to compile it would take longer
    flow = [metered(one, p["dead_band"], p["full_flow"], p["curve_exponent"]) for one in at.tolist()]
    return curve_parameters(at, np.array(flow), "%", "l/min")


PLANT = replace(
    OF,
    name="hpv41-measured",
    title="Brevini HPV41 with MHPED and a measured curve",
    parameters=(*(one for one in OF.parameters if one.name not in _LAW), *_typical()),
    equations=page_with(OF.equations, globals()),
    coefficients=coefficients,
)
