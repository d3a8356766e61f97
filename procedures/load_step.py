"""Load step: the load orifice steps while the command stands; how far flow and spool go, and when they stay.

Needs an output with the role `load orifice`. The step of a channel `load pressure` is measured, and the answer of a
channel `spool position`, where the bench reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

from hil.errors import SettingError
from hil.identification.step.criteria import CRITERIA
from hil.identification.step.step_estimate import step_smoother
from hil.identification.uncertainty.parametric_bootstrap import DRAWS, about, draws_of
from hil.record.measurement import Findings, Measured, Measurement
from hil.record.recording import Array, Channel, Recording
from hil.rig import Rig
from hil.signals.autoregression import coloured_noise, whitener_of
from hil.signals.crossing import crossing
from hil.signals.interval import CERTAIN, UNIFORM
from hil.signals.products import one_blas_thread
from procedures._characteristic import steady
from procedures._conditions import LOAD, adjusting, adjusting_s, check_within, usual
from procedures._definitions import LOAD_STEPS, defined
from procedures._pressure_drop import LOAD_PRESSURE
from procedures._recorded import calibration_share, departures, parts_of, roles_of
from procedures._run_sequence import RunSequence, joined
from procedures._scale import check_stands, scale_of
from procedures._settings import NotNegative, Percent, Positive, Twice
from procedures._statistics import extreme
from procedures._supplies import by_command

STEP = Measurement("load_step", "", "change of the load pressure by the step")
DEVIATION = Measurement("load_deviation", "", "largest departure of the response from its value before the step")
SETTLING = Measurement("load_settling", "ms", "after which the response stays within the band about its final value")
SPOOL = Measurement("spool_deviation", "", "largest departure of the spool from its position before the step")
SPOOL_SETTLING = Measurement("spool_settling", "ms", "after which the spool stays within the band")
MEASUREMENTS = defined(LOAD_STEPS, STEP, DEVIATION, SETTLING, SPOOL, SPOOL_SETTLING)
SPOOL_POSITION = "spool position"
KIND = "load step"
_NEEDING = "a load step"
_HOLD_SETTLINGS = 2.0


def run(
    rig: Rig,
    *,
    commands: tuple[Percent, ...] | None = None,
    load: NotNegative | None = None,
    band: Annotated[float, Interval(gt=0.0, lt=50.0), Unit("%")] = 5.0,  # noqa: ARG001 — for the evaluation
    hold_s: Positive | None = None,
    repeats: Twice = 5,
    warm_up_s: NotNegative = 0.0,
    full_command: Positive | None = None,
    rate_hz: Positive | None = None,
) -> None:
    """Step the load there and back at each command.

    Args:
        rig: the bench.
        commands: in % of full command from neutral; halfway to the ends of its range when not given.
        load: where the load orifice steps to, in its unit; the lower end of its range, ports A and B blocked, when not
            given.
        band: about the final response within which it counts as settled, in % of the largest departure.
        hold_s: time before and after each step, in s; twice the settling time of the valve when not given.
        repeats: how often the load steps at each command.
        warm_up_s: time at the first command before anything is measured, in s.
        full_command: what 100 % is, in the unit of the command; the farther end of its range when not given.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    orifice = adjusting(rig, LOAD, _NEEDING)
    if orifice.name in rig.promises["delay_s"]:
        raise SettingError(f"{_NEEDING} needs an output that steps the load; '{orifice.name}' is set by hand")
    scale = scale_of(rig, full_command)
    check_stands(scale, _NEEDING)
    there, back = orifice.low if load is None else load, usual(orifice)
    check_within(orifice, "load", [there])
    if there == back:
        raise SettingError(f"setting load: {there:g} {orifice.unit} is where '{orifice.name}' stands already")
    levels = scale.levels("commands", commands, 0.5)
    held = max(2, round((hold_s or _HOLD_SETTLINGS * rig.settling_s) * rate_hz))
    pieces = [np.full((2 * repeats + 1) * held, level) for level in levels]
    steps = [{LOAD: there}] * (repeats * len(levels))
    sequence = RunSequence(rig, rate_hz, joined(rig, rate_hz, warm_up_s, pieces), {"commands": levels, "load": there},
                    adjusting_s(rig, steps))  # fmt: skip
    sequence.warm_up(levels[0], warm_up_s)
    for level in levels:
        sequence.go_to(level)
        rig.hold(held / rate_hz, rate_hz)
        for start, end in ((back, there), (there, back)) * repeats:
            label = f"{scale.label(level)}, load {start:.4g} → {end:.4g} {orifice.unit}"
            sequence.say(label)
            stepped = rig.adjust({LOAD: end}, rate_hz)
            after = rig.hold(held / rate_hz, rate_hz)
            rig.mark(held + len(stepped) + len(after), {"kind": KIND, "label": label, "held": held})
    sequence.finish()


