"""A measured flow curve and a transfer function as one model: figure 17 of the HPV41 paper.

The order of its blocks is not stated there; here the dynamics stand before the curve, as spool and orifice do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.errors import InputError, option
from hil.identification.steady.flow_curve import monotone
from hil.physics.compose import plant
from hil.physics.measured_curve import MEASURED, NODES
from hil.physics.model import Model, Value
from hil.physics.plants.curve_and_response import PLANT
from hil.physics.transfer_function import TransferFunction
from hil.record.recording import Array
from hil.units import convert

_EXACT = 1e-4  # of the curve's span: a table that comes so near the spline needs no more nodes
_FINE = 2000
_NO_PAIR_S = 1e-5  # a pair of poles far above everything


def curve_model(
    command: Array, flow: Array, linear: TransferFunction, input_heading: str, output_heading: str
) -> Model:
    """The model: its curve is the monotone spline through the points, as a table; its gain is the curve's alone.

    Args:
        command: levels, rising, shape (n,).
        flow: steady output at each, rising or falling, shape (n,).
        linear: dynamics, whose gain at rest is left out.
        input_heading: `name [unit]` of the command.
        output_heading: of the output.

    Raises:
        InputError: fewer than two levels, levels that do not rise, or dynamics that the plant does not have.
    """
    values = PLANT.typical | _nodes(command, flow) | _dynamics(linear)
    units = PLANT.units(input_heading, output_heading)
    return Model(
        PLANT.name, {name: Value(value, units[name]) for name, value in values.items()},
        input=input_heading, output=output_heading,
    )  # fmt: skip


def with_measured_curve(command: Array, flow: Array, model: Model, input_unit: str, output_unit: str) -> Model:
    """A physical model whose orifice is a measured curve; its dynamics, effects and channels stay.

    Args:
        command: levels, rising, shape (n,).
        flow: steady output at each, likewise.
        model: of a plant that has a measured twin (`MEASURED`), or of that twin.
        input_unit: of the levels; converted to the plant's.
        output_unit: of the outputs, likewise.

    Raises:
        InputError: another plant, or fewer than two levels. UnitError: a unit of something else.
    """
    name = MEASURED.get(model.plant, model.plant)
    if name not in MEASURED.values():
        known = ", ".join(MEASURED)
        raise InputError(f"{model.plant}: no measured curve can stand in it; a transfer function, or one of {known}")
    definition = plant(name)
    levels = convert(command, input_unit, definition.inputs[0].unit)
    found = _nodes(levels, convert(flow, output_unit, definition.output.unit))
    values = {
        p.name: Value(found[p.name], p.unit)
        if p.name in found
        else model.parameters.get(p.name, Value(p.typical, p.unit))
        for p in definition.parameters
    }
    return replace(model, plant=name, parameters=values, noise=None, covariance=None, skeleton=None, origin={})


def _nodes(command: Array, flow: Array) -> dict[str, float]:
    if len(command) < 2 or np.any(np.diff(command) <= 0.0):
        raise InputError("flow curve: at least two levels of the command are needed, each above the one before")
    at = table_nodes(command, flow)
    levels = at[np.minimum(np.arange(NODES), len(at) - 1)]
    named: dict[str, float] = {}
    for k, (level, value) in enumerate(zip(levels, monotone(command, flow)(levels), strict=True), 1):
        named |= {f"command_{k}": float(level), f"flow_{k}": float(value)}
    return named


def table_nodes(command: Array, flow: Array) -> Array:
    """Where a table of at most 24 nodes follows the spline: each new node where the table is farthest from it."""
    curve = monotone(command, flow)
    fine = np.linspace(command[0], command[-1], _FINE)
    wanted = curve(fine)
    near = _EXACT * float(np.ptp(wanted))
    chosen = [0, _FINE - 1]
    while len(chosen) < NODES:
        away = np.abs(np.interp(fine, fine[chosen], wanted[chosen]) - wanted)
        if away.max() <= near:
            break
        chosen = sorted([*chosen, int(np.argmax(away))])
    return fine[chosen]


def _dynamics(linear: TransferFunction) -> dict[str, float]:
    found = linear.to_parameters()
    if found["pair2_time"] or found["pair1_zero_square"] or len(linear.poles) > 3 or found.get("integrator_gain"):
        raise InputError(
            f"a flow curve with dynamics has up to three poles and one zero, and no integrator; these have "
            f"{len(linear.poles)} poles and {len(linear.zeros)} zeros: ask for fewer with {option('poles')} and "
            f"{option('zeros')}"
        )
    return {
        "dead_time": found["dead_time"], "lag_time": found["lag_time"],
        "pair_time": found["pair1_time"] or _NO_PAIR_S, "pair_damping": found["pair1_damping"],
        "zero": found["pair1_zero"],
    }  # fmt: skip
