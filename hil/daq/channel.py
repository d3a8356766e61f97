"""What a device has to connect to, and what a bench has connected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from hil.errors import DeviceLostError, LinkError

Direction = Literal["out", "in"]
Kind = Literal["voltage", "current", "pwm_current", "digital", "value"]


@dataclass(frozen=True, slots=True)
class Terminal:
    """A place where a signal goes out of a device or into it, with the widest range that it offers.

    `kind` says what it is: `voltage` [V], `current` [A], `pwm_current` (a current kept up by pulse width
    modulation, [A]), `digital` (0 or 1), or `value` (a device that speaks engineering units by itself).
    `over` is how far beyond either end of its range an input still measures, as a share of the span; its readings lie
    `step` apart, 0 where that is not known.
    """

    direction: Direction
    kind: Kind
    unit: str
    low: float
    high: float
    over: float = 0.0
    step: float = 0.0


@dataclass(frozen=True, slots=True)
class Pwm:
    """How a PWM current output is made: the carrier, and the dither that keeps the valve from sticking.

    `dither_amplitude` is the peak of a sine about the mean current, in the unit of the output.
    """

    carrier_hz: float
    dither_hz: float | None = None
    dither_amplitude: float = 0.0


@dataclass(frozen=True, slots=True)
class OutputChannel:
    """An output in use: its name on the bench, where it is connected, its range, and where it is safe.

    0 V is not neutral for every valve, so `safe` is always said. Values are in `unit`: raw as the device
    drives it, or engineering units once a calibration stands in front (see `hil.daq.scaled`). The device drives the
    nearest of the levels that lie `step` apart, `low` being one of them; 0 where that is not known.
    """

    name: str
    terminal: str
    kind: Kind
    unit: str
    low: float
    high: float
    safe: float = 0.0
    pwm: Pwm | None = None
    step: float = 0.0

    @property
    def driven(self) -> dict[str, float]:
        """How what it is told reaches the valve, as a recording keeps it: lowest and highest level, step, dither."""
        highest = self.high if self.kind == "digital" else self.high - self.step
        made = {"low": self.low, "high": highest, "step": self.step, "dither_amplitude": 0.0}
        if self.pwm is None or self.pwm.dither_hz is None:
            return made
        return made | {"dither_amplitude": self.pwm.dither_amplitude, "dither_hz": self.pwm.dither_hz}


@dataclass(frozen=True, slots=True)
class InputChannel:
    """An input in use: its name on the bench, where it is connected, its range, and how far `over` that it measures.

    Its readings lie `step` apart; 0 where that is not known.
    """

    name: str
    terminal: str
    kind: Kind
    unit: str
    low: float
    high: float
    over: float = 0.0
    step: float = 0.0


@dataclass(frozen=True, slots=True)
class Wiring:
    """Every channel that a bench uses of one device; inputs in the order in which they are scanned.

    Attributes:
        looked_at: nothing is run: an input without a measurement is shown as such, not refused.
        only_safe: nothing is wanted but that outputs become safe: they are told so also where nobody answers.
        known_as: what the device said that it is when it was opened before; empty where that is not known.
    """

    outputs: Mapping[str, OutputChannel]
    inputs: Mapping[str, InputChannel]
    looked_at: bool = False
    only_safe: bool = False
    known_as: str = ""

    def refuse_another(self, identity: str) -> None:
        """Called by a driver as soon as its device has said what it is, before anything is written to it.

        Raises:
            DeviceLostError: it is another one than before.
        """
        if identity and self.known_as and identity != self.known_as:
            raise DeviceLostError(
                f"another device answers: it says that it is {identity}; {self.known_as} was opened before"
            )

    @contextmanager
    def forgiving(self) -> Iterator[None]:
        """Goes on when nobody answers inside, where nothing is wanted but that outputs become safe."""
        try:
            yield
        except LinkError:
            if not self.only_safe:
                raise
