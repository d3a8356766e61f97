"""What the report draws: recordings beside simulations, and the spectra of what is left."""

from __future__ import annotations

import numpy as np

from hil.diagnosis.diagnosis import Spectrum, Strip
from hil.diagnosis.intake.problem import Problem
from hil.diagnosis.search.fitted import Fitted, output_of
from hil.identification.preparation.experiment import Experiment
from hil.record.recording import Array
from hil.signals.runs import runs

_FEWEST = 10
_LINE = 0.05
_MOST_LINES = 3
_HARMONICS = 9


def strips(problem: Problem, used: Fitted) -> tuple[Strip, ...]:
    """Every recording with the nominal and the corrected simulation."""
    found = []
    effects = list(problem.model.active_effects)
    for e, noise in zip(problem.experiments, problem.noises, strict=True):
        nominal = e.respond(problem.plant, problem.model.values, effects, factor=problem.factor)[0]
        corrected = output_of(problem, used, e)
        found.append(Strip(e.name, e.time_s, e.on_grid_input(), _shown(e), nominal, corrected, noise.std))
    return tuple(found)


def _shown(e: Experiment) -> Array:
    """The output without the stretches that are left out, for what is drawn through a gap was not recorded."""
    shown = e.output.copy()
    for start, stop in runs(~e.valid):
        if stop - start >= _FEWEST:
            shown[start:stop] = np.nan
    return shown


def spectra(problem: Problem, nominal: Fitted, used: Fitted) -> tuple[Spectrum, ...]:
    """Amplitude spectra of the residuals, with the harmonics of the command where it has few lines."""
    found = []
    parts = zip(problem.experiments, problem.noises, problem.output_slices(), strict=True)
    for i, (e, noise, part) in enumerate(parts):
        step_s = e.interval_s
        frequency, before = _amplitudes(problem.errors(i, nominal.residuals[part]), step_s)
        _, after = _amplitudes(problem.errors(i, used.residuals[part]), step_s)
        lines = _lines(e, step_s)
        limit = float(frequency[-1])
        odd = tuple(k * f for f in lines for k in range(3, _HARMONICS + 1, 2) if k * f < limit)
        even = tuple(k * f for f in lines for k in range(2, _HARMONICS + 1, 2) if k * f < limit)
        floor = 2.0 * noise.std * float(np.sqrt(1.5 / len(e.output)))
        found.append(Spectrum(e.name, frequency, before, after, floor, lines, odd, even))
    return tuple(found)


def _amplitudes(values: Array, step_s: float) -> tuple[Array, Array]:
    """(frequencies, amplitudes) with a window of Hann; a sine shows with its amplitude."""
    window = np.hanning(len(values))
    spectrum = 2.0 * np.abs(np.fft.rfft(values * window)) / window.sum()
    frequency = np.fft.rfftfreq(len(values), step_s).astype(np.float64)
    return frequency[1:], spectrum[1:]


def _lines(e: Experiment, step_s: float) -> tuple[float, ...]:
    """Frequencies of a command that consists of few sines; none for any other command."""
    command = e.on_grid_input()
    frequency, size = _amplitudes(command - command.mean(), step_s)
    inner = size[1:-1]
    peaks = 1 + np.flatnonzero((inner > size[:-2]) & (inner > size[2:]) & (inner >= _LINE * size.max()))
    if not 1 <= len(peaks) <= _MOST_LINES:
        return ()
    return tuple(float(frequency[k]) for k in peaks)
