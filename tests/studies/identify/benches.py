"""Recordings as a shipped bench would leave them of a valve that is solved elsewhere."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.bench.find import benches
from hil.record.recording import Array, Channel, Recording
from tests.studies.identify.plants import Channels

RATE_HZ = 1000.0
_OVER = 0.024  # how far beyond its range a converter still reads, as a share of the span


@dataclass(frozen=True)
class Bench:
    """What of a shipped bench shapes a recording."""

    name: str

    @property
    def told(self) -> Mapping[str, Any]:
        """The bench file."""
        return tomllib.loads(benches()[self.name].read_text(encoding="utf-8"))

    @property
    def _command(self) -> tuple[str, Mapping[str, Any]]:
        return next((n, c) for n, c in self.told["channels"].items() if c.get("role") == "command")

    @property
    def _driven(self) -> dict[str, float]:
        _, entry = self._command
        span, slope = (3.0, 1.0) if entry["terminal"].startswith("pwm") else (20.0, entry["calibration"]["slope"])
        low = 0.0 if entry["terminal"].startswith("pwm") else -10.0 * slope
        step = span * slope / 2.0**16
        pwm = entry.get("pwm", {})
        dither = {name: float(pwm[name]) for name in ("dither_amplitude", "dither_hz") if name in pwm}
        return {"low": low, "high": low + span * slope - step, "step": step, "dither_amplitude": 0.0} | dither

    def acting(self, command: Array, sub_steps: int) -> Array:
        """What the converter and the current drive make of a command, for each small step."""
        how, (_, entry) = self._driven, self._command
        codes = np.rint((command - how["low"]) / how["step"])
        held = np.repeat(np.minimum(codes * how["step"] + how["low"], how["high"]), sub_steps)
        if not how["dither_amplitude"]:
            return held
        time_s = np.arange(len(held)) / (RATE_HZ * sub_steps) + 0.0013
        wave = how["dither_amplitude"] * np.sin(2.0 * math.pi * entry["pwm"]["dither_hz"] * time_s)
        return np.clip(held + wave, 0.0, 3.0)

    def recorded(
        self, name: str, command: Array, channels: Channels, sub_steps: int, seed: int, noise: float
    ) -> Recording:
        """What is read of the channels, one after another through the multiplexer, with noise and in steps."""
        told, rng = self.told, np.random.default_rng([seed, len(command)])
        daq, title = told["devices"]["daq"], self._command[0]
        made = {title: Channel(title, self._command[1]["unit"], command)}
        delays = {}
        inputs = {n: c for n, c in told["channels"].items() if c["terminal"].startswith("ai")}
        for i, (channel, entry) in enumerate(inputs.items()):
            delays[channel] = i * float(daq["skew_s"])
            if channel not in channels:
                continue
            at = np.arange(len(command)) * sub_steps + delays[channel] * RATE_HZ * sub_steps
            read = np.interp(at, np.arange(len(channels[channel])), channels[channel])
            slope, offset = entry["calibration"]["slope"], entry["calibration"].get("offset", 0.0)
            own = told["simulation"]["instruments"].get(channel, {}).get("noise", 0.0) / slope
            raw = (read - offset) / slope
            raw = raw + noise * math.hypot(own, daq["noise_v"]) * rng.standard_normal(len(raw))
            raw = np.clip(np.rint(raw * 2.0**16 / 20.0) * 20.0 / 2.0**16, -10.0 - 20.0 * _OVER, 10.0 + 20.0 * _OVER)
            calibration = {k: v for k, v in entry["calibration"].items() if k != "date"}
            made[channel] = Channel(channel, entry["unit"], slope * raw + offset, "", calibration)
        sampling = {"timing": "hardware", "read_at": 0.0, "rate_hz": RATE_HZ, "delay_s": delays}
        meta = {"sampling": sampling, "driven": {title: self._driven}}
        return Recording(name, np.arange(len(command)) / RATE_HZ, made, meta)
