"""A plant about an operating point as a transfer function, and the gains of its metering edges or its blocked port.

The command stands, then steps up or down by a little; half the difference of the two answers is the step response of
the linear plant. What is the same in both (a piston that travels on, copper that warms) falls out. Eqs 3 to 6 of the
SP08-47C paper are this for a spool with friction and leakage left out. The port of an EFC is blocked: its rotor at x
answers with a pressure, and eqs 2.7 to 2.17 of the thesis leave K_1/K_2 = dP/dx.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hil.errors import InputError, SettingError, option
from hil.identification.frequency.frequency_response import from_polar
from hil.identification.frequency.linear_evidence import doubts
from hil.identification.frequency.order_choice import fit_transfer_function
from hil.language.note import Note
from hil.physics.model import Model
from hil.physics.plant import Parameters, Signal
from hil.physics.plants.brevini_hpv41 import metered
from hil.physics.simulate import Drive, simulate
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Array, Complex, split_heading

_INTERVAL_S = 1e-3
_SETTLE_S = 0.5  # under the command before it steps
_LINES = 40
_LEAST_PERIODS, _LEAST_SAMPLES = 1.0, 25  # within the window, and in a period
_STANDS = 0.02  # of the whole change, within which an answer has settled
_STEP = 1e-2  # of an argument in % or bar, for slopes


@dataclass(frozen=True, slots=True)
class Linearised:
    """A plant about an operating point.

    Attributes:
        model: the transfer function; an integrator is a pole at 0.
        fit_percent: of it to the linear plant's own frequency response.
        output: at the operating point, in its unit.
        gains: K_q and K_c with their units, for plants with metering edges; K_1/K_2 of a valve on a blocked port.
        uneven: how far up and down differ, as a share of the answer: 0 for a linear plant.
        notes: why the transfer function is no model of it, or nobody knows it there; none where it is one.
    """

    model: TransferFunction
    fit_percent: float
    output: float
    gains: Mapping[str, tuple[float, str]]
    uneven: float
    notes: tuple[Note, ...] = ()


def linearised(
    model: Model,
    at: float,
    *,
    step: float | None = None,
    window_s: float = 1.0,
    poles: int | None = None,
    zeros: int | None = None,
    load_pressure_bar: float = 0.0,
) -> Linearised:
    """The plant of a model about a command.

    Args:
        model: with the effects that are switched on in it.
        at: the command, in the plant's unit.
        step: of the command; 1 % of its full scale when not given.
        window_s: of the answer that is looked at; it must have settled (or its rate: the plant integrates then).
        poles: of the transfer function, without the integrator; by evidence when None.
        zeros: likewise.
        load_pressure_bar: P_L, at which K_q and K_c are taken.

    Raises:
        SettingError: a command, a step or a pressure that is none.
        InputError: the plant does not answer, as inside a dead band.
    """
    plant = model.definition
    size = 0.01 * plant.inputs[0].full_scale if step is None else step
    for name, value in (("at", at), ("step", size), ("load-pressure", load_pressure_bar)):
        if not math.isfinite(value) or (name == "step" and value == 0.0):
            raise SettingError(f"{option(name)} {value:g}: a finite number{', not 0' if name == 'step' else ''}")
    up, down = (_answer(model, at, sign * size, window_s) for sign in (1.0, -1.0))
    stood = _answer(model, at, 0.0, window_s)
    moved = (up - down) / (2.0 * size)
    rate = np.diff(moved) / _INTERVAL_S
    integrates = not _settled(moved)
    answer = rate if integrates else moved
    if not np.ptp(answer) > 0.0:
        raise InputError(
            f"{model.plant}: no answer to ±{size:g} {plant.inputs[0].unit} about {at:g}; it stands in a dead band, a "
            f"hysteresis or at an end there: take another command, or a larger {option('step')}"
        )
    top_hz = 1.0 / (_LEAST_SAMPLES * _INTERVAL_S)
    if not _settled(answer):
        raise InputError(
            f"{model.plant}: neither the answer to a step nor its rate settles within {window_s:g} s; look at it "
            f"longer with {option('window')}"
        )
    frequency_hz = np.geomspace(_LEAST_PERIODS / window_s, top_hz, _LINES)
    fit = fit_transfer_function(
        from_polar("linearised", frequency_hz, _response(answer, frequency_hz)), poles=poles, zeros=zeros,
        dead_time=None if poles is None else False,
    )  # fmt: skip
    linear = fit.model
    if integrates:
        linear = transfer_function(linear.numerator, np.append(linear.denominator, 0.0), linear.dead_time_s)
    uneven = float(np.abs(up + down - 2.0 * stood).max() / np.abs(up - down).max())
    notes = (*_beyond(plant.inputs[0], at), *doubts(fit))
    return Linearised(linear, fit.fit_percent, float(stood[0]), _gains(model, at, size, load_pressure_bar), uneven,
                      notes)  # fmt: skip


def _beyond(command: Signal, at: float) -> tuple[Note, ...]:
    if command.unit == "any" or abs(at) <= command.full_scale:
        return ()
    return (
        Note(
            "{at:g} {unit} lies beyond the full scale of {full:g} {unit}, where nobody knows the plant",
            at=at, unit=command.unit, full=command.full_scale,
        ),
    )  # fmt: skip


def _settled(answer: Array) -> bool:
    """Whether an answer hardly moves any more over its last tenth."""
    tail = answer[-len(answer) // 10 :]
    return bool(np.ptp(tail) <= _STANDS * np.ptp(answer))


def _answer(model: Model, at: float, size: float, window_s: float, settle_s: float = _SETTLE_S, row: int = 0) -> Array:
    """Output from the step on, shape (n,)."""
    before, after = round(settle_s / _INTERVAL_S), round(window_s / _INTERVAL_S)
    command = np.concatenate((np.full(before, at), np.full(after, at + size)))
    rest = [np.zeros_like(command)] * (len(model.definition.inputs) - 1)
    drive = Drive(np.array([command, *rest]), math.nan, _INTERVAL_S, model.read_at)
    return simulate(model.definition, model.values, drive, model.active_effects)[row][before:]


def _response(answer: Array, frequency_hz: Array) -> Complex:
    """H(f) of a settled step response: the transform of its increments."""
    steps = np.diff(answer, prepend=0.0)
    time_s = _INTERVAL_S * (np.arange(len(steps)) - 0.5)
    made = np.exp(-2j * math.pi * np.outer(frequency_hz, time_s)) @ steps
    return np.asarray(made, dtype=np.complex128)


def _gains(model: Model, at: float, size: float, load_bar: float) -> dict[str, tuple[float, str]]:
    """K_q = ∂q/∂x and K_c = −∂q/∂P_L of eq. 3, where a metering law is known; K_1/K_2 of a blocked port."""
    observed = {signal.name: row for row, signal in enumerate(model.definition.observed, 1)}

    def settled(command: float, row: int) -> float:
        return float(_answer(model, command, 0.0, _INTERVAL_S, 2.0, row)[-1])

    def slope_at_rest(row: int) -> float:
        return (settled(at + size, row) - settled(at - size, row)) / (2.0 * size)

    of, unit = model.definition.inputs[0], split_heading(model.output)[1]
    if model.plant in _ON_BLOCKED_PORTS:
        stroke = slope_at_rest(observed[_ON_BLOCKED_PORTS[model.plant]])
        return {"K_1/K_2": (slope_at_rest(0) / stroke, f"{unit}/A")} if stroke else {}
    law = _LAWS.get(model.plant)
    if law is None:
        return {}
    spool = settled(at, observed["spool position"])
    unit = unit if model.plant == "brevini-hpv41" else "l/min"
    slope = (law(model.values, spool + _STEP, load_bar) - law(model.values, spool - _STEP, load_bar)) / (2.0 * _STEP)
    softness = (law(model.values, spool, load_bar - _STEP) - law(model.values, spool, load_bar + _STEP)) / (2.0 * _STEP)
    made = {"K_q": (float(slope), f"({unit})/%")}
    if of.unit != "%":
        made[f"K_q per {of.unit}"] = (float(slope) * slope_at_rest(observed["spool position"]), f"({unit})/{of.unit}")
    return {**made, "K_c": (float(softness), f"({unit})/bar")}


def _four_edges(p: Parameters, spool: float, load_bar: float) -> float:
    """Flow of a spool with like edges in l/min: half of what the load leaves of the supply falls over each of two."""
    drop = max((p["supply_pressure"] - math.copysign(load_bar, spool * load_bar)) / 2.0, 0.0)
    return p["rated_flow"] * 0.01 * spool * math.sqrt(drop / 35.0)


def _compensated(p: Parameters, spool: float, _load_bar: float) -> float:
    """The compensator keeps the drop: flow follows the spool alone, and K_c is 0."""
    return float(metered(spool, p["dead_band"], p["full_flow"], p["curve_exponent"]))


_LAWS: Mapping[str, Callable[[Parameters, float, float], float]] = {
    "hydraforce-open-loop": _four_edges, "brevini-hpv41": _compensated,
}  # fmt: skip
_ON_BLOCKED_PORTS = {
    "cummins-efc": "rotor position", "efc-measured": "rotor position", "efc-drive": "coil current",
    "efc-duty": "coil current",
}  # fmt: skip
"""What holds the valve open, in A of the current that would hold it there at rest."""