def evaluate(recording: Recording) -> Findings:
    """Largest departure and settling time of the response and the spool at each step, from the mean of the repeats."""
    _, response = roles_of(recording)
    band = float(recording.meta["settings"]["band"]) / 100.0
    measured: list[Measured] = []
    curves: list[dict[str, Any]] = []
    for label, parts in by_command(parts_of(recording, KIND)).items():
        if LOAD_PRESSURE in recording.channels:
            measured.append(_step(recording, label, parts))
        found = _answer(recording, parts, response, band)
        departure, settled = found.figures(label, DEVIATION, SETTLING, response)
        measured += [departure, settled]
        curves.append({
            "label": label, "response_unit": response.unit, "time_s": found.time_s,
            "measured": found.start + found.mean, "fitted": found.start + found.curve,
            "before": found.start, "final": found.start + float(_final(found.curve)),
            "settled_s": None if settled.value is None else 1e-3 * settled.value,
        })  # fmt: skip
        if SPOOL_POSITION in recording.channels and response.name != SPOOL_POSITION:
            spool = recording.channel(SPOOL_POSITION)
            measured += _answer(recording, parts, spool, band).figures(label, SPOOL, SPOOL_SETTLING, spool)
    return Findings(tuple(measured), {"load_step": curves}, deviations=departures(recording))


def _step(recording: Recording, label: str, parts: Sequence[Mapping[str, Any]]) -> Measured:
    """Of the load pressure: what it is at the end, less what it was before."""
    pressure = recording.channel(LOAD_PRESSURE)
    before, after = (_levels(recording, parts, pressure, end) for end in (False, True))
    change = after[0] - before[0]
    return STEP.at(label, pressure.unit).of(
        change, math.hypot(before[1], after[1]), calibration=calibration_share(pressure) * abs(change)
    )


def _levels(
    recording: Recording, parts: Sequence[Mapping[str, Any]], channel: Channel, after: bool
) -> tuple[float, float]:
    """Mean over the repeats of what stands before the step or at its end, and its standard uncertainty."""
    read = []
    for part in parts:
        count = int(part["held"])
        first = part["first"] + (part["count"] - count if after else 0)
        read.append(steady(recording, {"first": first, "count": count}, channel))
    values, stds = np.array(read).T
    return float(values.mean()), float(np.hypot.reduce(stds)) / len(values)


