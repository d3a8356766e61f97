"""A steady curve that was measured, as the data of a plant: nodes with straight lines between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import FunctionType
from typing import Any, cast

import numpy as np

from hil.physics.effect import compiled
from hil.physics.plant import Parameter
from hil.record.recording import Array

NODES = 24
MEASURED = {"cummins-efc": "efc-measured", "brevini-hpv41": "hpv41-measured"}
"""Plants of valves, and those of the same valves with a measured curve."""

_LEAST = 1e-6  # between two levels of the table; nearer ones are one jump


@compiled
def tabulated(value: float, at: Array, bend: Array) -> float:
    """The curve above its first node, whose slope changes at the nodes; beyond the first and the last it stays."""
    found = 0.0
    for node in range(24):
        found += bend[node] * max(value - at[node], 0.0)
    return found


def curve_parameters(at: Array, flow: Array, unit_in: str, unit_out: str) -> tuple[Parameter, ...]:
    """Commands and outputs at the nodes, held in every fit.

    Args:
        at: where the nodes lie typically, shape (24,).
        flow: the output there, likewise.
        unit_in: of the command.
        unit_out: of the output.
    """
    made = [
        Parameter(
            f"{what}_{k}", unit, float(value), -1e12, 1e12, f"{meaning} node {k} of the curve", fixed=True, size=2e5
        )
        for what, unit, values, meaning in (
            ("command", unit_in, at, "command at"), ("flow", unit_out, flow, "output at")
        )
        for k, value in enumerate(values.tolist(), 1)
    ]  # fmt: skip
    return tuple(made)


def nodes(p: Mapping[str, float]) -> tuple[Array, Array]:
    """(commands, outputs) of the curve, shape (24,) each; commands never fall."""
    at = np.maximum.accumulate([p[f"command_{k}"] for k in range(1, NODES + 1)])
    return at, np.array([p[f"flow_{k}"] for k in range(1, NODES + 1)])


def bends(at: Array, flow: Array) -> Array:
    """By how much the slope changes at each node, shape (24,)."""
    slopes = np.concatenate(([0.0], np.diff(flow) / np.maximum(np.diff(at), _LEAST), [0.0]))
    return np.diff(slopes)


def page_with(page: Callable[..., Any], names: dict[str, Any]) -> Callable[..., Any]:
    """The same page of equations with the functions of another module, `names` its globals."""
    made = FunctionType(cast("FunctionType", page).__code__, names, page.__name__)
    made.__doc__ = page.__doc__
    return made
