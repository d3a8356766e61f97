"""Gain and time constant from a recording of one sine: all that one frequency determines, whatever the plant is.

K/(1 + T·s), or K/(s·(1 + T·s)) where the plant integrates, as a free run and exact for a command that is held between
samples. Before its first sample the command is taken to have stood where it begins. Plants of higher order and with
dead time are those of the plant `transfer-function`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.errors import InputError
from hil.identification.grey_box.estimate import Unknown, estimate
from hil.identification.uncertainty.fit import fit_percent
from hil.language.note import Note
from hil.physics.transfer_function import TransferFunction, transfer_function
from hil.record.recording import Array, Recording
from hil.signals.interval import COVERED
from hil.signals.recursion import filtered

_LEAST = 50  # samples that are judged


@dataclass(frozen=True, slots=True)
class FirstOrderFit:
    """Gain, per second of a plant that integrates, and time constant, with standard uncertainties.

    `fit_percent`: of a free run to the same data. `drift_per_s`: of the output of a plant that `integrates`.
    """

    integrates: bool

    gain: float
    gain_std: float
    time_s: float
    time_std_s: float
    drift_per_s: float
    fit_percent: float

    @property
    def model(self) -> TransferFunction:
        """The same as a transfer function."""
        return transfer_function([self.gain], [self.time_s, 1.0, 0.0] if self.integrates else [self.time_s, 1.0])

    def note(self, command_unit: str, response_unit: str) -> Note:
        """Gain and time with their uncertainties, in one line."""
        return Note(
            "{form}, gain {gain:.4g} ± {gain_u:.1g} {unit}, time {time_ms:.4g} ± {time_u_ms:.2g} ms, fit {fit:.2f} % "
            "of the same data.",
            form="P1I" if self.integrates else "P1", gain=self.gain, gain_u=COVERED * self.gain_std,
            unit=f"{response_unit}{'/s' if self.integrates else ''} per {command_unit}",
            time_ms=1e3 * self.time_s, time_u_ms=1e3 * COVERED * self.time_std_s, fit=self.fit_percent,
        )  # fmt: skip


def first_order(
    recording: Recording, input_name: str, output_name: str, *, integrates: bool, skip_s: float = 0.0
) -> FirstOrderFit:
    """Fit gain, time constant and level, and the drift of a plant that integrates.

    Args:
        recording: evenly sampled.
        input_name: channel of the command.
        output_name: channel of the response.
        integrates: whether the response goes on while the command stands.
        skip_s: at the beginning, simulated but not judged: what the state before the record has left.

    Raises:
        InputError: too few samples, or a command or a response that stands still.
    """
    command, interval_s = recording.values(input_name), recording.interval_s
    # on the stamps of the command, along straight lines where each sample was read at a time of its own
    output = np.interp(recording.time_s, recording.stamps(output_name), recording.values(output_name))
    elapsed_s = recording.time_s - recording.time_s[0]
    judged = elapsed_s >= skip_s
    if np.count_nonzero(judged) < _LEAST:
        raise InputError(
            f"{recording.name}: {np.count_nonzero(judged)} samples after {skip_s:g} s; a first-order model needs at "
            f"least {_LEAST}"
        )
    for name, values in ((input_name, command), (output_name, output)):
        if np.ptp(values[judged]) == 0.0:
            raise InputError(f"{recording.name}: '{name}' stands still; nothing can be identified")
    given = command - command[0]
    integral = interval_s * np.concatenate(([0.0], np.cumsum(given)[:-1]))

    def columns(log_time: float) -> Array:
        kept = math.exp(-interval_s / math.exp(log_time))
        lagged = filtered([0.0, 1.0 - kept], [1.0, -kept], given)
        level = np.ones(len(given))
        if not integrates:
            return np.column_stack((lagged, level))
        return np.column_stack((integral - math.exp(log_time) * lagged, level, elapsed_s))

    def start(log_time: float) -> tuple[float, list[float]]:
        rows = columns(log_time)[judged]
        linear, *_ = np.linalg.lstsq(rows, output[judged], rcond=None)
        return float(np.sum((rows @ linear - output[judged]) ** 2)), [*linear.tolist(), log_time]

    def residuals(values: Array) -> Array:
        return np.where(judged, output - columns(float(values[-1])) @ values[:-1], 0.0)

    trials = np.log(np.geomspace(2.0 * interval_s, elapsed_s[-1] / 5.0, 12)).tolist()
    *linear, log_time = min(map(start, trials))[1]
    scales = np.std(output) / np.sqrt(np.mean(columns(log_time) ** 2, axis=0))
    names = ("gain", "level", "drift")[: len(linear)]
    unknowns = [
        Unknown(name, "", value, -math.inf, math.inf, scale)
        for name, value, scale in zip(names, linear, scales.tolist(), strict=True)
    ]
    low, high = math.log(interval_s / 20.0), math.log(20.0 * elapsed_s[-1])
    found = estimate(residuals, [*unknowns, Unknown("log time", "", log_time, low, high, 1.0)], tolerance=1e-8)
    best = columns(float(found.values[-1])) @ found.values[:-1]
    time_s = math.exp(found.values[-1])
    return FirstOrderFit(
        integrates, float(found.values[0]), float(found.std[0]), time_s, time_s * float(found.std[-1]),
        found.named.get("drift", 0.0), fit_percent(output[judged], best[judged]),
    )  # fmt: skip
