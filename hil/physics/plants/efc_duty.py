"""Cummins EFC driven by the duty of a PWM voltage: the current is what coil and warm copper make of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hil.physics.plant import Signal
from hil.physics.plants import efc_drive


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; 100 % of duty are the supply's volts."""
    made = efc_drive.coefficients({**p, "loop_bandwidth": 1.0}, step_s)
    return made | {"volts_per_unit": p["supply_voltage"] / 100.0}


PLANT = replace(
    efc_drive.PLANT,
    name="efc-duty",
    title="Cummins EFC fuel-control valve driven by a PWM voltage",
    inputs=(Signal("duty", "%", 100.0),),
    parameters=tuple(p for p in efc_drive.PLANT.parameters if p.name != "loop_bandwidth"),
    hooks=tuple(
        replace(hook, unit="%", full_scale=25.0) if hook.name == "command" else hook for hook in efc_drive.PLANT.hooks
    ),
    coefficients=coefficients,
)
