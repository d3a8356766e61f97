"""`python -m tests.witnesses`: how often a good end of a shipped bench is not confirmed by its witness.

Each bench is driven in virtual time: a level, a sine or a ramp of drawn size, then its safe values. The valve obeys
each time, so that every word against an output is one too many.
"""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import replace

import numpy as np
import typer

from hil.bench.find import benches
from hil.bench.protection import protection_of
from hil.bench.read import read_bench
from hil.bench.rehearsal import twin_of
from hil.clock import VirtualClock
from hil.daq.contract import Waveform
from hil.daq.scaled import Scaled
from hil.errors import NotSafeError
from hil.safety.guard import Guard
from hil.safety.outputs import note_of

AT_A_TIME = 50  # ends between two openings of a bench


def main(ends: int = 1000, seed: int = 1, only: str = "") -> None:
    """Count the words against the outputs of every shipped bench."""
    for name in sorted(benches()):
        if not only or only == name:
            print(f"{name:28} {dict(words_at_ends(name, ends, seed))}", flush=True)


def words_at_ends(name: str, ends: int, seed: int) -> Counter[str]:
    """What is known of the outputs of a bench after so many good ends, counted."""
    found: Counter[str] = Counter()
    for first in range(0, ends, AT_A_TIME):
        found += _ends(name, min(AT_A_TIME, ends - first), np.random.default_rng([seed, first]))
    return found


def _ends(name: str, ends: int, random: np.random.Generator) -> Counter[str]:
    guard, command = opened(name, int(random.integers(1 << 30)))
    limits, channel = guard.limits[command], guard.outputs[command]
    rate_hz = guard.actual_rate_hz(200.0)
    found: Counter[str] = Counter()
    for _ in range(ends):
        level, samples = random.uniform(limits.low, limits.high), int(rate_hz * random.uniform(0.1, 1.0))
        time_s = np.arange(samples) / rate_hz
        wave = random.choice([np.ones(samples), np.cos(2.0 * np.pi * 3.0 * time_s), np.linspace(0.0, 1.0, samples)])
        values = np.clip(channel.safe + (level - channel.safe) * wave, limits.low, limits.high)
        for _block in guard.play(Waveform(rate_hz, {command: values})):
            pass
        found[end_of(guard)] += 1
    return found


def end_of(guard: Guard) -> str:
    """Make safe, and what came of it: `safe`, a note on it, or what is against it."""
    with suppress(NotSafeError):
        guard.make_safe()
    states = guard.output_states
    return f"{note_of(states.by_name) and 'note'}{'' if states.are_safe else states.text}" or "safe"


def opened(name: str, seed: int = 1) -> tuple[Guard, str]:
    """A shipped bench in virtual time without its interlocks, and the name of its command.

    Args:
        name: of the bench.
        seed: of the noise.
    """
    file = twin_of(read_bench(benches()[name]), seed)
    (device,) = file.devices.values()
    clock = VirtualClock()
    daq = device.module.open_daq(device.settings, device.wiring(file.bench.channels), clock)
    lines = {channel: entry.line for channel, entry in file.bench.channels.items()}
    scaled = Scaled(daq, lines)
    guard = Guard(scaled, replace(protection_of(file.bench, scaled.actual_rate_hz(200.0)), interlocks=()), clock=clock)
    return guard, next(channel for channel, entry in file.bench.channels.items() if entry.role == "command")


if __name__ == "__main__":
    typer.run(main)
