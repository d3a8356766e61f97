"""Frequency response of an EFC by stepped sine at the thesis's three pressure levels: low, medium and high.

The names are levels, not amplitudes: "low" swings between 19 and 21 psi, "medium" between 20 and 140 psi, "high"
between 133 and 147 psi (EFC thesis, section 3.1.3.1). Sweeps of the current first tell which currents these are for
this valve; the sines and their evaluation are those of `frequency_response`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from hil.errors import InputError, SettingError
from hil.identification.steady.pressure_curve import PressureCurve
from hil.language.note import Note, changed
from hil.physics.published.tugsal import SWEEPS_PSI
from hil.record.measurement import Findings
from hil.record.recording import Recording
from hil.rig import Rig
from procedures import frequency_response, pressure_current
from procedures._recorded import noted
from procedures._sequence import defaults_of
from procedures._settings import NotNegative, Positive, PositiveAmpere, PositiveHertz, Twice
from procedures._steady_sine import Patience

MEASUREMENTS = frequency_response.MEASUREMENTS

_FREQUENCIES_HZ = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0)
_AMPERE = 100.0  # % of a full command of 1 A


def run(
    rig: Rig,
    *,
    levels: tuple[Literal["low", "medium", "high"], ...] = ("low", "medium", "high"),
    frequencies: tuple[PositiveHertz, ...] = _FREQUENCIES_HZ,
    measure_periods: Twice = 3,
    measure_s: NotNegative = 2.0,
    top_current: PositiveAmpere = 2.0,
    cycle_s: Positive = 20.0,
    normally_open: bool = False,
    rate_hz: Positive | None = None,
) -> None:
    """Drive two sweeps, then the sines of each level.

    Args:
        rig: the bench.
        levels: which of the three.
        frequencies: in Hz, rising.
        measure_periods: least number of whole periods that are measured, 2 or more.
        measure_s: least time that is measured, in s.
        top_current: to which the sweeps go, in A.
        cycle_s: time of the first sweep, in s.
        normally_open: whether current closes the valve.
        rate_hz: sample rate; that of the bench when not given.
    """
    with rig.before(expected_s(rig, levels, frequencies, measure_periods, measure_s)):
        pieces = pressure_current.run(
            rig, top_current=top_current, cycle_s=cycle_s, normally_open=normally_open, rate_hz=rate_hz
        )
    drive(rig, curve_of(rig, pieces), levels, frequencies, measure_periods, measure_s, rate_hz)


def curve_of(rig: Rig, pieces: Sequence[Recording]) -> PressureCurve:
    """The curve of the sweeps that have just been driven."""
    with_speed = [(float(piece.meta["parts"][0]["speed_per_s"]), piece) for piece in pieces]
    return pressure_current.curve_of("sweeps", with_speed, rig.command.name, rig.response.name)


def drive(
    rig: Rig,
    curve: PressureCurve,
    levels: Sequence[str],
    frequencies: tuple[float, ...] = _FREQUENCIES_HZ,
    measure_periods: int = 3,
    measure_s: float = 2.0,
    rate_hz: float | None = None,
) -> None:
    """The sines about the currents that a known curve gives for each level.

    Raises:
        SettingError: no level, or one that is not known.
        InputError: the curve does not reach a level's pressures.
    """
    unknown = [level for level in levels if level not in SWEEPS_PSI]
    if unknown or not levels:
        raise SettingError(f"setting levels: {', '.join(unknown) or 'none'}; allowed are {', '.join(SWEEPS_PSI)}")
    swings = {}
    for level in levels:
        low, high = sorted(pressure_current.checked_current(curve, p, "levels") for p in SWEEPS_PSI[level])
        swings[level] = (low, high)
    # the limits of the command only ever become narrower, so the level that goes highest comes first
    ordered = sorted(swings.items(), key=lambda item: -item[1][1])
    for i, (level, (low, high)) in enumerate(ordered, 1):
        rig.note("level", level=level, low_a=round(low, 5), high_a=round(high, 5), psi=SWEEPS_PSI[level])
        rest = [name for name, _ in ordered[i:]]
        with rig.before(expected_s(rig, rest, frequencies, measure_periods, measure_s)):
            frequency_response.run(
                rig, frequencies=frequencies, amplitudes=(_AMPERE * (high - low) / 2.0,),
                biases=(_AMPERE * ((low + high) / 2.0 - rig.command.safe),), full_command=1.0,
                measure_periods=measure_periods, measure_s=measure_s, rate_hz=rate_hz,
            )  # fmt: skip


def expected_s(
    rig: Rig, levels: Sequence[str], frequencies: Sequence[float], measure_periods: int = 3, measure_s: float = 2.0
) -> float:
    """Bench time of the sines of so many levels, before their currents are known, in s."""
    patience = Patience(rig.settling_s, measure_periods, measure_s, 0.0, 0.0)
    return len(levels) * (2.0 * rig.settling_s + sum(patience.expected_s(f) for f in frequencies))


def evaluate(recording: Recording) -> Findings:
    """Responses, bandwidths and transfer functions of every level, and which label is which level."""
    own = recording.meta.get("settings", {})
    settings: dict[str, Any] = {**defaults_of(frequency_response.run), **own}
    found = frequency_response.evaluate(replace(recording, meta={**recording.meta, "settings": settings}))
    levels = noted(recording, "level")
    notes = tuple(
        Note(
            "Level {level}: {low_psi:g} to {high_psi:g} psi, {low_a:.4g} to {high_a:.4g} A.",
            level=one["level"], low_psi=one["psi"][0], high_psi=one["psi"][1], low_a=one["low_a"],
            high_a=one["high_a"],
        )
        for one in levels
    )  # fmt: skip
    named = _named(found, levels)
    return replace(named, notes=(*notes, *named.notes))


def _named(found: Findings, levels: Sequence[Mapping[str, Any]]) -> Findings:
    """The same with the levels' names instead of the currents that this unit needed: names that stay."""
    names = {}
    for curve in found.curves["responses"]:
        level = min(levels, key=lambda one: abs((one["low_a"] + one["high_a"]) / 2.0 - curve["bias"]), default=None)
        if level is not None:
            names[str(curve["label"])] = level_name(level["level"])

    def renamed(text: str) -> str:
        for label, name in names.items():
            text = text.replace(label, name)
        return text

    return Findings(
        tuple(replace(m, name=renamed(m.name)) for m in found.measured),
        {"responses": [{**curve, "label": renamed(str(curve["label"]))} for curve in found.curves["responses"]]},
        tuple(changed(note, renamed) for note in found.notes),
        tuple(changed(note, renamed) for note in found.deviations),
    )


