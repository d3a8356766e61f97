"""From a closed loop to the open one, and back: where the sensor stands decides the formula.

With a controller or sensor C in the forward path, T = C·G/(1 + C·G) and G = T/(C − C·T). With C in the feedback,
T = G/(1 + C·G) and G = T/(1 − C·T). Both subtract numbers that are nearly equal at low frequency, so an error of
T there becomes a pole of G that the plant does not have; `opened` says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hil.errors import InputError
from hil.language.note import Note
from hil.physics.formula import root_text
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Complex

Place = Literal["forward", "feedback"]

UNITY = transfer_function((1.0,), (1.0,))
_AT_REST = 0.01  # how near 1 the loop must come at rest for its opening to be believed


@dataclass(frozen=True, slots=True)
class OpenedLoop:
    """A plant calculated from its closed loop.

    Attributes:
        model: the plant.
        unstable_poles: of it, in rad/s; empty for one that can be believed.
        rest: C(0)·T(0) with the sensor in the feedback, T(0) in the forward path: 1 for a loop around an
            integrating plant; NaN where the closed loop has no gain at rest.
        notes: what the reader should know.
    """

    model: TransferFunction
    unstable_poles: Complex
    rest: float
    notes: tuple[Note, ...]


def opened(closed: TransferFunction, sensor: TransferFunction = UNITY, place: Place = "forward") -> OpenedLoop:
    """The plant G whose loop with the sensor C is T.

    Args:
        closed: T, from the request to the output.
        sensor: C. The default, 1, makes both places the same.
        place: of C: G = T/(C − C·T) or G = T/(1 − C·T).

    Raises:
        InputError: a dead time in T or C (G is then no ratio of polynomials; `opened_response` takes it), T = 1,
            or a G with more zeros than poles.
    """
    for name, model in (("T", closed), ("C", sensor)):
        if model.dead_time_s:
            raise InputError(
                f"opening a loop: {name} has a dead time of {model.dead_time_s:g} s; only its response can be opened, "
                "with `opened_response`"
            )
    top = np.convolve(closed.numerator, sensor.denominator)
    if place == "forward":
        below = np.convolve(sensor.numerator, np.polysub(closed.denominator, closed.numerator))
    else:
        below = np.polysub(
            np.convolve(closed.denominator, sensor.denominator), np.convolve(closed.numerator, sensor.numerator)
        )
    if not np.any(below):
        raise InputError("opening a loop: T is 1 at every frequency; there is no finite plant with such a loop")
    made = transfer_function(top, below)
    unstable = made.poles[made.poles.real > 0.0]
    rest = _rest(closed, sensor if place == "feedback" else UNITY)
    return OpenedLoop(made, unstable, rest, _notes(unstable, rest, "C(0)·T(0)" if place == "feedback" else "T(0)"))


def opened_response(closed: Complex, sensor: Complex | float = 1.0, place: Place = "forward") -> Complex:
    """The plant's response from that of its closed loop, line by line; measured responses and dead times too.

    Args:
        closed: T at some frequencies, shape (n,).
        sensor: C at the same, shape (n,), or a constant.
        place: of C.
    """
    return closed / (sensor * (1.0 - closed) if place == "forward" else 1.0 - sensor * closed)


def closed(plant: TransferFunction, sensor: TransferFunction = UNITY, place: Place = "forward") -> TransferFunction:
    """The loop of a plant with a sensor: C·G/(1 + C·G), or G/(1 + C·G).

    Raises:
        InputError: a dead time, which makes it no ratio of polynomials.
    """
    if plant.dead_time_s or sensor.dead_time_s:
        raise InputError(
            "closing a loop: with a dead time it is no ratio of polynomials; "
            "`hil linearise --set dead_time=0` leaves it out"
        )
    around = np.convolve(plant.numerator, sensor.numerator)
    below = np.polyadd(np.convolve(plant.denominator, sensor.denominator), around).astype(np.float64)
    return transfer_function(around if place == "forward" else np.convolve(plant.numerator, sensor.denominator), below)


def closed_with_gain(plant: TransferFunction, feedback_gain: float) -> tuple[TransferFunction, tuple[Note, ...]]:
    """The loop of a plant over a gain in the feedback, G/(1 + K·G), and what its reader should know.

    Args:
        plant: G. An integrating one is 1/K at rest.
        feedback_gain: K, in units of the request per unit of the output.

    Raises:
        InputError: a dead time, or no gain.
    """
    if feedback_gain == 0.0 or not math.isfinite(feedback_gain):
        raise InputError(f"closing a loop: a gain of the feedback of {feedback_gain:g} closes none")
    made = closed(plant, transfer_function((feedback_gain,), (1.0,)), "feedback")
    unstable = made.poles[made.poles.real >= 0.0]
    if not unstable.size:
        return made, ()
    largest = float(np.max(unstable.real))
    return made, (Note("The loop is unstable: a pole at {pole:+.4g} rad/s; a smaller gain is needed.", pole=largest),)


def _rest(loop: TransferFunction, sensor: TransferFunction) -> float:
    below = float(loop.denominator[-1] * sensor.denominator[-1])
    return float(loop.numerator[-1] * sensor.numerator[-1]) / below if below else math.nan


def _notes(unstable: Complex, rest: float, what: str) -> tuple[Note, ...]:
    made = []
    if unstable.size:
        poles = tuple(root_text(pole, "+.4g") for pole in unstable)
        made.append(Note(
            "The opened loop has poles in the right half plane, {poles!l} rad/s: left alone, the plant would run away. "
            "A spool, a cylinder and an LVDT have none; the closed loop, its units or the place of C are wrong.",
            poles=poles,
        ))  # fmt: skip
    if math.isfinite(rest) and abs(rest - 1.0) > _AT_REST:
        off = Note("{what} is {rest:.5g}; a position loop without steady error has 1.", what=what, rest=rest)
        made.append(Note("{off} Above 1 the opened loop has a negative gain at rest.", off=off) if rest > 1.0 else off)
    return tuple(made)
