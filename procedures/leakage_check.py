"""Leakage check of an EFC: flow through the closed valve at 220 psi, which must be 35…125 ml/min.

Some leakage is wanted: it cools, lubricates and cleans. The flow through a clearance is proportional to the pressure
across it, so it is stated at 220 psi whatever the supply gave; limits are those of the EFC thesis, section 3.1.2.3.
"""

from __future__ import annotations

import math

from hil.language.note import Note
from hil.language.words import marked
from hil.record.measurement import Findings, Measurement
from hil.record.recording import Channel, Recording
from hil.rig import Rig
from hil.signals.colour import noisy_mean
from hil.signals.rounding import mean_rounding_std
from procedures._efc import (
    SUPPLY_PRESSURE,
    THROUGH_FLOW,
    Stage,
    channel,
    channel_in,
    check_channels,
    held,
    part_recordings,
    play,
)
from procedures._recorded import calibration_std, noted, reading_step, roles_of
from procedures._settings import NotNegative, NotNegativeAmpere, Positive

LEAKAGE = Measurement("leakage", "ml/min", "flow through the closed valve, at 220 psi across it", 35.0, 125.0)
MEASUREMENTS = (
    LEAKAGE,
    Measurement("supply_pressure", "psi", "pressure before the valve"),
    Measurement("return_pressure", "psi", "pressure behind the valve"),
)
KIND = "leakage"

_RATED_PSI, _TOLERANCE_PSI = 220.0, 3.0
_FARTHEST = 0.2  # of the rated pressure, up to which the flow is scaled
_FULL = 0.98  # of a flow meter's range: beyond it may be anything


def run(
    rig: Rig,
    *,
    closing_current: NotNegativeAmpere = 0.0,
    settle_s: NotNegative = 2.0,
    hold_s: Positive = 5.0,
    rate_hz: Positive | None = None,
) -> None:
    """Hold the valve closed.

    Args:
        rig: the bench.
        closing_current: that closes the valve, in A: 0 for a normally closed one.
        settle_s: at this current before anything is measured, in s.
        hold_s: time over which the flow is averaged, in s.
        rate_hz: sample rate; that of the bench when not given.
    """
    rate_hz = rig.actual_rate_hz(rate_hz)
    check_channels(rig, (THROUGH_FLOW, SUPPLY_PRESSURE), "the leakage check")
    play(rig, stages(closing_current, settle_s, hold_s, rate_hz), rate_hz)


def stages(closing_current: float, settle_s: float, hold_s: float, rate_hz: float) -> list[Stage]:
    """Waiting, and measuring."""
    wait = Stage(held(closing_current, settle_s, rate_hz), "valve closed", {"kind": "settling"})
    measure = Stage(held(closing_current, hold_s, rate_hz), "leakage", {"kind": KIND, "current": closing_current})
    return [wait, measure]


def evaluate(recording: Recording) -> Findings:
    """The flow at 220 psi, and whether it is one through a closed valve."""
    found = part_recordings(recording, KIND)
    if not found:
        return Findings(tuple(m.of(None) for m in MEASUREMENTS), notes=(Note("Leakage was not measured."),))
    _, samples = found[0]
    _, response = roles_of(recording)
    flow = channel(samples, THROUGH_FLOW, "ml/min", "the leakage check")
    supply = channel(samples, SUPPLY_PRESSURE, "psi", "the leakage check")
    channels = (flow, supply, channel_in(samples, response.name, "psi"))
    means = [float(c.values.mean()) for c in channels]
    stds = [_mean_std(samples, c) for c in channels]
    known = [calibration_std(c) for c in channels]
    across = means[1] - means[2]
    notes, deviations = [], []
    at_end = any(end.get("channel") == flow.name for end in noted(recording, "reading at the end of its range"))
    full = at_end and means[0] >= _FULL * float(recording.values(flow.name, "ml/min").max())
    if full:
        leakage = LEAKAGE.of(means[0] * _FULL, stds[0], relation=">", calibration=known[0])
        notes.append(Note("The flow meter is at the end of its range: the valve is open at this current."))
    elif abs(across / _RATED_PSI - 1.0) > _FARTHEST:
        leakage = LEAKAGE.of(None)
        notes.append(Note(
            "{across_psi:.4g} psi across the valve, not 220: no supply pressure, or the valve is open at this current.",
            across_psi=across,
        ))  # fmt: skip
    else:
        factor = _RATED_PSI / across
        std, calibration = (
            factor * math.hypot(part[0], means[0] * math.hypot(part[1], part[2]) / across) for part in (stds, known)
        )
        leakage = LEAKAGE.of(means[0] * factor, std, calibration=calibration)
    before = marked("{found_psi:.4g} psi before the valve; {rated_psi:g} ± {within_psi:g} psi is specified.")
    behind = marked("{found_psi:.4g} psi behind the valve; {rated_psi:g} ± {within_psi:g} psi is specified.")
    for code, value, rated in ((before, means[1], _RATED_PSI), (behind, means[2], 0.0)):
        if abs(value - rated) > _TOLERANCE_PSI:
            deviations.append(Note(code, found_psi=value, rated_psi=rated, within_psi=_TOLERANCE_PSI))
    return Findings(
        (
            leakage,
            MEASUREMENTS[1].of(means[1], stds[1], calibration=known[1]),
            MEASUREMENTS[2].of(means[2], stds[2], calibration=known[2]),
        ),
        notes=tuple(notes), deviations=tuple(deviations),
    )  # fmt: skip


def _mean_std(samples: Recording, channel: Channel) -> float:
    """Standard uncertainty of a channel's mean by noise, and by rounding where noise is less than a code."""
    _, noise = noisy_mean(channel.values)
    return math.hypot(noise, mean_rounding_std(float(channel.values.std()), reading_step(samples, channel)))
