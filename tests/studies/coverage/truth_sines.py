"""What sines and multisines must find: harmonics of the response without noise, by least squares and by FFT."""

from __future__ import annotations

import math
import tomllib
from collections import defaultdict
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from hil.bench.find import benches
from hil.record.recording import Array, Recording
from tests.studies.coverage.situations import OPEN, Situation
from tests.studies.coverage.truth_static import Truths

_HARMONICS = 5
_ANSWERED = 1e-3  # of the response at the lowest line: less is no response
_DRAWN = 200  # pairs of periods
_SAME_A = 1e-4  # two writings of one current


def harmonics(time_s: Array, values: Array, frequency_hz: float, drift: bool = False) -> tuple[Any, float]:
    """(complex amplitudes of harmonics 1 to 5 of sin, mean)."""
    columns = [np.ones_like(time_s)]
    for k in range(1, _HARMONICS + 1):
        turn = 2.0 * math.pi * k * frequency_hz * time_s
        columns += [np.sin(turn), np.cos(turn)]
    if drift:
        columns.append(time_s - (time_s[0] + time_s[-1]) / 2.0)
    found, *_ = np.linalg.lstsq(np.column_stack(columns), values, rcond=None)
    return found[1 : 2 * _HARMONICS : 2] + 1j * found[2 : 2 * _HARMONICS + 1 : 2], float(found[0])


def of_frequency_response(clean: Recording, bench: str, _situation: Situation) -> Truths:
    """Every bias and amplitude."""
    groups: dict[tuple[float, float], list[tuple[float, complex, float]]] = defaultdict(list)
    for part in _parts(clean, "sine"):
        given, answer = (harmonics(*_rows(clean, part, role), part["frequency_hz"])[0] for role in _ROLES)
        thd = float(np.linalg.norm(answer[1:]) / abs(answer[0]))
        groups[part["bias"], part["amplitude"]].append((part["frequency_hz"], answer[0] / given[0], thd))
    found: Truths = {}
    for (bias, amplitude), lines in groups.items():
        lines.sort()
        frequency_hz, response, thd = (np.array(column) for column in zip(*lines, strict=True))
        label = _label(clean, bias, amplitude)
        found |= _crossings(frequency_hz, response / _chain(clean, bench, frequency_hz), label)
        found[f"thd, {label}"] = 100.0 * float(thd[_answered(response)].max())
    return found


def of_multisine(clean: Recording, bench: str, situation: Situation) -> Truths:
    """Every bias and amplitude; noise as the bench states it."""
    found: Truths = {}
    for part in _parts(clean, "multisine"):
        samples = round(1.0 / (part["base_hz"] * clean.interval_s))
        periods = part["count"] // samples
        spectra = []
        for role in _ROLES:
            _, values = _rows(clean, part, role)
            spectra.append(
                np.fft.rfft(values[: periods * samples].reshape(periods, samples).mean(axis=0)) * 2 / samples
            )
        given, answer = spectra
        excited = np.asarray(part["excited"])
        response, size = answer[excited] / given[excited], np.abs(answer[excited])
        label = _label(clean, part["bias"], part["amplitude"])
        frequency_hz = excited * part["base_hz"]
        found |= _crossings(frequency_hz, response / _chain(clean, bench, frequency_hz), label)
        noise = _noise(clean, bench, situation, part) / math.sqrt(periods)
        found[f"noise, {label}"] = 100.0 * float(np.median(noise[excited] / size))
        for name in ("odd", "even"):
            level = _silent(given, answer, np.asarray(part[f"{name}_detection"]), excited, response)
            found[f"{name}_distortion, {label}"] = 100.0 * float(np.median(level / size))
    return found


def of_large_sine(clean: Recording, _bench: str, _situation: Situation) -> Truths:
    """Amplitude, phase, mean and distortion at each frequency."""
    found: Truths = {}
    for part in _parts(clean, "sine"):
        found |= _sine(clean, part, f"{part['frequency_hz']:g} Hz")
    return found


def of_sine_position(clean: Recording, bench: str, _situation: Situation) -> Truths:
    """The same on both sides, with the gain and the ratio of the sides."""
    found: Truths = {}
    gains = []
    for part in _parts(clean, "sine"):
        if bench == OPEN:  # the first period brings the cylinder to its speed
            period = round(1.0 / (part["frequency_hz"] * clean.interval_s))
            part = part | {"first": part["first"] + period, "count": part["count"] - period}
        place = _label(clean, part["bias"], part["amplitude"])
        given, _ = harmonics(*_rows(clean, part, "command"), part["frequency_hz"])
        found |= _sine(clean, part, place, drift=bench == OPEN)
        per_s = 2.0 * math.pi * part["frequency_hz"] if bench == OPEN else 1.0
        gains.append(per_s * float(found[f"amplitude, {place}"]) / abs(given[0]))  # type: ignore[arg-type]
        found[f"gain, {place}"] = gains[-1]
    found["direction_ratio"] = gains[0] / gains[1]
    return found


_ROLES = ("command", "response")


def _parts(clean: Recording, kind: str) -> list[dict[str, Any]]:
    return [part for part in clean.meta["parts"] if part["kind"] == kind]