def level_name(level: str) -> str:
    """`high, 133…147 psi`: the same for every unit."""
    low, high = SWEEPS_PSI[level]
    return f"{level}, {low:g}…{high:g} psi"


def bandwidth_at(recording: Recording, found: Findings, level: str) -> tuple[float, float]:
    """−3 dB frequency at a level and its standard uncertainty, in Hz; the top frequency where it was not reached.

    Raises:
        InputError: the level was not measured, or noise hides where it is.
    """
    swings = [(one["low_a"], one["high_a"]) for one in noted(recording, "level") if one["level"] == level]
    if not swings:
        raise InputError(f"the frequency response at the {level} level was not measured")
    low, high = swings[-1]
    curve = min(found.curves["responses"], key=lambda c: abs(c["bias"] - (low + high) / 2.0))
    known, top = _known(found, "bandwidth_3db", curve["label"]), float(curve["frequency_hz"][-1])
    if known is None:
        raise InputError(f"the pressure does not follow the current at the {level} level")
    if curve["bandwidth_3db_hz"] is None:
        if known < top:
            raise InputError(f"noise hides the −3 dB frequency at the {level} level; it lies above {known:.3g} Hz")
        return top, 0.0
    if curve["bandwidth_3db_std_hz"] is None:
        raise InputError(f"the −3 dB frequency at the {level} level lies at the lowest frequency or below")
    return float(curve["bandwidth_3db_hz"]), float(curve["bandwidth_3db_std_hz"])


def _known(found: Findings, quantity: str, label: str) -> float | None:
    """A measured value, or the bound of one; None where neither was determined."""
    return next(m.value for m in found.measured if m.name == f"{quantity}, {label}")
