"""What a bench file may say about a simulated DAQ, and what that DAQ has to connect to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from pydantic import Field, PositiveFloat, PositiveInt

from hil.clock import TimeKind
from hil.daq.channel import Terminal
from hil.strict import Strict
from sim_devices import _simulation
from sim_devices._simulation import Place, Simulation


class Fault(Strict):
    """A fault on demand, `after` so many samples since the device was opened."""

    kind: Literal["lost", "underflow", "overrun"]
    after: int = Field(ge=0)


class Settings(Strict):
    """What `[devices.NAME]` may say.

    Attributes:
        simulation: the plant behind the device; from `[simulation]`.
        bits: of the converters.
        clock_hz: sample rates are whole divisions of it; the plant's inputs may change on its edges.
        skew_s: from one input to the next through the multiplexer.
        noise_v: white noise of the input amplifier (standard deviation at the terminal).
        power_on: where outputs stand when the device is found (V, A).
        time: `virtual` runs as fast as it can compute, `real` by the wall clock.
        buffer_s: how far host and device may drift apart in real time before samples are lost.
        fault: one that is to happen.
    """

    simulation: Simulation
    bits: PositiveInt = Field(16, le=24)
    clock_hz: PositiveFloat = 1000.0
    skew_s: float = Field(0.0, ge=0.0)
    noise_v: float = Field(0.0, ge=0.0)
    power_on: float = 0.0
    time: TimeKind = "virtual"
    buffer_s: PositiveFloat = 1.0
    fault: Fault | None = None


OVER = 0.024
"""Analogue inputs read so much of their span beyond either end, as NI's M Series does: ±10.48 V of ±10 V."""


def terminals(_settings: Settings) -> dict[str, Terminal]:
    """Two analogue outputs, two PWM current drives, sixteen analogue inputs, four digital lines each way."""
    return {
        **{f"ao{i}": Terminal("out", "voltage", "V", -10.0, 10.0) for i in range(2)},
        **{f"pwm{i}": Terminal("out", "pwm_current", "A", 0.0, 3.0) for i in range(2)},
        **{f"do{i}": Terminal("out", "digital", "1", 0.0, 1.0) for i in range(4)},
        **{f"ai{i}": Terminal("in", "voltage", "V", -10.0, 10.0, OVER) for i in range(16)},
        **{f"di{i}": Terminal("in", "digital", "1", 0.0, 1.0) for i in range(4)},
    }


def faults(settings: Settings) -> Iterator[tuple[Place, str]]:
    """What cannot be simulated, with its place in the settings."""
    for place, text in _simulation.faults(settings.simulation):
        yield ("simulation", *place), text