def _rows(clean: Recording, part: dict[str, Any], role: str) -> tuple[Array, Array]:
    rows = slice(part["first"], part["first"] + part["count"])
    return clean.time_s[rows], clean.values(clean.meta["roles"][role])[rows]


def _label(clean: Recording, bias: float, amplitude: float) -> str:
    for event in clean.meta.get("events", ()):
        if event["event"] == "level":
            told = event["details"]
            if abs((told["low_a"] + told["high_a"]) / 2.0 - bias) < _SAME_A:
                low, high = told["psi"]
                return f"{told['level']}, {low:g}…{high:g} psi"
    return f"{bias:+.4g} ± {amplitude:.4g} {clean.channel(clean.meta['roles']['command']).unit}"


def _chain(clean: Recording, bench: str, frequency_hz: Array) -> Any:
    """Held command, the sensor's lag as the bench states it, the multiplexer."""
    told = tomllib.loads(benches()[bench].read_text(encoding="utf-8"))
    name = clean.meta["roles"]["response"]
    lag_s = float(told["channels"][name]["calibration"]["lag_s"])
    inputs = [c for c, entry in told["channels"].items() if str(entry.get("terminal", "")).startswith("ai")]
    skew_s = inputs.index(name) * float(told["devices"]["daq"]["skew_s"])
    s = 2j * math.pi * frequency_hz
    held = np.sinc(frequency_hz * clean.interval_s) * np.exp(-s * clean.interval_s / 2.0)
    return held * np.exp(s * skew_s) / (1.0 + s * lag_s)


def _crossings(frequency_hz: Array, response: Any, label: str) -> Truths:
    found: Truths = {f"gain, {label}": float(abs(response[0]))}
    decibel = 20.0 * np.log10(np.abs(response / response[0]))
    degrees = np.degrees(np.unwrap(np.angle(response)))
    # where backlash lets nothing through, there is neither phase nor distortion
    frequency_hz, decibel, degrees = (of[_answered(response)] for of in (frequency_hz, decibel, degrees))
    for name, values, level in (("bandwidth_3db", decibel, -3.0), ("bandwidth_90deg", degrees, -90.0)):
        if values.min() > level:
            found[f"{name}, {label}"] = (float(frequency_hz[-1]), math.inf)
            continue
        curve = CubicSpline(np.log(frequency_hz), values - level, bc_type="not-a-knot")
        i = int(np.argmax(values <= level))
        at = brentq(curve, math.log(frequency_hz[i - 1]), math.log(frequency_hz[i]))
        found[f"{name}, {label}"] = math.exp(at)
    return found


def _answered(response: Any) -> Any:
    return np.abs(response) > _ANSWERED * np.abs(response[0])


def _silent(given: Any, answer: Any, silent: Any, excited: Any, response: Any) -> Array:
    """Level on silent lines that the input's own leakage does not explain, rms over those nearest."""
    linear = np.interp(silent, excited, response.real) + 1j * np.interp(silent, excited, response.imag)
    power = np.abs(answer[silent] - linear * given[silent]) ** 2
    count = min(5, max(2, len(silent) // 4))
    return np.array([math.sqrt(power[np.argsort(np.abs(silent - line))[:count]].mean()) for line in excited])


def _noise(clean: Recording, bench: str, situation: Situation, part: dict[str, Any]) -> Array:
    """Of an amplitude of the spectrum of one period, both parts together, by drawing the noise before the converter."""
    told = tomllib.loads(benches()[bench].read_text(encoding="utf-8"))
    name = clean.meta["roles"]["response"]
    slope = float(told["channels"][name]["calibration"]["slope"])
    noise = situation.noise * math.hypot(
        float(told["devices"]["daq"]["noise_v"]) * slope, told["simulation"]["instruments"][name]["noise"]
    )
    samples = round(1.0 / (part["base_hz"] * clean.interval_s))
    period, lsb = _rows(clean, part, "response")[1][:samples], slope * 20.0 / 2.0**situation.bits
    rng = np.random.default_rng(1)
    codes = period / lsb + rng.random((_DRAWN, 1))
    read = lsb * np.rint(codes[:, None] + noise / lsb * rng.standard_normal((_DRAWN, 2, samples)))
    apart = np.fft.rfft(read[:, 0] - read[:, 1], axis=1) * 2.0 / samples  # of two periods that are rounded alike
    made: Array = np.sqrt(np.mean(np.abs(apart) ** 2, axis=0) / 2.0)
    return made


def _sine(clean: Recording, part: dict[str, Any], place: str, drift: bool = False) -> Truths:
    given, _ = harmonics(*_rows(clean, part, "command"), part["frequency_hz"])
    answer, mean = harmonics(*_rows(clean, part, "response"), part["frequency_hz"], drift)
    return {
        f"amplitude, {place}": float(abs(answer[0])),
        f"phase, {place}": float(np.degrees(np.angle(answer[0] / given[0]))),
        f"offset, {place}": mean, f"thd, {place}": 100.0 * float(np.linalg.norm(answer[1:]) / abs(answer[0])),
    }  # fmt: skip