@dataclass(frozen=True, slots=True)
class _Answer:
    """What a channel does after the step, less what it stood at before.

    Attributes:
        time_s: since the step, shape (n,). `start`: the value before. `mean`: over the repeats, shape (n,).
        curve: smooth through it, shape (n,); `loose`: one less stiff, which rounds no corner.
        again: curves of recordings drawn again, shape (m, n); `made`: of noise alone.
        band: share of the largest departure within which it counts as settled.
    """

    time_s: Array
    start: float
    mean: Array
    curve: Array
    loose: Array
    again: Array
    made: Array
    band: float

    def figures(
        self, label: str, deviation: Measurement, settling: Measurement, channel: Channel
    ) -> tuple[Measured, Measured]:
        """Largest departure, and the settling time where there is a departure for sure."""
        by_noise = float(np.sqrt(np.mean(np.abs(self.made).max(axis=1) ** 2)))
        size, std = self._largest(by_noise)
        largest = extreme(
            deviation.at(label, channel.unit), size, std, calibration=calibration_share(channel) * size,
            made_by_noise=by_noise,
        )  # fmt: skip
        time_s, loose_s = self._settled_s(self.curve), self._settled_s(self.loose)
        noise_s = about(np.array([self._settled_s(curve) for curve in self.again]), time_s)
        between_s = _between(partial(self._settled_s, self.curve), time_s)
        std_s = math.hypot(noise_s, loose_s - time_s, between_s)
        what = settling.at(label)
        known = largest.relation == "=" and math.isfinite(std_s)
        return largest, what.size(1e3 * time_s, 1e3 * std_s) if known else what.of(None)

    def _largest(self, by_noise: float) -> tuple[float, float]:
        """Largest size. Where noise alone could make a peak beyond the final one, it may hide one: anywhere between.

        Source: JCGM 100:2008 (GUM), 4.3.7.
        """
        size, sizes = float(np.abs(self.curve).max()), np.abs(self.again).max(axis=1)
        std = math.hypot(about(sizes, size), _between(lambda seen: np.abs(self.curve[seen]).max(), size))
        end = abs(float(_final(self.curve)))
        if size - end > CERTAIN * by_noise or end < CERTAIN * by_noise:
            return size, std
        most = size + by_noise
        return 0.5 * (end + most), math.hypot(std, UNIFORM * (most - end))

    def _settled_s(self, curve: Array, seen: slice = slice(None)) -> float:
        """Since when it stays within the band, by the samples that are seen; infinite where it does not."""
        time_s, away = self.time_s[seen], np.abs(curve - _final(curve))[seen]
        limit = self.band * float(np.abs(curve).max())
        outside = np.flatnonzero(away > limit)
        if len(outside) == 0:
            return float(time_s[0])
        last = int(outside[-1])
        return math.inf if last + 1 == len(away) else crossing(time_s, away, limit, last, last + 1)


def _between(figure: Callable[[slice], float], value: float) -> float:
    """What every second sample tells otherwise: as much may lie hidden between samples."""
    return max(abs(float(figure(slice(first, None, 2))) - value) for first in (0, 1))


def _final(curves: Array) -> Array:
    """Mean of the end of each curve, shape (…, n)."""
    return np.asarray(curves[..., -max(1, round(CRITERIA.tail_share * curves.shape[-1])) :].mean(axis=-1))


def _answer(recording: Recording, parts: Sequence[Mapping[str, Any]], channel: Channel, band: float) -> _Answer:
    start, start_std = _levels(recording, parts, channel, after=False)
    stamps_s = recording.stamps(channel.name)
    before, after = [], []
    for part in parts:
        first, stop = part["first"] + part["held"], part["first"] + part["count"]
        before.append(channel.values[part["first"] : first])
        after.append((stamps_s[first:stop] - recording.time_s[first], channel.values[first:stop]))
    time_s = after[0][0]
    mean = np.mean([np.interp(time_s, *one) for one in after], axis=0) - start  # a host may pause between blocks
    whitener = whitener_of(np.mean(before, axis=0))
    with one_blas_thread():
        smoother = step_smoother(time_s, whitener)
        found, looser = smoother.curves_each(mean, (1.0, CRITERIA.looser))
        (curve,), (loose,) = smoother.at(found), smoother.at(looser)
        rng = draws_of(mean)
        noise = float(found.noise_std[0]) * coloured_noise(rng, (DRAWS, len(mean)), whitener)
        noise += start_std * rng.normal(size=(DRAWS, 1))
        again, made = (smoother.at(smoother.curves(base + noise)) for base in (curve, np.zeros(len(curve))))
    return _Answer(time_s, start, mean, curve, loose, again, made, band)
