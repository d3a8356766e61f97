"""Linear transfer function of up to five poles and four zeros with dead time; orders are chosen by evidence.

An integrator may stand behind it: then the output goes on while the input stands. A static curve may stand before it,
bent by a term of second order: orifices and amplifiers have one; saturation and dead band bend alike to both sides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hil.errors import InputError
from hil.physics.linear import delay_steps, delayed
from hil.physics.plant import Hook, Parameter, Plant, Signal, Structure
from hil.record.recording import Array

_INSTANT_S = 1e-9

_ORDER = 5
_FAR, _LONG_S = 1e12, 1e6  # pressures in Pa and furnaces lie within
_SIZE, _TIME_S, _ZERO_S, _SQUARE_S2 = 2e5, 1e3, 2e3, 2e7  # of what is typically 0


def equations(value: Any, x: Any, c: Any, hook: Any) -> Any:
    """One sub-step of offset + (gain + integrator gain/s)·e^(−sT)·1/(1 + s·T₁)·Π (1 + s·z + s²·w)/(1 + 2ζ·s·τ + s²·τ²).

    It acts on u + bend·u², or on u + bend·u·|u| where it is odd: the static curve of the input u.

    All poles step together by the exact matrix of a held input; `c.a` is that matrix, row by row. Before the
    first sample the system rests, either at its input or (`c.at_input` = 0) at the first output.
    """
    value = hook.command(value)
    value += c.bend * value * ((1.0 - c.is_odd) * value + c.is_odd * abs(value))
    value = c.at_input * value + (1.0 - c.at_input) * x.before
    value = delayed(x.line, value, c.dead_steps)
    grown = c.grow_through * value
    for column in range(5):
        grown += c.grow[column] * x.z[column]
    for row in range(5):
        total = c.b[row] * value
        for column in range(5):
            total += c.a[5 * row + column] * x.z[column]
        x.next[row] = total
    shaped = c.through * value
    for row in range(5):
        x.z[row] = x.next[row]
        shaped += c.out[row] * x.z[row]
    acted = hook.position(shaped)
    x.level += grown + c.step * (acted - shaped - c.neutral)
    output = c.offset + c.gain * acted + c.integrator_gain * x.level
    output = hook.flow(output, 0.0)
    reading = hook.sensor(output)
    return reading  # noqa: RET504  (a hook's value needs a name)


def coefficients(p: Mapping[str, float], step_s: float) -> dict[str, float | Array]:
    """Coefficients of one sub-step from gain, dead time and time constants."""
    a, b, out, through = state_space(p)
    step, push = _held_step(a, b, step_s)
    grow, grow_through = _grown(a, b, out, through, step_s) if integrates(p) else (np.zeros(_ORDER), 0.0)
    return {
        "offset": p["offset"],
        "gain": p["gain"],
        "bend": p["bend"],
        "is_odd": p["is_odd"],
        "dead_steps": delay_steps(p["dead_time"], step_s),
        "at_input": 1.0 - p["start_at_output"] if math.isinf(step_s) else 1.0,
        "a": step.ravel(),
        "b": push,
        "out": out,
        "through": through,
        "integrator_gain": p["integrator_gain"],
        "neutral": bent(p, p["neutral"]),
        "step": 0.0 if math.isinf(step_s) else step_s,
        "grow": grow,
        "grow_through": grow_through,
    }


def state_space(p: Mapping[str, float]) -> tuple[Array, Array, Array, float]:
    """(A, B, C, D) of unit gain without dead time, padded to five states; sections with no time pass through."""
    a, b = np.zeros((_ORDER, _ORDER)), np.zeros(_ORDER)
    out, through, at = np.zeros(_ORDER), 1.0, 0
    if p["lag_time"] > _INSTANT_S:
        a[0, 0], b[0] = -1.0 / p["lag_time"], 1.0 / p["lag_time"]
        out[0], through, at = 1.0, 0.0, 1
    for i in ("1", "2"):
        time_s = p[f"pair{i}_time"]
        if time_s <= _INSTANT_S:
            continue
        drive = 1.0 / time_s**2
        a[at, at + 1] = 1.0
        a[at + 1, at], a[at + 1, at + 1] = -drive, -2.0 * p[f"pair{i}_damping"] / time_s
        a[at + 1, :at] = drive * out[:at]
        b[at + 1] = drive * through
        square = p[f"pair{i}_zero_square"] * drive  # what the second derivative passes straight through
        out, through = square * out, square * through
        out[at], out[at + 1] = 1.0 - square, p[f"pair{i}_zero"] - 2.0 * p[f"pair{i}_damping"] * square * time_s
        at += 2
    return a, b, out, through


def _held_step(a: Array, b: Array, step_s: float) -> tuple[Array, Array]:
    used = np.flatnonzero(np.abs(a).sum(axis=1))
    step, push = np.zeros_like(a), np.zeros_like(b)
    if not used.size:
        return step, push
    n = int(used.max()) + 1
    if math.isinf(step_s):
        if not a[:n, :n].any(axis=1).all():
            raise InputError(
                "transfer-function: at these time constants it has no state of rest to begin from; a time of a pole is "
                "so long that its pole lies at zero. A plant that integrates has 'integrator_gain' instead"
            )
        push[: n % 2] = push[n % 2 : n : 2] = 1.0  # of a lag and of each pair the output rests at the input
        return step, push
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = a[:n, :n], b[:n]
    found = _expm(whole * step_s)
    step[:n, :n], push[:n] = found[:n, :n], found[:n, n]
    return step, push


def _expm(values: Array) -> Array:
    from scipy.linalg import expm  # a fifth of a short command's time, and only this plant takes it

    return np.asarray(expm(values))


def _grown(a: Array, b: Array, out: Array, through: float, step_s: float) -> tuple[Array, float]:
    """The integral of the output of unit gain over a step, by the states at its start and by the held input."""
    if math.isinf(step_s):
        return np.zeros(_ORDER), 0.0
    whole = np.zeros((_ORDER + 2, _ORDER + 2))
    whole[:_ORDER, :_ORDER], whole[:_ORDER, _ORDER] = a, b
    whole[_ORDER + 1, :_ORDER], whole[_ORDER + 1, _ORDER] = out, through
    row = _expm(whole * step_s)[_ORDER + 1]
    return np.ascontiguousarray(row[:_ORDER]), float(row[_ORDER])


def bent(p: Mapping[str, float], value: float) -> float:
    """The static curve before the dynamics."""
    return value + p["bend"] * value * (abs(value) if p["is_odd"] else value)


def integrates(p: Mapping[str, float]) -> bool:
    """Whether the output goes on while the input stands."""
    return p["integrator_gain"] != 0.0


def initial(p: Mapping[str, float], inputs: tuple[float, ...], output: float) -> dict[str, float]:
    """The bent input at which the first output would have been at rest; where an integrator stands then."""
    if integrates(p):
        level = 0.0 if math.isnan(output) else (output - p["offset"]) / p["integrator_gain"]
        return {"before": bent(p, p["neutral"]), "level": level}
    if p["start_at_output"] == 0.0 or math.isnan(output) or p["gain"] == 0.0:
        return {"before": bent(p, inputs[0])}
    return {"before": (output - p["offset"]) / p["gain"]}


_GAIN = ("gain", "offset")
_INTEGRATOR = ("integrator_gain", "neutral")
_AT_OUTPUT = {"gain": 0.0, "start_at_output": 1.0}  # an integrator is at rest before the first sample
_PAIR1 = ("pair1_time", "pair1_damping")
_PAIR2 = ("pair2_time", "pair2_damping")
_ZERO1, _SQUARE1 = ("pair1_zero",), ("pair1_zero_square",)


def _with_dead_time(
    name: str, free: tuple[str, ...], after: str, *starts: Mapping[str, float], fixed: Mapping[str, float] = {}
) -> list[Structure]:
    """A structure and the same with a dead time."""
    late = ({"dead_time": 0.05}, {"dead_time": 0.4})
    return [
        Structure(name, free, after, starts or ({},), fixed),
        Structure(f"{name}, dead time", (*free, "dead_time"), name, late, fixed),
    ]


def _bent(how: str, **fixed: float) -> list[Structure]:
    """Plain structures behind a static curve, each with the values of the one without it to begin with."""
    named = [(*s.name.partition(", "), s) for s in _PLAIN]
    return [Structure(f"{n}{how}{comma}{late}", (*s.free, "bend"), s.name, ({},), fixed) for n, comma, late, s in named]


_PLAIN = (
    *_with_dead_time("gain", _GAIN, ""),
    *_with_dead_time("1 pole", (*_GAIN, "lag_time"), "gain", {"lag_time": 1.0}),
    *_with_dead_time(
        "2 poles",
        (*_GAIN, *_PAIR1),
        "1 pole",
        {"pair1_time": 0.5, "pair1_damping": 1.1},
        {"pair1_time": 0.7, "pair1_damping": 0.3},
        {"pair1_time": 0.15, "pair1_damping": 0.1},
    ),
)
STRUCTURES = (
    *_PLAIN,
    *_with_dead_time(
        "2 poles, 1 zero", (*_GAIN, *_PAIR1, *_ZERO1), "2 poles", {"pair1_zero": 0.5}, {"pair1_zero": -0.2}
    ),
    *_with_dead_time("3 poles", (*_GAIN, "lag_time", *_PAIR1), "2 poles", {"lag_time": 0.3}, {"lag_time": 3.0}),
    *_with_dead_time(
        "3 poles, 1 zero", (*_GAIN, "lag_time", *_PAIR1, *_ZERO1), "3 poles", {"pair1_zero": 0.3}, {"pair1_zero": -0.1}
    ),
    *_with_dead_time(
        "3 poles, 2 zeros", (*_GAIN, "lag_time", *_PAIR1, *_ZERO1, *_SQUARE1), "3 poles, 1 zero",
        {"pair1_zero_square": 0.05},
    ),
    *_with_dead_time(
        "4 poles, 1 zero", (*_GAIN, *_PAIR1, *_PAIR2, *_ZERO1), "2 poles, 1 zero",
        {"pair2_time": 0.2, "pair2_damping": 0.7}, {"pair2_time": 1.0, "pair2_damping": 0.2},
    ),
    *_with_dead_time(
        "4 poles, 2 zeros", (*_GAIN, *_PAIR1, *_PAIR2, *_ZERO1, *_SQUARE1), "4 poles, 1 zero",
        {"pair1_zero_square": 0.05},
    ),
    *_with_dead_time(
        "5 poles, 2 zeros", (*_GAIN, "lag_time", *_PAIR1, *_PAIR2, *_ZERO1, *_SQUARE1), "4 poles, 2 zeros",
        {"lag_time": 0.1}, {"lag_time": 2.0},
    ),
    *_with_dead_time("integrator", _INTEGRATOR, "", fixed=_AT_OUTPUT),
    *_with_dead_time(
        "integrator, 1 pole", (*_INTEGRATOR, "lag_time"), "integrator", {"lag_time": 1.0}, fixed=_AT_OUTPUT
    ),
    *_with_dead_time(
        "integrator, 2 poles", (*_INTEGRATOR, *_PAIR1), "integrator, 1 pole",
        {"pair1_time": 0.7, "pair1_damping": 1.1}, {"pair1_time": 0.5, "pair1_damping": 0.3}, fixed=_AT_OUTPUT,
    ),
    *_bent(", bent"),
    *_bent(", odd curve", is_odd=1.0),
)  # fmt: skip

PLANT = Plant(
    name="transfer-function",
    title="linear transfer function",
    inputs=(Signal("input", "any"),),
    output=Signal("output", "any"),
    parameters=(
        Parameter("gain", "[{output}]/[{input}]", 1.0, -_FAR, _FAR, "output over input at rest", hook="position"),
        Parameter("offset", "{output}", 0.0, -_FAR, _FAR, "output at zero input", hook="flow", size=_SIZE),
        Parameter(
            "bend",
            "1/[{input}]",
            0.0,
            -_FAR,
            _FAR,
            "b of u + b·u² (odd: u + b·u·|u|), the curve before the dynamics",
            fixed=True,
            hook="command",
            size=_SIZE,
        ),
        Parameter("is_odd", "1", 0.0, 0.0, 1.0, "1: the curve bends alike to both sides, 0: to one", fixed=True),
        Parameter("dead_time", "s", 0.0, 0.0, 1e4, "pure delay", growth="dead_time", hook="command", size=1.0),
        Parameter("lag_time", "s", 0.0, 0.0, _LONG_S, "time constant of the real pole", hook="position", size=_TIME_S),
        Parameter("pair1_time", "s", 0.0, 0.0, _LONG_S, "1/ω of the first pair of poles", size=_TIME_S),
        Parameter("pair1_damping", "1", 0.7, 0.001, 50.0, "damping ratio of the first pair"),
        Parameter(
            "pair1_zero",
            "s",
            0.0,
            -_LONG_S,
            _LONG_S,
            "first zero: 1 + s·z + s²·w; negative z: right half plane",
            size=_ZERO_S,
        ),
        Parameter("pair1_zero_square", "s^2", 0.0, -(_LONG_S**2), _LONG_S**2, "w of the first zero", size=_SQUARE_S2),
        Parameter("pair2_time", "s", 0.0, 0.0, _LONG_S, "1/ω of the second pair of poles", size=_TIME_S),
        Parameter("pair2_damping", "1", 0.7, 0.001, 50.0, "damping ratio of the second pair"),
        Parameter("pair2_zero", "s", 0.0, -_LONG_S, _LONG_S, "second zero: 1 + s·z + s²·w", size=_ZERO_S),
        Parameter("pair2_zero_square", "s^2", 0.0, -(_LONG_S**2), _LONG_S**2, "w of the second zero", size=_SQUARE_S2),
        Parameter(
            "integrator_gain",
            "[{output}]/[{input}]/s",
            0.0,
            -_FAR,
            _FAR,
            "rate of the output over the input",
            hook="position",
            size=_SIZE,
        ),
        Parameter(
            "neutral",
            "{input}",
            0.0,
            -_FAR,
            _FAR,
            "input at which an integrator stands still",
            hook="command",
            size=_SIZE,
        ),
        Parameter("start_at_output", "1", 0.0, 0.0, 1.0, "rest before the start: 0 at input, 1 at output", fixed=True),
    ),
    hooks=(
        Hook("command", "command", "{input}", 1.0),
        Hook("position", "dynamics", "{input}", 1.0),
        Hook("flow", "output", "{output}", 1.0, extra="opening"),
        Hook("sensor", "sensor", "{output}", 1.0),
    ),
    states={"before": 1, "level": 1, "z": _ORDER, "next": _ORDER},
    lines_s={"line": "dead_time"},
    equations=equations,
    coefficients=coefficients,
    sub_step_s=1.0,
    initial=initial,
    structures=STRUCTURES,
    switches=("start_at_output",),
    integrates=integrates,
)
