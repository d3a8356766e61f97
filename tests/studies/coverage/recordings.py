"""Recordings as a bench with noise would leave them, made from one run without noise.

A procedure is driven once on the bench without noise. Its readings then get the noise, the rounding and the error of
calibration of each seed, as the simulated DAQ would have given them: the same generator, the same converter.
"""

from __future__ import annotations

import math
import tomllib
import zlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.bench.find import benches
from hil.bench.read import read_bench
from hil.record.recording import Channel, Recording
from hil.session.procedure import Procedure
from tests.driven import driven as bench_driven
from tests.once import once
from tests.studies.coverage.situations import Situation, without_noise

_RAW_LOW, _RAW_SPAN = -10.0, 20.0
_FINE_BITS = 16


def driven(procedure: Procedure, bench: str, settings: Mapping[str, str], situation: Situation, at: Path) -> Recording:
    """What the procedure records on the bench without noise; in a run of the tests it is driven once for all."""
    text, given = without_noise(bench, situation), {**settings, **situation.settings.get(procedure.name, {})}
    key = zlib.crc32(f"{text}{sorted(given.items())}".encode())
    return once(f"driven-{procedure.name}-{key}", lambda: driven_on(procedure, text, given, at))


def driven_on(procedure: Procedure, text: str, settings: Mapping[str, str], at: Path) -> Recording:
    """What the procedure records on a bench file's text."""
    at.mkdir(parents=True)
    file = at / "bench.toml"
    file.write_text(text, encoding="utf-8")
    return bench_driven(procedure, file, at / "run", settings)


def noisy(clean: Recording, bench: str, situation: Situation, seed: int) -> Recording:
    """The recording of one seed."""
    told = tomllib.loads(read_bench(benches()[bench]).text)
    noise_v = float(told["devices"]["daq"]["noise_v"])
    errors = np.random.default_rng([seed, 7])
    channels = {}
    for name, channel in clean.channels.items():
        drawn = float(errors.normal()) if situation.drawn else 0.0
        entry = told["channels"].get(name, {})
        if not str(entry.get("terminal", "")).startswith("ai"):
            channels[name] = channel if not drawn else _off(channel, drawn)
            continue
        instrument = told["simulation"]["instruments"].get(name, {})
        made = _read(channel, entry, instrument, noise_v, situation, seed)
        channels[name] = _off(made, drawn) if drawn else made
    steps = {
        name: {"step": _RAW_SPAN / 2.0**situation.bits * abs(float(entry["calibration"]["slope"]))}
        for name, entry in told["channels"].items() if str(entry.get("terminal", "")).startswith("ai")
    }  # fmt: skip
    return replace(clean, channels=channels, meta={**clean.meta, "read": steps})


def _read(
    channel: Channel, entry: Mapping[str, Any], instrument: Mapping[str, Any], noise_v: float, situation: Situation,
    seed: int,
) -> Channel:  # fmt: skip
    slope, offset = float(entry["calibration"]["slope"]), float(entry["calibration"].get("offset", 0.0))
    std = situation.noise * math.hypot(noise_v, float(instrument.get("noise", 0.0)) / slope)
    raw = (channel.values - offset) / slope
    generator = np.random.default_rng([seed, zlib.crc32(channel.name.encode())])
    raw = raw + std * generator.standard_normal(len(raw))
    lsb = _RAW_SPAN / 2.0**situation.bits
    if situation.bits < _FINE_BITS:  # where the codes lie is a matter of trimming; else every seed has the same error
        raw, offset = raw + lsb * (shift := float(generator.random())), offset - slope * lsb * shift
    codes = np.clip(np.rint((raw - _RAW_LOW) / lsb), 0.0, 2.0**situation.bits - 1.0)
    return replace(channel, values=slope * (codes * lsb + _RAW_LOW) + offset)


def _off(channel: Channel, drawn: float) -> Channel:
    """A channel whose slope is off by what its calibration allows at the end of its range."""
    uncertainty = float(channel.calibration.get("uncertainty") or 0.0) / 2.0
    end = abs(float(channel.calibration.get("slope") or 1.0)) * _RAW_SPAN / 2.0
    return replace(channel, values=channel.values * (1.0 + drawn * uncertainty / end))
