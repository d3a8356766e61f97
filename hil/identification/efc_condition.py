"""Condition of an EFC valve: good, malfunctioned or severely malfunctioned, from physics that its test measures.

Friction comes from the loop of the pressure curve, rise time from steps to 1.6 A, leakage from the flow through the
closed valve; a model of the classes is learnt from a simulated population. Beside it stands the way of the EFC thesis:
the error between a step and the simulated step of a good valve (eq. 4.1), and thresholds on it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from hil.cores import spread
from hil.errors import InputError
from hil.identification.classification import (
    Accuracy,
    GaussianClasses,
    Labels,
    accuracy,
    learn,
    leave_one_out,
    leave_one_out_thresholds,
)
from hil.identification.pressure_curve import Sweep, pressure_curve
from hil.identification.step_response import step_figures
from hil.physics.model import Model
from hil.physics.published.efc_population import population, valve
from hil.physics.published.tugsal import CLASSES, CLASSIFIED_CURRENT_A, rms_error
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array
from hil.signals.ramps import triangle

FEATURES = ("friction", "rise", "leakage")

_RATE_HZ = 1000.0
_CYCLES_S = (10.0, 20.0)
_TOP_A, _HOLD_S, _REPEATS = 2.0, 1.0, 3
_LEAST_FRICTION_A = 5e-4  # what a test can tell from none
_SMOOTHED_S = 0.009
_LEARNT_FROM, _SEED = 200, 1979


@dataclass(frozen=True, slots=True)
class ValveTest:
    """What one valve's test gave.

    Attributes:
        friction_a: half the width of the loop that no speed explains.
        rise_s: 10 % to 90 % of a step from no current to 1.6 A, mean of the repeats.
        leakage_ml_min: through the closed valve at 220 psi.
        error_psi: root mean square difference to a good valve's step, by current level.
    """

    friction_a: float
    rise_s: float
    leakage_ml_min: float
    error_psi: Mapping[str, float]

    @property
    def features(self) -> Array:
        """Logarithms of the three physical numbers."""
        return np.log([max(self.friction_a, _LEAST_FRICTION_A), self.rise_s, max(self.leakage_ml_min, 1.0)])


@dataclass(frozen=True, slots=True)
class Instruments:
    """What a test adds to a valve: noise of a reading, and the spread of what stays for one test.

    Standard deviations: of the pressure its noise and offset, its gain and the supply's as shares; of the leakage as
    a share.
    """

    noise_psi: float = 0.5
    offset_psi: float = 0.5
    gain: float = 0.005
    supply: float = 0.005
    leakage: float = 0.01


@dataclass(frozen=True, slots=True)
class Condition:
    """A verdict with what it is worth.

    Attributes:
        probabilities: by class.
        unlike: the valve is unlike any class; then the probabilities say little.
    """

    probabilities: Mapping[str, float]
    unlike: bool

    @property
    def verdict(self) -> str:
        """The most probable class."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])


@dataclass(frozen=True, slots=True)
class Comparison:
    """Both ways on one population, every valve judged by what the others taught.

    Attributes:
        physics: friction, rise and leakage.
        by_error: eq. 4.1 with its best thresholds, by current level.
        confident: of the verdicts that the physics gives at least 95 %.
    """

    physics: Accuracy
    by_error: Mapping[str, Accuracy]
    confident: Accuracy


def condition(test: ValveTest) -> Condition:
    """The class of a valve, learnt from a simulated population (drawn once, in some seconds)."""
    model = reference_classes()
    features = test.features[None, :]
    shares = model.probabilities(features)[0]
    return Condition(dict(zip(model.names, shares.tolist(), strict=True)), bool(model.is_unlike(features)[0]))


@cache
def reference_classes() -> GaussianClasses:
    """What a simulated population teaches about the classes."""
    tests, labels = simulated_tests(_LEARNT_FROM, _SEED)
    return learn(np.array([test.features for test in tests]), labels, CLASSES)


def simulated_tests(
    count: int, seed: int, instruments: Instruments | None = None
) -> tuple[tuple[ValveTest, ...], Labels]:
    """A population, every valve tested with noise; simulations run side by side."""
    valves, labels = population(count, seed)
    seeds = np.random.SeedSequence(seed).spawn(count)
    given = instruments or Instruments()
    reference = reference_steps()
    pairs = zip(valves, seeds, strict=True)
    return tuple(spread(lambda pair: tested(pair[0], np.random.default_rng(pair[1]), given, reference), pairs)), labels


