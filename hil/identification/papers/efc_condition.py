"""Condition of an EFC valve: good, malfunctioned or severely malfunctioned, from physics that its test measures.

Friction comes from the loop of the pressure curve, rise time from steps to 1.6 A, leakage from the flow through the
closed valve, the −3 dB frequency from sines at the medium level; a model of the classes is learnt from a simulated
population, and what is usual among its good valves is the reference that rise and −3 dB are held against.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import hil.identification
import hil.physics
import hil.signals
from hil.cache import cached_arrays, stamp
from hil.cores import parallel_map
from hil.errors import InputError
from hil.identification.frequency.bandwidth import Crossing, magnitude_crossing
from hil.identification.frequency.frequency_response import from_polar
from hil.identification.frequency.sine_test import sine_test
from hil.identification.papers.classification import GaussianClasses, learn
from hil.identification.steady.pressure_curve import PressureCurve, pressure_curve
from hil.identification.steady.sweep_estimate import Sweep
from hil.identification.step.step_response import step_figures
from hil.language.words import marked
from hil.physics.model import Model
from hil.physics.published.efc_population import population, valve
from hil.physics.published.tugsal import CLASSES, CLASSIFIED_CURRENT_A, SWEEPS_PSI
from hil.physics.simulate import Drive, simulate
from hil.record.recording import Array, Integers
from hil.signals.interval import UNIFORM
from hil.signals.products import one_blas_thread
from hil.signals.ramps import triangle

FEATURES = (marked("friction"), marked("rise"), marked("leakage"), marked("bandwidth"))
FREQUENCIES_HZ = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)

_FEW_DRAWS = 2  # the scatter of a population tells what the uncertainty of one curve would
BEYOND = 0.025  # share of good valves that lie beyond a limit of the good reference


@dataclass(frozen=True, slots=True)
class Programme:
    """What the test of a valve drives, and how finely it is read.

    Attributes:
        rate_hz: of the samples. `cycles_s`, `top_a`: of the sweeps from no current and back.
        hold_s, repeats: of the steps. `smoothed_s`: over which a step is averaged before its rise is read.
        sine_s, sine_periods: that are measured at each frequency, at least.
        least_friction_a: what a test can tell from none.
    """

    rate_hz: float = 1000.0
    cycles_s: tuple[float, ...] = (10.0, 20.0)
    top_a: float = 2.0
    hold_s: float = 1.0
    repeats: int = 3
    smoothed_s: float = 0.009
    sine_s: float = 2.0
    sine_periods: int = 3
    least_friction_a: float = 2e-4

    @property
    def time_std_s(self) -> float:
        """Standard uncertainty of a time between two samples, of which both ends lie anywhere."""
        return UNIFORM * math.sqrt(2.0) / self.rate_hz


PROGRAMME = Programme()


@dataclass(frozen=True, slots=True)
class ValveTest:
    """What one valve's test gave.

    Attributes:
        friction_a: half the width of the loop that no speed explains. `friction_std_a`: of the noise.
        rise_s: 10 % to 90 % of a step from no current to 1.6 A, mean of the repeats. `rise_std_s`: of that mean.
        leakage_ml_min: through the closed valve at 220 psi.
        bandwidth_hz: −3 dB at the medium level, the top frequency where it was not reached. `bandwidth_std_hz`.
    """

    friction_a: float
    rise_s: float
    leakage_ml_min: float
    bandwidth_hz: float
    rise_std_s: float = 0.0
    bandwidth_std_hz: float = 0.0
    friction_std_a: float = 0.0

    @property
    def features(self) -> Array:
        """Logarithms of the four physical numbers."""
        friction_a = max(self.friction_a, PROGRAMME.least_friction_a)
        return np.log([friction_a, self.rise_s, max(self.leakage_ml_min, 1.0), self.bandwidth_hz])


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
        probabilities: by class, if the valve is of one of them.
        usual: by class, the share of its valves that lie farther from its middle than this one.
        distances: by class, to its middle in standard deviations.
        unlike: the valve is unlike every class; then the probabilities say little.
    """

    probabilities: Mapping[str, float]
    usual: Mapping[str, float]
    distances: Mapping[str, float]
    unlike: bool

    @property
    def verdict(self) -> str:
        """The most probable class."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])


@dataclass(frozen=True, slots=True)
class GoodRange:
    """Of one feature: the median of good valves, and the ends that a share `BEYOND` of them lies beyond; A, s, ml/min,
    Hz.
    """

    low: float
    middle: float
    high: float


@dataclass(frozen=True, slots=True)
class GoodRanges:
    """What is usual among good valves, by feature, and from how many it was learnt."""

    by_feature: Mapping[str, GoodRange]
    count: int


def condition(
    test: ValveTest, frequencies_hz: tuple[float, ...] = FREQUENCIES_HZ, normally_open: bool = False
) -> Condition:
    """The class of a valve, learnt from a simulated population of its type that was tested at the same frequencies.

    It is drawn once on a machine, in some seconds.
    """
    model = reference_classes(frequencies_hz, normally_open)
    features = test.features[None, :]

    def by_class(values: Array) -> dict[str, float]:
        return dict(zip(model.names, values[0].tolist(), strict=True))

    return Condition(
        by_class(model.probabilities(features)), by_class(model.usual(features)),
        by_class(np.sqrt(model.distances(features))), bool(model.is_unlike(features)[0]),
    )  # fmt: skip


def good_ranges(frequencies_hz: tuple[float, ...] = FREQUENCIES_HZ, normally_open: bool = False) -> GoodRanges:
    """Every feature of good valves, logarithms taken as normal; the ends know how many they were learnt from."""
    from scipy.special import stdtrit

    model = reference_classes(frequencies_hz, normally_open)
    good = model.names.index("good")
    count = int(model.counts[good])
    reach = float(-stdtrit(count - 1, BEYOND)) * math.sqrt(1.0 + 1.0 / count)
    means, widths = model.means[good], reach * np.sqrt(np.diag(model.covariances[good]))
    found = zip(FEATURES, np.exp(means - widths).tolist(), np.exp(means).tolist(), np.exp(means + widths).tolist(),
                strict=True)  # fmt: skip
    return GoodRanges({name: GoodRange(*ends) for name, *ends in found}, count)


@cache
def reference_classes(
    frequencies_hz: tuple[float, ...] = FREQUENCIES_HZ, normally_open: bool = False
) -> GaussianClasses:
    """What a simulated population teaches about the classes; kept on this machine, for it takes some seconds."""
    asked = f"{stamp(_sources(), ('numpy', 'scipy', 'numba'))}_{frequencies_hz}_{normally_open}"

    def learnt() -> Mapping[str, Array]:
        tests, labels = simulated_tests(frequencies_hz=frequencies_hz, normally_open=normally_open)
        return {"features": np.array([test.features for test in tests]), "labels": labels.astype(np.float64)}

    found = cached_arrays("efc-classes", hashlib.sha256(asked.encode()).hexdigest()[:16], learnt)
    return learn(found["features"], found["labels"].astype(np.int64), CLASSES)


@cache
def _sources() -> tuple[Path, ...]:
    """The files that a simulated test depends on: equations, laws, and how a test is evaluated."""
    rooms = (hil.physics, hil.identification, hil.signals)
    return tuple(file for room in rooms for file in Path(room.__path__[0]).rglob("*.py"))


def simulated_tests(
    count: int = 300,
    seed: int = 1979,
    frequencies_hz: tuple[float, ...] = FREQUENCIES_HZ,
    normally_open: bool = False,
) -> tuple[tuple[ValveTest, ...], Integers]:
    """A population, every valve tested with noise; simulations run side by side."""
    valves, labels = population(count, seed, normally_open)
    seeds = np.random.SeedSequence(seed).spawn(count)
    pairs = zip(valves, seeds, strict=True)

    def one(pair: tuple[Model, np.random.SeedSequence]) -> ValveTest:
        return tested(pair[0], np.random.default_rng(pair[1]), Instruments(), frequencies_hz)

    with one_blas_thread():
        return tuple(parallel_map(one, pairs)), labels


# -- one simulated test ------------------------------------------------------------------------------------


def tested(
    model: Model,
    rng: np.random.Generator,
    instruments: Instruments,
    frequencies_hz: tuple[float, ...],
) -> ValveTest:
    """The test of one simulated valve: sweeps at two speeds, steps, leakage, sines at the medium level."""
    command, places = _programme()
    output = _answer(model, command)
    gain = (1.0 + instruments.gain * rng.normal()) * (1.0 + instruments.supply * rng.normal())
    pressure = (
        gain * output[0] + instruments.offset_psi * rng.normal() + instruments.noise_psi * rng.normal(size=len(command))
    )
    leakage = float(output[4].min()) * (1.0 + instruments.leakage * rng.normal())
    sweeps = [Sweep(command[at], pressure[at], 2.0 * PROGRAMME.top_a / s)
              for at, s in zip(places["sweep"], PROGRAMME.cycles_s, strict=True)]  # fmt: skip
    curve = pressure_curve("sweeps", sweeps, draws=_FEW_DRAWS)
    least, most = sorted((float(curve.nominal[0]), float(curve.nominal[-1])))  # a slow valve falls short of a pressure
    sweep_a = tuple(curve.current_at(min(max(psi, least), most)) for psi in SWEEPS_PSI["medium"])
    bandwidth_hz = _bandwidth_hz(model, sweep_a, frequencies_hz, rng, instruments.noise_psi)
    return evaluated_test(curve, [pressure[at] for at in places["high"]], leakage, (bandwidth_hz, 0.0))


def _answer(model: Model, command: Array) -> Array:
    drive = Drive(command[None, :], math.nan, 1.0 / PROGRAMME.rate_hz)
    return simulate(model.definition, model.values, drive, model.active_effects)


def _bandwidth_hz(
    model: Model,
    sweep_a: tuple[float, ...],
    frequencies_hz: tuple[float, ...],
    rng: np.random.Generator,
    noise_psi: float,
) -> float:
    """−3 dB of a simulated valve between two currents, the sensor's lag taken out as on the bench."""
    low, high = sorted(sweep_a)
    test = sine_test(frequencies_hz, (high - low) / 2.0, (low + high) / 2.0)
    h = test.response(model.definition, model.values | {"sensor_lag": 0.0}, model.active_effects)
    samples = PROGRAMME.rate_hz * np.maximum(PROGRAMME.sine_s, PROGRAMME.sine_periods / test.frequency_hz)
    stds = noise_psi * np.sqrt(2.0 / samples) / test.amplitude
    h = h + stds * (rng.normal(size=len(h)) + 1j * rng.normal(size=len(h)))
    return bandwidth_of(magnitude_crossing(from_polar("sines", test.frequency_hz, h), -3.0))


