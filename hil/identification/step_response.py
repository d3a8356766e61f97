"""Step-response figures and the first- and second-order models that a step alone supports."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil.errors import InputError
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Array, Recording
from hil.signals.colour import colour_factor

_SETTLED_SHARE = 0.15  # of the samples after the step: its end gives the final value
_DRAWS = 100
_LEAST_JUMP = 0.01  # of the command's span
_WINDOW = 9
_SMOOTHED_VARIANCE = 59.0 / 231.0  # of white noise after a quadratic over nine samples
_BY_NOISE = 5.0  # standard deviations: the largest of thousands of samples
_ALIKE = 2.0  # of the noise of two stretches, beyond which one of them is not noise alone
_COLOURED = 1.3  # times what white noise would leave: then the noise is taken from where the response stands
_LEAST_QUIET = 5 * _WINDOW


@dataclass(frozen=True, slots=True)
class StepFigures:
    """What a step response is described by; times in seconds from the step of the command.

    Attributes:
        start, final: steady values before the step and at its end, in the output's unit.
        dead_time_s: until the output has moved by more than noise and more than 2 % of its change.
        rise_s: from 10 % to 90 % of the change. `response_s`: until 90 %.
        settling_s: after which the output stays within `band` of the change.
        reaches_s: until it first comes within `band`, as the HPV41 paper defines its settling time.
        overshoot: beyond the final value, as a share of the change; 0 where noise alone could make it (five standard
            deviations).
        band: share of the change that counts as settled.
    """

    start: float
    final: float
    dead_time_s: float
    rise_s: float
    response_s: float
    settling_s: float
    reaches_s: float
    overshoot: float
    band: float


@dataclass(frozen=True, slots=True)
class MeasuredStep:
    """Figures of a noisy step with their standard uncertainties.

    Attributes:
        figures: of the smoothed response.
        std: standard uncertainty of each figure, infinite where the noise can move it past the record.
        noise_std: of a sample, in the output's unit. `smoothed_std`: of what smoothing leaves of it.
        from_command, to_command: the step, in the command's unit.
    """

    figures: StepFigures
    std: StepFigures
    noise_std: float
    smoothed_std: float
    from_command: float
    to_command: float


def step_figures(
    time_s: Array, response: Array, *, start: float | None = None, final: float | None = None, band: float = 0.02,
    noise_std: float = 0.0,
) -> StepFigures:  # fmt: skip
    """Figures of a response to a step at t = 0; stamps rising, the first at or after 0.

    Args:
        time_s: shape (n,).
        response: shape (n,).
        start: value before the step; the first sample when None.
        final: value at the end; the mean of the last samples when None.
        band: share of the change within which it counts as settled.
        noise_std: of the samples; crossings of the settling band by noise alone are not counted.

    Raises:
        InputError: the response does not change, or does not reach 90 % of its final value.
    """
    tail = max(1, round(_SETTLED_SHARE * len(response)))
    first = float(response[0]) if start is None else start
    last = float(np.mean(response[-tail:])) if final is None else final
    change = last - first
    if change == 0.0:
        raise InputError("step response: the output does not change")
    share = (response - first) / change
    moved = max(0.02, 4.0 * noise_std / abs(change))
    by_noise = _BY_NOISE * noise_std / abs(change)
    allowed = max(band, by_noise)
    beyond = float(share.max()) - 1.0
    ten, ninety = _reaches(time_s, share, 0.1), _reaches(time_s, share, 0.9)
    return StepFigures(
        first, last, _reaches(time_s, share, moved), ninety - ten, ninety,
        _stays(time_s, share, allowed), _reaches(time_s, share, 1.0 - band),
        beyond if beyond > by_noise else 0.0, band,
    )  # fmt: skip


def measured_steps(
    recording: Recording, input_name: str, output_name: str, *, band: float = 0.02
) -> tuple[MeasuredStep, ...]:
    """Figures of every step of the command in a recording, with uncertainty.

    A step begins where the command jumps and ends at the next jump. Uncertainties come from repeats of the
    evaluation on the smoothed response with noise redrawn (seeded, so results repeat): white noise as large as
    smoothing removes it; where the standing response shows more than that leaves, the noise there as it is.

    Raises:
        InputError: the command holds no step.
    """
    command = recording.channel(input_name)
    edges = _jumps(command.values)
    if not edges:
        raise InputError(f"{recording.name}: channel '{command.heading}' holds no step")
    made = []
    for before, first, stop in zip([0, *edges], edges, [*edges[1:], len(recording)], strict=False):
        made.append(_measured(recording, command.values, output_name, before, first, stop, band))
    return tuple(made)


def first_order_from_rise(rise_s: float, constant: float = 2.2) -> TransferFunction:
    """a/(s + a) with a = 2.2/Tr, eqs 11 and 12 of the HPV41 paper (2.2 stands for ln 9 = 2.197)."""
    return transfer_function([constant / rise_s], [1.0, constant / rise_s])


def first_order_from_settling(settling_s: float, constant: float = 4.0) -> TransferFunction:
    """a/(s + a) with a = 4/Ts, eq. 13 (4 stands for ln 50 = 3.912)."""
    return transfer_function([constant / settling_s], [1.0, constant / settling_s])


def damping_roots(rise_s: float, settling_s: float) -> NDArray[np.complex128]:
    """The four roots of eq. 17, 1.76ζ⁴ − 0.417ζ³ + 1.039ζ² + ζ − 4Tr/Ts = 0 (Nise 2011, p. 181)."""
    return np.roots([1.76, -0.417, 1.039, 1.0, -4.0 * rise_s / settling_s]).astype(np.complex128)


def second_order_from_step(rise_s: float, settling_s: float) -> TransferFunction:
    """ω²/(s² + 2ζωs + ω²) with ζ from eq. 17 and ω = 4/(ζ·Ts), eqs 14 to 18.

    Raises:
        InputError: no root is a damping ratio between 0 and 1.
    """
    roots = damping_roots(rise_s, settling_s)
    real = [float(r.real) for r in roots if abs(r.imag) < 1e-9 and 0.0 < r.real < 1.0]
    if not real:
        raise InputError(f"rise {rise_s:g} s and settling {settling_s:g} s belong to no underdamped second-order model")
    omega = 4.0 / (real[0] * settling_s)
    return transfer_function([omega**2], [1.0, 8.0 / settling_s, omega**2])


def dead_time_explaining(rise_s: float, settling_s: float, band: float = 0.02) -> tuple[float, float]:
    """(time constant, dead time) of the first-order model with dead time that has both figures.

    A settling time that counts from the command holds the dead time, a rise time does not; where 4/Ts and
    2.2/Tr disagree, a dead time makes peace between them.
    """
    time_constant = rise_s / math.log(9.0)
    return time_constant, settling_s + time_constant * math.log(band)


def _measured(
    recording: Recording, command: Array, output_name: str, before: int, first: int, stop: int, band: float
) -> MeasuredStep:
    time_s = recording.stamps(output_name)[first:stop] - recording.time_s[first]
    output = recording.values(output_name)
    y = output[first:stop]
    rest = output[before:first][-max(1, (first - before) // 4) :]
    smooth = _smoothed(y)
    noise = _noise(y - smooth, [rest, y[-max(1, round(_SETTLED_SHARE * len(y))) :]])
    start, start_std = float(np.mean(rest)), noise.std * math.sqrt(noise.colour / len(rest))

    inner = slice(0, max(1, len(y) - _WINDOW // 2))  # the last samples are hardly smoothed

    def evaluate(response: Array, level: float) -> StepFigures:
        return step_figures(time_s[inner], response, start=level, band=band, noise_std=noise.smoothed_std)

    rng = np.random.default_rng(0)
    again = _smoothed(smooth + noise.redrawn(rng, len(y)))
    levels = start + start_std * rng.normal(size=_DRAWS)
    drawn = [astuple(evaluate(response[inner], float(level))) for response, level in zip(again, levels, strict=True)]
    spread = [float(np.std(column)) if np.all(np.isfinite(column)) else math.inf for column in zip(*drawn, strict=True)]
    return MeasuredStep(
        evaluate(smooth[inner], start), replace(StepFigures(*spread), band=band), noise.std, noise.smoothed_std,
        float(command[first - 1]), float(command[first]),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Noise:
    """Noise of a response: of a sample, of what smoothing leaves; `quiet` as recorded where it is coloured."""

    std: float
    smoothed_std: float
    colour: float
    quiet: Array | None = None

    def redrawn(self, rng: np.random.Generator, count: int) -> Array:
        """Noise of the same kind, shape (draws, count)."""
        if self.quiet is None:
            return self.std * rng.normal(size=(_DRAWS, count))
        begin, sign = rng.integers(len(self.quiet), size=(_DRAWS, 1)), rng.choice([-1.0, 1.0], size=(_DRAWS, 1))
        made: Array = sign * self.quiet[(begin + np.arange(count)) % len(self.quiet)]
        return made


def _noise(removed: Array, stretches: Sequence[Array]) -> _Noise:
    """From what smoothing removes, and from stretches where the response stands."""
    white = float(np.std(removed)) / math.sqrt(1.0 - _SMOOTHED_VARIANCE)
    left = white * math.sqrt(_SMOOTHED_VARIANCE)
    quiet = [_detrended(values) for values in stretches if len(values) >= _LEAST_QUIET]
    levels = [float(np.std(_smoothed(values))) for values in quiet]
    quiet = [values for values, level in zip(quiet, levels, strict=True) if level <= _ALIKE * min(levels)]
    smoothed_std = float(np.std(np.concatenate([_smoothed(values) for values in quiet]))) if quiet else 0.0
    if smoothed_std <= _COLOURED * left:
        return _Noise(white, left, colour_factor(removed))
    standing = np.concatenate(quiet)
    return _Noise(float(np.std(standing)), smoothed_std, max(colour_factor(values) for values in quiet), standing)


def _detrended(values: Array) -> Array:
    late = np.linspace(-1.0, 1.0, len(values))
    made: Array = values - np.mean(values) - late * float(late @ values) / float(late @ late)
    return made


def _jumps(values: Array) -> list[int]:
    """Samples at which the command jumps from standing still to standing still."""
    change = np.abs(np.diff(values))
    still = np.concatenate(([True, True], change == 0.0, [True, True]))
    large = np.flatnonzero(change > max(_LEAST_JUMP * float(np.ptp(values)), 0.0))
    # still[i + 2] belongs to change[i]: two samples at rest on either side make a step of it
    return [int(i) + 1 for i in large if still[i : i + 2].all() and still[i + 3 : i + 5].all()]


def _smoothed(values: Array) -> Array:
    """Local quadratic smoothing over nine samples: removes noise, keeps a corner within a sample."""
    from scipy.signal import savgol_filter

    if values.shape[-1] < _WINDOW:
        return values
    return np.asarray(savgol_filter(values, _WINDOW, 2, axis=-1), dtype=np.float64)


def _reaches(time_s: Array, share: Array, level: float) -> float:
    """First time at a level, between samples where it lies between them."""
    over = np.flatnonzero(share >= level)
    if not over.size:
        raise InputError(f"step response: the output does not reach {100 * level:g} % of its change; record longer")
    i = int(over[0])
    if i == 0:
        return float(time_s[0])
    part = (level - share[i - 1]) / (share[i] - share[i - 1])
    return float(time_s[i - 1] + part * (time_s[i] - time_s[i - 1]))


def _stays(time_s: Array, share: Array, band: float) -> float:
    """Time after which the response stays within a band about its final value."""
    outside = np.flatnonzero(np.abs(share - 1.0) > band)
    if not outside.size:
        return float(time_s[0])
    i = int(outside[-1])
    if i + 1 == len(share):
        return math.inf
    edge = 1.0 + math.copysign(band, share[i] - 1.0)
    part = (edge - share[i]) / (share[i + 1] - share[i])
    return float(time_s[i] + part * (time_s[i + 1] - time_s[i]))
