"""Curves as procedures hand them over (docs/reference/procedures.md), from formulas instead of a bench."""

from __future__ import annotations

from typing import Any

import numpy as np

Curve = dict[str, Any]
Array = np.ndarray
UNITS = {"command_unit": "%", "response_unit": "l/min"}


def _second_order(
    frequency_hz: np.ndarray, natural_hz: float, dead_time_s: float = 0.02
) -> tuple[np.ndarray, np.ndarray]:
    """As (dB, degrees)."""
    s = 1j * frequency_hz / natural_hz
    h = 1.0 / (s**2 + 1.2 * s + 1.0) * np.exp(-2j * np.pi * frequency_hz * dead_time_s)
    return 20.0 * np.log10(np.abs(h)), np.degrees(np.unwrap(np.angle(h)))


def response(bias: float, amplitude: float, *, multisine: bool = False) -> Curve:
    natural_hz = 1.0 + 0.02 * amplitude
    f = np.arange(0.1, 4.95, 0.2)
    dense = np.geomspace(0.1, 4.9, 200)
    random = np.random.default_rng(int(amplitude))
    std = 0.4 / amplitude * np.ones(len(f))
    db, degrees = _second_order(f, natural_hz)
    model_db, model_degrees = _second_order(dense, natural_hz)
    model = {
        "text": "2 poles, 0 zeros, fit 98.71 %\n  b0  1.23 ± 0.02",
        "formula": "G(s) = 1.23 / (s² + 1.2·s + 1)·e^(−0.02·s)",
        "fit_percent": 98.7123, "dead_time_s": 0.02, "frequency_hz": dense, "magnitude_db": model_db,
        "magnitude_std_db": np.full(200, 0.05), "phase_deg": model_degrees, "phase_std_deg": np.full(200, 0.4),
    }  # fmt: skip
    time_s = np.linspace(0.0, 2.0, 400)
    overlays = [
        {"frequency_hz": k, "time_s": time_s / k,
         "measured": np.sin(2 * np.pi * time_s) + 0.05 * random.normal(size=400),
         "fitted": np.sin(2 * np.pi * time_s), "command": 1.2 * np.sin(2 * np.pi * time_s + 0.3)}
        for k in (0.1, 1.5, 4.9)
    ]  # fmt: skip
    return {
        "label": f"{bias:+g} ± {amplitude:g} %", "amplitude": amplitude, "bias": bias, **UNITS, "frequency_hz": f,
        "gain": 0.9 * 10 ** (db / 20), "gain_std": np.full(len(f), 0.01),
        "gain_unit": "l/min per %", "reference_hz": 0.1,
        "magnitude_db": db + std * random.normal(size=len(f)), "magnitude_std_db": std,
        "phase_deg": degrees + 6 * std * random.normal(size=len(f)), "phase_std_deg": 6 * std,
        "thd_percent": None if multisine else 3.0 + f, "bandwidth_3db_hz": 1.27, "bandwidth_3db_std_hz": 0.006,
        "bandwidth_90deg_hz": None, "bandwidth_90deg_std_hz": None, "model": model,
        "alternative": {**model, "formula": "G(s) = 1 / (s + 1)³", "fit_percent": 98.1} if amplitude == 5.0 else None,
        "overlays": [] if multisine else overlays, "noise_db": np.full(len(f), -55.0) if multisine else None,
        "odd_db": np.full(len(f), -30.0) if multisine else None,
        "even_db": np.full(len(f), -41.0) if multisine else None,
    }  # fmt: skip


def flow_curve() -> Curve:
    command = np.linspace(-100.0, 100.0, 201)
    middle = np.sign(command) * np.maximum(np.abs(command) - 20.0, 0.0) * 0.875
    return {
        **UNITS, "command": command, "rising": middle - 1.0, "falling": middle + 1.0, "std": np.full(201, 0.2),
        "spline": middle, "polynomial": middle + 0.5 * np.sin(command / 10.0), "polynomial_text": "c9 1.2e-15",
        "dead_band": (-20.1, 19.9),
        "half_speed": {"command": command, "rising": middle - 0.9, "falling": middle + 0.9},
    }  # fmt: skip


def step(to_percent: float) -> Curve:
    time_s = np.arange(-0.1, 2.0, 1e-3)
    fitted = 0.7 * to_percent * (1.0 - np.exp(-np.maximum(time_s - 0.02, 0.0) / 0.2))
    noise = 0.3 * np.random.default_rng(2).normal(size=len(time_s))
    return {
        "label": f"0 → {to_percent:g} %", **UNITS, "time_s": time_s,
        "command": np.where(time_s >= 0.0, to_percent, 0.0),
        "measured": fitted + noise, "fitted": fitted, "fitted_text": "56·(1 − e^(−(t − 0.02)/0.2))", "start": 0.0,
        "final": 0.7 * to_percent,
    }  # fmt: skip


def velocity_step(speed_per_s: float) -> Curve:
    time_s = np.arange(0.0, 2.0, 1e-2)
    fitted = speed_per_s * time_s
    return {
        "label": f"0 → {speed_per_s / 100.0:g} A", "response_unit": "mm", "time_s": time_s, "measured": fitted + 0.01,
        "fitted": fitted, "from_s": 0.8, "to_s": 1.99, "speed_per_s": speed_per_s,
    }  # fmt: skip


def drift(level: float) -> Curve:
    time_s = np.arange(0.5, 60.0)
    return {
        "label": f"{level:g} A", "response_unit": "mm", "time_s": time_s, "position": 1e-3 * time_s,
        "fitted": 1e-3 * time_s,
    }  # fmt: skip


def large_sine(frequency_hz: float) -> Curve:
    time_s = np.linspace(0.0, 2.0 / frequency_hz, 2000)
    phase = 2.0 * np.pi * frequency_hz * time_s
    fitted = 68.0 * np.sin(phase - 0.4) + 4.0 * np.sin(3.0 * phase)
    return {
        "label": f"{frequency_hz:g} Hz", "frequency_hz": frequency_hz, "amplitude": 100.0, "bias": 0.0, **UNITS,
        "time_s": time_s, "command": 100.0 * np.sin(phase), "fitted": fitted,
        "measured": fitted + np.random.default_rng(3).normal(size=2000), "harmonics_percent": (0.12, 5.88, 0.04, 1.0),
    }  # fmt: skip