def bandwidth_of(crossing: Crossing) -> float:
    """The frequency of a crossing, the top frequency where the response does not get there."""
    at = crossing.frequency_hz if crossing.below_hz is None else crossing.below_hz
    return crossing.beyond_hz if at is None else at


def evaluated_test(
    curve: PressureCurve, steps: Iterable[Array], leakage_ml_min: float, bandwidth: tuple[float, float]
) -> ValveTest:
    """The numbers of one test.

    Args:
        curve: of sweeps of the current at two speeds.
        steps: pressure from each step to 1.6 A on, at 1 kHz, shape (n,) each.
        leakage_ml_min: at 220 psi.
        bandwidth: −3 dB at the medium level and its standard uncertainty, in Hz.

    Raises:
        InputError: the pressure does not follow the current.
    """
    rises = np.array(list(map(_rise_s, steps)))
    rise_std_s = max(float(rises.std(ddof=1)) if len(rises) > 1 else 0.0, PROGRAMME.time_std_s) / math.sqrt(len(rises))
    return ValveTest(
        curve.estimate.mean_width / 2.0,
        float(rises.mean()),
        leakage_ml_min,
        bandwidth[0],
        rise_std_s,
        bandwidth[1],
        float(np.std(curve.estimate.mean_widths)) / 2.0,
    )