def compared(tests: Sequence[ValveTest], labels: Labels) -> Comparison:
    """Both ways of classifying on the same tests, leaving out the valve that is judged."""
    shares = leave_one_out(np.array([test.features for test in tests]), labels, CLASSES)
    found = shares.argmax(axis=1)
    sure = shares.max(axis=1) >= 0.95
    by_error: dict[str, Accuracy] = {
        level: accuracy(
            leave_one_out_thresholds(np.array([t.error_psi[level] for t in tests]), labels, len(CLASSES)), labels
        )
        for level in CLASSIFIED_CURRENT_A
    }
    return Comparison(accuracy(found, labels), by_error, accuracy(found[sure], labels[sure]))


# -- one simulated test ------------------------------------------------------------------------------------


def tested(
    model: Model, rng: np.random.Generator, instruments: Instruments, reference: Mapping[str, Array]
) -> ValveTest:
    """The test of one simulated valve: sweeps at two speeds, steps, leakage."""
    command, places = _programme()
    output = simulate(model.definition, model.values, Drive(command[None, :], math.nan, 1.0 / _RATE_HZ),
                      model.active_effects)  # fmt: skip
    gain = (1.0 + instruments.gain * rng.normal()) * (1.0 + instruments.supply * rng.normal())
    pressure = (
        gain * output[0] + instruments.offset_psi * rng.normal() + instruments.noise_psi * rng.normal(size=len(command))
    )
    leakage = float(output[4, 0]) * (1.0 + instruments.leakage * rng.normal())
    return evaluated_test(
        [Sweep(command[at], pressure[at], 2.0 * _TOP_A / s) for at, s in zip(places["sweep"], _CYCLES_S, strict=True)],
        {level: np.array([pressure[at] for at in places[level]]) for level in CLASSIFIED_CURRENT_A},
        leakage, reference,
    )  # fmt: skip


def evaluated_test(
    sweeps: Sequence[Sweep], steps: Mapping[str, Array], leakage_ml_min: float, reference: Mapping[str, Array]
) -> ValveTest:
    """The numbers of one test.

    Args:
        sweeps: of the current at two speeds.
        steps: by level, pressure from the step of the current on at 1 kHz, shape (repeats, n).
        leakage_ml_min: at 220 psi.
        reference: by level, the step of a good valve, shape (m,).

    Raises:
        InputError: the pressure does not follow the current.
    """
    curve = pressure_curve("sweeps", sweeps)
    high = steps["high"].mean(axis=0)
    width = round(_SMOOTHED_S * _RATE_HZ)
    smooth = np.convolve(np.pad(high, width // 2, mode="edge"), np.full(width, 1.0 / width), "valid")
    if abs(smooth[-1] - smooth[0]) < 10.0:
        raise InputError("a step to 1.6 A changes the pressure by less than 10 psi: there is no rise time to judge")
    figures = step_figures(np.arange(len(smooth)) / _RATE_HZ, smooth, start=float(smooth[:5].mean()))
    errors = {}
    for level, runs in steps.items():
        samples = min(runs.shape[1], len(reference[level]))
        errors[level] = float(np.mean([rms_error(run[:samples], reference[level][:samples]) for run in runs]))
    return ValveTest(curve.hysteresis_a / 2.0, figures.rise_s, leakage_ml_min, errors)


@cache
def reference_steps() -> Mapping[str, Array]:
    """Steps of the good valve of the thesis to both currents, by level: what takes the place of its X_S."""
    model = valve("good")
    made: dict[str, Array] = {}
    for level, current in CLASSIFIED_CURRENT_A.items():
        command = np.concatenate((np.zeros(100), np.full(round(_HOLD_S * _RATE_HZ), current)))
        output = simulate(
            model.definition, model.values, Drive(command[None, :], math.nan, 1.0 / _RATE_HZ), model.active_effects
        )
        made[level] = output[0, 100:]
    return made


@cache
def _programme() -> tuple[Array, Mapping[str, tuple[slice, ...]]]:
    """The command of a test, and where its parts stand: sweeps, and steps from the step on, by level."""
    hold = round(_HOLD_S * _RATE_HZ)
    pieces, at = [np.zeros(500)], 500
    places: dict[str, list[slice]] = {name: [] for name in ("sweep", *CLASSIFIED_CURRENT_A)}
    for cycle_s in _CYCLES_S:
        sweep = triangle(0.0, _TOP_A, cycle_s, _RATE_HZ)
        places["sweep"].append(slice(at, at + len(sweep)))
        pieces.append(sweep)
        at += len(sweep)
    for level, current in CLASSIFIED_CURRENT_A.items():
        for _ in range(_REPEATS):
            pieces.append(np.concatenate((np.zeros(hold), np.full(hold, current))))
            places[level].append(slice(at + hold, at + 2 * hold))
            at += 2 * hold
    return np.concatenate(pieces), {name: tuple(found) for name, found in places.items()}
