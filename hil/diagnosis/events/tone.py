"""Tones: one frequency in all recordings, with a phase of its own in each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.diagnosis.events.event import Events
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted, rows_of
from hil.diagnosis.thresholds import TINY
from hil.identification.grey_box.lines import common_line, is_commanded
from hil.identification.preparation.experiment import Experiment
from hil.language.note import Note
from hil.record.recording import Array

_LEAST_TONE_RATIO, _FEWEST_TONE_CYCLES = 60.0, 4
_START_DIES_S = (0.1, 0.3, 1.0)


def tone(problem: Problem, model: Fitted) -> Events | None:
    """One frequency in all recordings, harmonics included, with a phase of its own in each; None if there is none.

    What the command itself drives, and its harmonics, is the unit's answer and no disturbance.

    Its amplitude may grow with the output, as ripple does that enters before the orifice; where it is hardly there
    without an output it is no disturbance but a gain that swings.
    """
    parts = problem.outputs_of(model.residuals)
    frequency = common_line(problem.experiments, parts, _LEAST_TONE_RATIO, _FEWEST_TONE_CYCLES)
    if frequency is None:
        return None
    frequency = _sharpened(problem, model.residuals, frequency)
    if is_commanded(problem.experiments, frequency):
        return None
    # slower still it takes more: a drift, no line
    if frequency * _shortest_s(problem) < _FEWEST_TONE_CYCLES - 0.5:
        return None
    residuals, waves = _tone_fit(problem, model.residuals, frequency)
    amplitudes = [float(np.hypot(a[0], a[3]) * n.std) for a, n in zip(waves, problem.noises, strict=True)]
    growing = [
        float(np.hypot(a[6], a[7]) * n.std * np.sqrt(np.mean(_level(e) ** 2)))
        for a, n, e in zip(waves, problem.noises, problem.experiments, strict=True)
    ]
    if np.mean(growing) > np.mean(amplitudes):
        return None
    unit = problem.model.output_unit
    size, spread = float(np.mean(amplitudes)), float(np.std(amplitudes) / np.sqrt(len(amplitudes)))
    longest = max(e.duration_s for e in problem.experiments)
    noise = problem.noises[0].std
    count = sum(len(e.output) for e in problem.experiments)
    std_hz = float(np.sqrt(6.0 / count) * noise / max(size, TINY) / (np.pi * longest))
    last = problem.plant.hooks[-1]
    return Events(
        "periodic_disturbance", last.stage, last.name, (),
        {"frequency": (frequency, std_hz, "Hz"), "amplitude": (size, spread, unit)},
        residuals, without_tone(problem, model, frequency),
        Note("A disturbance of {frequency_hz:.4g} Hz with amplitude {size:.3g} {unit} runs through everything, "
             "whatever the command does.", frequency_hz=frequency, size=size, unit=unit),
        "y = y₀ + a·sin(2πft + φ), φ by chance in each recording",
    )  # fmt: skip


def without_tone(problem: Problem, beside: Fitted, frequency_hz: float) -> tuple[Experiment, ...]:
    """The experiments with a tone taken out of all that is recorded, as it shows beside a model."""
    inner = [signal.name for signal in problem.plant.observed]
    kept = []
    for e in problem.experiments:
        waves, (output, *signals) = _waves(e, frequency_hz), rows_of(problem, beside, e)
        simulated = dict(zip(inner, signals, strict=True))
        observed = {name: _without(measured, simulated[name], waves) for name, measured in e.observed.items()}
        kept.append(replace(e, output=_without(e.output, output, waves), observed=observed))
    return tuple(kept)


def _without(measured: Array, simulated: Array, waves: Array) -> Array:
    """What was measured without the waves in what the simulation leaves of it."""
    share = np.linalg.lstsq(waves, measured - simulated, rcond=None)[0]
    return measured - waves @ share


def _sharpened(problem: Problem, residuals: Array, frequency_hz: float) -> float:
    """The frequency at which a tone takes most, on grids that become finer."""
    width = 1.0 / _shortest_s(problem)
    best = frequency_hz
    for scale in (2.0, 0.2, 0.02):
        grid = best + width * scale * np.linspace(-1.0, 1.0, 41)
        left = [float(np.sum(_tone_fit(problem, residuals, f)[0] ** 2)) for f in grid]
        best = float(grid[int(np.argmin(left))])
    return best


def _shortest_s(problem: Problem) -> float:
    return min(e.duration_s for e in problem.experiments)


def _tone_fit(problem: Problem, residuals: Array, frequency_hz: float) -> tuple[Array, list[Array]]:
    """Residuals without the tone, and how much there is of each wave in each recording's output.

    A tone that enters early runs through recorded inner signals too.
    """
    left, found = residuals.copy(), []
    for e, parts in zip(problem.experiments, problem.channel_slices(), strict=True):
        columns = _waves(e, frequency_hz)
        products = columns.T @ columns  # a tone is tried at more than a hundred frequencies
        shares = [
            np.asarray(np.linalg.lstsq(products, columns.T @ left[part], rcond=None)[0], dtype=np.float64)
            for part in parts
        ]
        for part, share in zip(parts, shares, strict=True):
            left[part] -= columns @ share
        found.append(shares[0])
    return left, found


def _waves(e: Experiment, frequency_hz: float) -> Array:
    """Three harmonics, sines before cosines, the first one growing with the output, and what dies out after the start
    when a tone that enters early in the chain meets a plant at rest, shape (n, 11).
    """
    phase = 2.0 * np.pi * frequency_hz * np.outer((1.0, 2.0, 3.0), e.time_s)
    waves = np.vstack([np.sin(phase), np.cos(phase)])
    decays = np.exp(-np.outer(1.0 / np.array(_START_DIES_S), e.time_s - e.time_s[0]))
    return np.vstack([waves, waves[[0, 3]] * _level(e), decays]).T


def _level(e: Experiment) -> Array:
    """The output as a share of its largest magnitude."""
    return e.output / max(float(np.abs(e.output).max()), TINY)
