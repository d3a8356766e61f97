"""sample valve: command in, pressure out; `hil list plants` prints this line."""

from collections.abc import Mapping
from typing import Any

from hil.physics.linear import delay_steps, delayed, held_first_order
from hil.physics.plant import Hook, Parameter, Plant, Signal


def equations(command: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step: command, poppet, pressure."""
    command = hook.command(command)
    drive = delayed(x.line, command, c.dead_steps)
    x.poppet = c.keep * x.poppet + (1.0 - c.keep) * drive
    poppet = hook.position(x.poppet)
    pressure = c.gain * poppet
    pressure = hook.flow(pressure, 0.01 * poppet)
    reading = hook.sensor(pressure)
    return reading, poppet


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float]:
    """Coefficients of one sub-step; a step of infinity is the steady state."""
    return {
        "dead_steps": delay_steps(p["dead_time"], step_s),
        "keep": held_first_order(p["poppet_lag"], step_s),
        "gain": p["gain"],
    }


PLANT = Plant(
    name="sample-valve",
    title="sample valve",
    inputs=(Signal("command", "%", 100.0),),
    output=Signal("pressure", "bar", 200.0),
    observed=(Signal("poppet position", "%", 100.0),),
    parameters=(
        Parameter("dead_time", "s", 0.003, 0.0, 0.1, "amplifier and transport", growth="dead_time", hook="command"),
        Parameter("poppet_lag", "s", 0.02, 0.001, 0.5, "time constant of the poppet", hook="position"),
        Parameter("gain", "bar/%", 1.9, 0.1, 5.0, "pressure per command", hook="flow"),
    ),
    hooks=(
        Hook("command", "command", "%", 100.0),
        Hook("position", "poppet", "%", 100.0),
        Hook("flow", "load", "bar", 200.0, extra="opening"),
        Hook("sensor", "sensor", "bar", 200.0),
    ),
    states={"poppet": 1},
    lines_s={"line": 0.1},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=0.001,
    source="say where the equations are from",
)
