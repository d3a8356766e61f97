"""Where in a recording are the sines? From the parts its procedure wrote down, or from the input itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hil.errors import InputError, SettingError
from hil.identification.frequency.criteria import CRITERIA, EFFORT
from hil.identification.frequency.frequency_response import FrequencyResponse, from_fits
from hil.identification.uncertainty.noise import white_floor
from hil.language.note import Note
from hil.record.recording import Array, Mask, Recording
from hil.signals.frequency_fit import frequency_of
from hil.signals.rounding import rounding_step
from hil.signals.sine_fit import SineFit, sine_fit, with_rounding
from hil.signals.steady import is_steady
from hil.signals.tone import standing_tone


@dataclass(frozen=True, slots=True)
class Segment:
    """Samples first…first + count that hold one sine of a known frequency."""

    frequency_hz: float
    first: int
    count: int
    amplitude: float
    bias: float

    @property
    def samples(self) -> slice:
        """As an index."""
        return slice(self.first, self.first + self.count)


def sines_in(recording: Recording, input_name: str) -> list[Segment]:
    """The sines of a recording: those that the procedure wrote down, else those that are found in its input."""
    return declared_segments(recording) or found_segments(recording.time_s, recording.values(input_name))


def frequency_responses(
    recordings: Recording | Sequence[Recording], input_name: str, output_name: str,
    sines: Sequence[Sequence[Segment]] = (),
) -> tuple[FrequencyResponse, ...]:  # fmt: skip
    """One frequency response for each amplitude and bias that recordings hold together, in the order they were run.

    Sines come from `recording.meta["parts"]` (kind "sine") when the procedure wrote them, and are looked for
    in the input otherwise; then settling periods are cut off by the response itself. `sines`: of each recording, as
    `sines_in` gives them, where they are at hand.

    Raises:
        InputError: no sine is found, the input does not move, or the recordings have other units than the first.
    """
    each = [recordings] if isinstance(recordings, Recording) else list(recordings)
    units = [(r.channel(input_name).unit, r.channel(output_name).unit) for r in each]
    for recording, found in zip(each, units, strict=True):
        if found != units[0]:
            raise InputError(f"{recording.name}: in {found[1]} over {found[0]}, {each[0].name} in other units")
    sought = sines or [sines_in(recording, input_name) for recording in each]
    settled = [
        (recording, one)
        for recording, own in zip(each, sought, strict=True)
        for one in _segments(recording, input_name, output_name, own)
    ]
    made = []
    for group in _by_level(settled):
        harmonics = min(_harmonics(recording.time_s, segment) for recording, segment in group)
        fits = [_fitted(*sine, input_name, output_name, harmonics) for sine in group]
        _, first = group[0]
        made.append(from_fits(each[0].name, fits, units[0], first.amplitude, first.bias))
    return tuple(made)


_Sine = tuple[Recording, Segment]


def _segments(
    recording: Recording, input_name: str, output_name: str, found: Sequence[Segment]
) -> Sequence[Segment]:  # fmt: skip
    """Settled sines of a recording."""
    if declared_segments(recording):
        return found
    u, y = recording.channel(input_name), recording.channel(output_name)
    if not found:
        raise InputError(
            f"{recording.name}: no sine in channel '{u.heading}': neither written down in its parts nor two equal "
            "periods to be seen"
        )
    return [_settled(recording.time_s, y.values, segment) for segment in found]


def _fitted(
    recording: Recording, sine: Segment, input_name: str, output_name: str, harmonics: int
) -> tuple[SineFit, SineFit]:
    """The sine in input and output."""
    part = sine.samples
    given, answer = (
        sine_fit(
            recording.stamps(name)[part], recording.values(name)[part], sine.frequency_hz,
            harmonics=harmonics, drift_order=order,
        )
        for name, order in ((input_name, 0), (output_name, 1))
    )  # fmt: skip
    return given, with_rounding(answer, rounding_step(recording.values(output_name)))


def hum_beneath(recording: Recording, output_name: str, segments: Sequence[Segment]) -> float | None:
    """Frequency of a tone that goes on beneath the sines, beside their harmonics in two of the longest; or None.

    Harmonics of a sine lie elsewhere beneath a sine of another frequency, a hum does not.
    """
    stamps_s, output = recording.stamps(output_name), recording.values(output_name)
    found: list[tuple[float, float]] = []
    for segment in sorted(segments, key=lambda one: one.count)[-EFFORT.listened :]:
        time_s, values = stamps_s[segment.samples], output[segment.samples]
        harmonics = _harmonics(recording.time_s, segment)
        fit = sine_fit(time_s, values, segment.frequency_hz, harmonics=harmonics, drift_order=1)
        tone = standing_tone([(time_s, fit.left(time_s, values))])
        if tone is None:
            continue
        resolved_hz = 1.0 / float(time_s[-1] - time_s[0])
        if any(abs(hz - tone.frequency_hz) < resolved_hz and of != segment.frequency_hz for hz, of in found):
            return tone.frequency_hz
        found.append((tone.frequency_hz, segment.frequency_hz))
    return None


def declared_segments(recording: Recording) -> list[Segment]:
    """Sines that the procedure wrote down; neighbouring parts of one sine are joined."""
    found: list[Segment] = []
    for part in recording.meta.get("parts", ()):
        if part.get("kind") != "sine":
            continue
        new = Segment(
            float(part["frequency_hz"]), int(part["first"]), int(part["count"]),
            float(part["amplitude"]), float(part["bias"]),
        )  # fmt: skip
        last = found[-1] if found else None
        if last and last.first + last.count == new.first and _same_sine(last, new):
            found[-1] = replace(last, count=last.count + new.count)
        else:
            found.append(new)
    return found


def left_out_note(recording: Recording, input_name: str, found: Sequence[Segment]) -> tuple[Note, ...]:
    """What is said where between its sines, `found` in it, a command moves for longer than their longest period.

    A chirp is such a command, and so is a sine of less than two periods. Sines that a procedure wrote down leave none.
    """
    if declared_segments(recording):
        return ()
    time_s, values = recording.time_s, recording.values(input_name)
    longest_s = max(1.0 / segment.frequency_hz for segment in found)
    least = CRITERIA.moves * min(segment.amplitude for segment in found)
    later = np.searchsorted(time_s, time_s + longest_s / 4.0).clip(max=len(time_s) - 1)
    left: list[float] = []
    for first, stop in _between(found, 0, len(time_s)):
        moves = first + np.flatnonzero(np.abs(values[later[first:stop]] - values[first:stop]) > least)
        if len(moves) and time_s[moves[-1]] - time_s[moves[0]] > longest_s:
            left += [float(time_s[moves[0]]), float(time_s[moves[-1]])]
    if not left:
        return ()
    return (
        Note(
            "between {first_s:.4g} and {last_s:.4g} s the command also moves without two equal periods of a sine "
            "(a chirp, a tone too brief); left out",
            first_s=left[0], last_s=left[-1],
        ).of(recording.name),
    )  # fmt: skip


def found_segments(time_s: Array, values: Array) -> list[Segment]:
    """Stretches of at least two equal periods of a sine, found from where the signal passes its middle.

    What is left between them (another bias, another amplitude) is searched again about its own middle.
    """
    found = _within(time_s, values, 0, len(values))
    return sorted(found, key=lambda segment: segment.first)


def _within(time_s: Array, values: Array, start: int, stop: int) -> list[Segment]:
    part = values[start:stop]
    if stop - start < 2 * CRITERIA.fewest_samples or np.ptp(part) == 0.0:
        return []
    middle = (float(part.max()) + float(part.min())) / 2.0
    above = _above(part, middle)
    crossed = np.flatnonzero((part[:-1] <= middle) & (part[1:] > middle))
    rises = np.flatnonzero(~above[:-1] & above[1:])  # the last passage before each counts
    up = start + crossed[np.searchsorted(crossed, rises, side="right") - 1]
    share = (middle - values[up]) / (values[up + 1] - values[up])
    came_s = time_s[np.maximum(up + 1 - int(np.median(_stands(part))), start)]  # a command may be held for samples
    found = _of_equal_periods(time_s, values, came_s + share * (time_s[up + 1] - came_s))
    if found:
        rest = _between(found, start, stop)
    else:
        edges = [start, *(start + 1 + np.flatnonzero(above[:-1] != above[1:])).tolist(), stop]
        rest = list(pairwise(edges)) if len(edges) > 2 else []
    return found + [segment for first, last in rest for segment in _within(time_s, values, first, last)]


def _between(found: Sequence[Segment], start: int, stop: int) -> list[tuple[int, int]]:
    """What lies before, between and behind segments in the order of time, (first, one past the last)."""
    edges = [start, *(edge for one in found for edge in (one.first, one.first + one.count)), stop]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _above(part: Array, middle: float) -> Mask:
    """Whether values are above a middle, or were when noise of a measured command last let it be seen."""
    band = min(CRITERIA.turn_noises * white_floor(part), CRITERIA.turn_share * float(np.ptp(part)))
    seen = np.abs(part - middle) > band
    last = np.maximum.accumulate(np.where(seen, np.arange(len(part)), 0))
    return part[last] > middle


def _of_equal_periods(time_s: Array, values: Array, rises: Array) -> list[Segment]:
    """Runs of equal distances between rises that hold a sine."""
    periods = np.diff(rises)
    found = []
    first = 0
    for i in range(1, len(periods) + 1):
        if i < len(periods) and abs(periods[i] - periods[first]) <= CRITERIA.same_period * periods[first]:
            continue
        if i - first >= 2:
            segment = _segment(time_s, values, rises[first], rises[i])
            found += [segment] if segment else []
        first = i
    return found


def _segment(time_s: Array, values: Array, start_s: float, stop_s: float) -> Segment | None:
    first, stop = (int(i) for i in np.searchsorted(time_s, [start_s, stop_s]))
    part = values[first:stop]
    if stop - first < CRITERIA.fewest_samples:
        return None
    stamps = time_s[first:stop]
    try:
        fit = sine_fit(stamps, part, frequency_of(stamps, part), harmonics=1)
    except SettingError:  # the frequency ran away from what has none
        return None
    if fit.residual_std > 0.1 * fit.amplitude or _is_flat(part, fit):
        return None  # periodic, but no sine
    return Segment(fit.frequency_hz, first, stop - first, fit.amplitude, fit.offset)


def _stands(part: Array) -> Array:
    """How many samples each value stands, one after another, shape (values,)."""
    changes = np.flatnonzero(np.diff(part) != 0.0)
    return np.diff(np.concatenate(([-1], changes, [len(part) - 1])))


def _is_flat(part: Array, fit: SineFit) -> bool:
    """Whether a value stands for longer than at the peak of a sine that is rounded and held."""
    stands, apart = _stands(part), np.diff(np.unique(part)) / fit.amplitude
    step = float(np.min(apart, where=apart > CRITERIA.same_value, initial=1.0))
    at_peak = np.arccos(1.0 - step) / np.pi * len(part) / fit.periods
    return bool(stands.max() > at_peak + 2.0 * np.median(stands))


def _settled(time_s: Array, output: Array, segment: Segment) -> Segment:
    """The segment without its first period and further ones while the output still settles; two stay at least."""
    period_s = 1.0 / segment.frequency_hz
    stamps = time_s[segment.samples]
    count = round((stamps[-1] - stamps[0]) / period_s)
    edges = segment.first + np.searchsorted(stamps, stamps[0] + period_s * np.arange(count))
    edges = np.append(edges, segment.first + segment.count)
    fits = [
        sine_fit(time_s[first:stop], output[first:stop], segment.frequency_hz, harmonics=1)
        for first, stop in pairwise(edges.tolist())
    ]
    skip = 1
    while skip < count - 2 and not is_steady(fits[: skip + 1]):
        skip += 1
    first = int(edges[min(skip, count - 1)])
    return replace(segment, first=first, count=segment.first + segment.count - first)


def _harmonics(time_s: Array, segment: Segment) -> int:
    """How many harmonics lie below half the sample rate, up to the fifth."""
    stamps = time_s[segment.samples]
    rate_hz = (len(stamps) - 1) / float(stamps[-1] - stamps[0])
    return max(1, min(EFFORT.harmonics, int(0.499 * rate_hz / segment.frequency_hz)))


def _by_level(sines: Sequence[_Sine]) -> list[list[_Sine]]:
    groups: list[list[_Sine]] = []
    for sine in sines:
        for group in groups:
            if _same_level(group[0][1], sine[1]):
                group.append(sine)
                break
        else:
            groups.append([sine])
    return groups


def _same_level(a: Segment, b: Segment) -> bool:
    near = CRITERIA.same_level * max(a.amplitude, b.amplitude)
    return abs(a.amplitude - b.amplitude) <= near and abs(a.bias - b.bias) <= near


def _same_sine(a: Segment, b: Segment) -> bool:
    return a.frequency_hz == b.frequency_hz and _same_level(a, b)
