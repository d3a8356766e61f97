"""A linear transfer function with dead time, as a value: evaluate it, take it apart, step it, hand it on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.errors import InputError
from hil.record.recording import Array, Complex

if TYPE_CHECKING:
    from hil.physics.model import Model


@dataclass(frozen=True, slots=True)
class TransferFunction:
    """B(s)/A(s)·e^(−s·dead time), coefficients from the highest power down, A monic.

    Attributes:
        numerator: shape (zeros + 1,). `denominator`: shape (poles + 1,), first element 1.
        dead_time_s: pure delay.
    """

    numerator: Array
    denominator: Array
    dead_time_s: float = 0.0

    def at(self, frequency_hz: Array) -> Complex:
        """Complex gain at frequencies in Hz, same shape."""
        s = 2j * math.pi * np.asarray(frequency_hz, dtype=np.float64)
        ratio = np.polyval(self.numerator, s) / np.polyval(self.denominator, s)
        return ratio * np.exp(-s * self.dead_time_s)

    @property
    def poles(self) -> Complex:
        """Roots of the denominator in rad/s, slowest first."""
        return _roots(self.denominator)

    @property
    def zeros(self) -> Complex:
        """Roots of the numerator in rad/s, slowest first."""
        return _roots(self.numerator)

    @property
    def dc_gain(self) -> float:
        """Gain at rest; infinite with an integrator."""
        if self.denominator[-1] == 0.0:
            return math.inf
        return float(self.numerator[-1] / self.denominator[-1])

    @property
    def right_half_plane_zeros(self) -> Complex:
        """Zeros with a positive real part: the start of a step goes the wrong way."""
        return self.zeros[self.zeros.real > 0.0]

    @property
    def is_stable(self) -> bool:
        """Whether every pole lies in the left half plane."""
        return bool(np.all(self.poles.real < 0.0))

    def step(self, time_s: Array) -> Array:
        """Response to a unit step at t = 0, exact, on even stamps of shape (n,); 0 before the dead time."""
        from scipy.linalg import expm

        n = len(self.denominator) - 1
        system, out, through = _companion(self.numerator, self.denominator)
        late = time_s - self.dead_time_s
        answered = np.flatnonzero(late >= 0.0)
        response = np.zeros(len(time_s))
        if answered.size:
            start = expm(system * late[answered[0]])[:, n]
            interval = (time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1)
            response[answered] = through + out @ _walk(expm(system * interval), start, answered.size)[:n]
        return response

    def to_control(self, pade_order: int = 3) -> Any:
        """As a `control.TransferFunction`; a dead time becomes a Padé approximation of that order.

        Raises:
            InputError: python-control is not installed.
        """
        try:
            import control
        except ModuleNotFoundError as error:
            raise InputError("to_control needs python-control: pip install 'valve-hil[control]'") from error
        made = control.tf(self.numerator, self.denominator)
        return made * control.tf(*control.pade(self.dead_time_s, pade_order)) if self.dead_time_s else made

    def to_parameters(self) -> dict[str, float]:
        """Parameters of the plant `transfer-function` with the same response, offset 0.

        Raises:
            InputError: more poles or zeros than that plant has, an unstable pole, or one at zero.
        """
        poles, zeros = self.poles, self.zeros
        integrates = len(poles) > 1 and poles[0] == 0.0 != poles[1]
        if integrates and len(self.numerator) < len(self.denominator):
            made = TransferFunction(self.numerator, self.denominator[:-1], self.dead_time_s).to_parameters()
            return {**made, "gain": 0.0, "integrator_gain": made["gain"]}
        if len(poles) > 5 or not self.is_stable or np.any(np.abs(zeros) == 0.0):
            raise InputError(
                f"the plant 'transfer-function' has up to five stable poles and no zero at 0; found poles {poles} "
                f"and zeros {zeros}"
            )
        lead, squares = sections(zeros)
        tops = [*squares, *((first, 0.0) for first in lead)]
        if len(tops) > len(poles) // 2:
            raise InputError(f"the plant 'transfer-function' has no place for zeros {zeros} beside poles {poles}")
        made = {"gain": self.dc_gain, "offset": 0.0, "dead_time": self.dead_time_s, **pole_parameters(poles)}
        for i in range(2):
            made[f"pair{i + 1}_zero"], made[f"pair{i + 1}_zero_square"] = tops[i] if i < len(tops) else (0.0, 0.0)
        return made

    def to_model(self, input_heading: str, output_heading: str) -> Model:
        """A model of the plant `transfer-function` that drives `input_heading` to `output_heading`.

        Headings are `name [unit]`; the gain gets the unit of output over input.
        """
        from hil.physics.model import Model, Value
        from hil.physics.plants.transfer_function import PLANT

        units = PLANT.units(input_heading, output_heading)
        values = {name: Value(value, units[name]) for name, value in (PLANT.typical | self.to_parameters()).items()}
        return Model(PLANT.name, values, input=input_heading, output=output_heading)


def transfer_function(
    numerator: Sequence[float] | Array, denominator: Sequence[float] | Array, dead_time_s: float = 0.0
) -> TransferFunction:
    """A transfer function from any coefficients, made monic, leading zeros dropped.

    Raises:
        InputError: no denominator, more zeros than poles, or a negative dead time.
    """
    top = np.trim_zeros(np.atleast_1d(np.asarray(numerator, dtype=np.float64)), "f")
    below = np.trim_zeros(np.atleast_1d(np.asarray(denominator, dtype=np.float64)), "f")
    if not below.size or top.size > below.size or dead_time_s < 0.0:
        raise InputError(
            f"transfer function with {max(top.size - 1, 0)} zeros, {max(below.size - 1, 0)} poles and a dead time of "
            f"{dead_time_s:g} s; zeros may not outnumber poles, the dead time not be negative"
        )
    return TransferFunction((top if top.size else np.zeros(1)) / below[0], below / below[0], dead_time_s)


def from_factors(
    gain: float, lags: Sequence[Sequence[float]], leads: Sequence[Sequence[float]] = (), dead_time_s: float = 0.0
) -> TransferFunction:
    """gain·Π(1 + n₁s + n₂s²)/Π(1 + d₁s + d₂s²)·e^(−sT); each factor is (first, second) or (first,)."""
    return transfer_function(gain * product(leads), product(lags), dead_time_s)


def from_parameters(p: Mapping[str, float]) -> TransferFunction:
    """The transfer function that parameters of the plant `transfer-function` stand for; offset and neutral left out."""
    lags: list[tuple[float, float]] = [(p["lag_time"], 0.0)]
    leads: list[tuple[float, float]] = []
    for pair in ("pair1", "pair2"):
        time_s = p[f"{pair}_time"]
        if time_s > 0.0:
            lags.append((2.0 * p[f"{pair}_damping"] * time_s, time_s**2))
            leads.append((p[f"{pair}_zero"], p[f"{pair}_zero_square"]))
    plain = from_factors(1.0, lags, leads, p["dead_time"])
    rate = p.get("integrator_gain", 0.0)
    if rate == 0.0:
        return transfer_function(p["gain"] * plain.numerator, plain.denominator, p["dead_time"])
    above = np.convolve([p["gain"], rate], plain.numerator)
    return transfer_function(above, np.append(plain.denominator, 0.0), p["dead_time"])


def straight(p: Mapping[str, float], name: str) -> TransferFunction:
    """The same, of parameters with a straight static curve.

    Raises:
        InputError: the curve before the dynamics is bent.
    """
    if p.get("bend", 0.0):
        raise InputError(
            f"{name}: its static curve is bent (bend = {p['bend']:.4g}), so it has no transfer function; "
            "`hil linearise` gives one about an operating point"
        )
    return from_parameters(p)


def coefficient_names(zeros: int, poles: int, late: bool = False) -> tuple[str, ...]:
    """b1, b0, a2, a1, a0 …: numerator, denominator without its leading 1, and the dead time of one that is late."""
    named = [f"b{k}" for k in range(zeros, -1, -1)] + [f"a{k}" for k in range(poles - 1, -1, -1)]
    return (*named, "dead_time_s") if late else tuple(named)


def _roots(coefficients: Array) -> Complex:
    found = np.roots(coefficients).astype(np.complex128)
    return found[np.lexsort((found.imag, np.round(np.abs(found), 12)))]


def product(factors: Sequence[Sequence[complex]]) -> Any:
    """Π (1 + f₁s + f₂s² …), highest power first, shape (powers,); complex where a factor is."""
    made: Any = np.ones(1)
    for factor in factors:
        made = np.convolve(made, [*reversed(list(factor)), 1.0])
    return made


def _companion(numerator: Array, denominator: Array) -> tuple[Array, Array, float]:
    """State matrix with the held input as its last state, output row, and direct feedthrough."""
    n = len(denominator) - 1
    through = float(numerator[0]) if len(numerator) == n + 1 else 0.0
    system = np.zeros((n + 1, n + 1))
    system[np.arange(n - 1), np.arange(1, n)] = 1.0
    if n:
        system[n - 1, :n] = -denominator[:0:-1]
        system[n - 1, n] = 1.0
    padded = np.concatenate((np.zeros(n + 1 - len(numerator)), numerator))
    return system, (padded - through * denominator)[:0:-1], through


def _walk(step: Array, start: Array, count: int) -> Array:
    """start, step·start, step²·start, … as columns, by doubling."""
    states, stride = start[:, None], step
    while states.shape[1] < count:
        states = np.hstack((states, stride @ states))
        stride = stride @ stride
    return states[:, :count]


def sections(roots: Complex) -> tuple[list[float], list[tuple[float, float]]]:
    """Roots as 1 + f₁s (at most one, the slowest real) and 1 + f₁s + f₂s² factors."""
    real = sorted((r.real for r in roots if abs(r.imag) <= 1e-9 * abs(r)), key=abs)
    single = [-1.0 / real.pop(0)] if len(real) % 2 else []
    pairs = [(-2.0 * r.real / abs(r) ** 2, 1.0 / abs(r) ** 2) for r in roots if r.imag > 1e-9 * abs(r)]
    pairs += [(-1.0 / a - 1.0 / b, 1.0 / (a * b)) for a, b in zip(real[::2], real[1::2], strict=True)]
    return single, pairs


def pole_parameters(poles: Complex) -> dict[str, float]:
    """Times and dampings of the plant `transfer-function` with these stable poles, the slower pair first; 0 is none."""
    lag, pairs = sections(poles)
    pairs = sorted(pairs, key=lambda pair: -pair[1])
    made = {"lag_time": lag[0] if lag else 0.0}
    for i in range(2):
        first, square = pairs[i] if i < len(pairs) else (0.0, 0.0)
        time_s = math.sqrt(square)
        made[f"pair{i + 1}_time"] = time_s
        made[f"pair{i + 1}_damping"] = first / (2.0 * time_s) if time_s else 0.7
    return made