def _rise_s(pressure: Array) -> float:
    """10 % to 90 % of one step.

    Raises:
        InputError: the pressure hardly moves.
    """
    width = round(PROGRAMME.smoothed_s * PROGRAMME.rate_hz)
    smooth = np.convolve(np.pad(pressure, width // 2, mode="edge"), np.full(width, 1.0 / width), "valid")
    if abs(smooth[-1] - smooth[0]) < 10.0:
        raise InputError("a step to 1.6 A changes the pressure by less than 10 psi: there is no rise time to judge")
    return step_figures(np.arange(len(smooth)) / PROGRAMME.rate_hz, smooth, start=float(smooth[:5].mean())).rise_s


@cache
def reference_steps() -> Mapping[str, Array]:
    """Steps of the good valve of the thesis to both currents, by level: what takes the place of its X_S."""
    model = valve("good")
    made: dict[str, Array] = {}
    for level, current in CLASSIFIED_CURRENT_A.items():
        command = np.concatenate((np.zeros(100), np.full(round(PROGRAMME.hold_s * PROGRAMME.rate_hz), current)))
        made[level] = _answer(model, command)[0, 100:]
    return made


@cache
def _programme() -> tuple[Array, Mapping[str, tuple[slice, ...]]]:
    """The command of a test, and where its parts stand: sweeps, and steps from the step on, by level."""
    hold = round(PROGRAMME.hold_s * PROGRAMME.rate_hz)
    pieces, at = [np.zeros(500)], 500
    places: dict[str, list[slice]] = {name: [] for name in ("sweep", *CLASSIFIED_CURRENT_A)}
    for cycle_s in PROGRAMME.cycles_s:
        sweep = triangle(0.0, PROGRAMME.top_a, cycle_s, PROGRAMME.rate_hz)
        places["sweep"].append(slice(at, at + len(sweep)))
        pieces.append(sweep)
        at += len(sweep)
    for level, current in CLASSIFIED_CURRENT_A.items():
        for _ in range(PROGRAMME.repeats):
            pieces.append(np.concatenate((np.zeros(hold), np.full(hold, current))))
            places[level].append(slice(at + hold, at + 2 * hold))
            at += 2 * hold
    return np.concatenate(pieces), {name: tuple(found) for name, found in places.items()}
