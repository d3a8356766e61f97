"""The field side of simulated devices: terminals with a plant behind them that runs as time goes on."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping

import numpy as np

from hil.clock import Clock, RealClock
from hil.daq.channel import Pwm, Wiring
from sim_devices._quirks import Quirks
from sim_devices._rig import SimulatedRig
from sim_devices._settings import Settings
from sim_devices._simulation import Simulation

_BITS = 24  # the protocol rounds, not a converter
_STILL = 1e-3  # of a terminal's unit: nearer than that to its safe value an output is there
_LONGEST_S = 5.0  # a plant that nobody looked at has settled after so long; more is not computed


class Field:
    """One plant behind the terminals of one or several devices, brought up to the clock at each access.

    May be used from several threads. `now_s` and everything that a device times go by the same clock, so a test
    may turn time by hand.

    Args:
        simulation: the plant, its effects, and an instrument for each channel.
        wirings: by device, what is connected to its terminals.
        by: the clock; real time if not given.
        clock_hz: the plant's inputs may change so often.
    """

    def __init__(
        self, simulation: Simulation, wirings: Mapping[str, Wiring], by: Clock | None = None, clock_hz: float = 1000.0
    ) -> None:
        self.clock: Clock = by or RealClock()
        outputs = {name: c for wiring in wirings.values() for name, c in wiring.outputs.items()}
        inputs = {name: c for wiring in wirings.values() for name, c in wiring.inputs.items()}
        self._wirings = wirings
        self._lock = threading.RLock()
        self._hz = clock_hz
        self._levels = {name: nearest_zero(c.low, c.high) for name, c in outputs.items()}
        self._safe = {name: channel.safe for name, channel in outputs.items()}
        self._sticking: dict[str, float] = {}
        settings = Settings.model_validate({"simulation": simulation, "bits": _BITS, "clock_hz": clock_hz})
        self._rig = SimulatedRig(settings, Wiring(outputs, inputs), self._levels)
        self._zero_s = self.clock.now_s
        self._seen, self._samples = self._rig.hold(self._levels, 1)

    def side(self, device: str) -> Side:
        """The terminals of one device."""
        return Side(self, self._wirings[device])

    @property
    def levels(self) -> dict[str, float]:
        """Where each output stands, by channel, in the terminal's unit."""
        with self._lock:
            return dict(self._levels)

    def drive(self, values: Mapping[str, float], *, sticks: bool = False) -> None:
        """Put outputs, by channel, at these values from now on; one that `sticks` acts as before when that is safe."""
        with self._lock:
            self._catch_up()
            for name, value in values.items():
                if sticks and math.isclose(value, self._safe[name], abs_tol=_STILL):
                    self._sticking.setdefault(name, self._levels[name])
                else:
                    self._sticking.pop(name, None)
            self._levels.update(values)

    def modulate(self, channel: str, pwm: Pwm | None) -> None:
        """Give a PWM current output this carrier and dither from now on."""
        with self._lock:
            self._catch_up()
            self._rig.stages[channel].pwm = pwm

    def read(self) -> dict[str, float]:
        """Every input now, by channel, in the terminal's unit."""
        with self._lock:
            self._catch_up()
            readings = self._rig.inputs.read(
                self._seen, float(self._samples), 1, np.array([self._rig.ticks / self._hz])
            )
            return {name: float(values[0]) for name, values in readings.items()}

    def _catch_up(self) -> None:
        behind = math.floor((self.clock.now_s - self._zero_s) * self._hz + 1e-6) - self._rig.ticks
        if behind > _LONGEST_S * self._hz:  # nobody looked; time that nobody saw is left out
            left_out = behind - round(_LONGEST_S * self._hz)
            self._zero_s += left_out / self._hz
            behind -= left_out
        if behind > 0:
            self._seen, self._samples = self._rig.hold({**self._levels, **self._sticking}, behind)


class Side:
    """The terminals of one device on a `Field`. What is not connected reads 0 and drives nothing.

    Attributes:
        quirks: those in force; inputs that are stuck or no numbers and outputs that are frozen are so here, the rest
            is the device's.
        field: that of all devices.
    """

    def __init__(self, field: Field, wiring: Wiring) -> None:
        self.field = field
        self._outputs = {channel.terminal: name for name, channel in wiring.outputs.items()}
        self._inputs = {channel.terminal: name for name, channel in wiring.inputs.items()}
        self._loose: dict[str, float] = {}
        self._held: dict[str, float] = {}
        self.quirks = Quirks()

    @property
    def clock(self) -> Clock:
        """By which the field runs."""
        return self.field.clock

    def drive(self, values: Mapping[str, float]) -> None:
        """Put outputs, by terminal, at these values, unless they are frozen."""
        if self.quirks.frozen:
            return
        mine = {self._outputs[terminal]: value for terminal, value in values.items() if terminal in self._outputs}
        self._loose.update({terminal: value for terminal, value in values.items() if terminal not in self._outputs})
        if mine:
            self.field.drive(mine, sticks=self.quirks.sticks)

    def modulate(self, terminal: str, pwm: Pwm | None) -> None:
        """Give a PWM current output this carrier and dither; until then it has those that the bench file says."""
        if terminal in self._outputs:
            self.field.modulate(self._outputs[terminal], pwm)

    def read(self) -> dict[str, float]:
        """Every connected input by terminal."""
        if not (self.quirks.stuck and self._held):
            readings = self.field.read()
            self._held = {terminal: readings[name] for terminal, name in self._inputs.items()}
        if self.quirks.not_a_number:
            return dict.fromkeys(self._held, math.nan)
        return dict(self._held)

    def number(self, terminal: str) -> float:
        """One input for a protocol that knows no NaN: 0 then, and where nothing is connected."""
        value = self.read().get(terminal, 0.0)
        return 0.0 if math.isnan(value) else value

    def standing(self, terminal: str) -> float:
        """Where an output stands."""
        if terminal in self._outputs:
            return self.field.levels[self._outputs[terminal]]
        return self._loose.get(terminal, 0.0)


def nearest_zero(low: float, high: float) -> float:
    """Where an output stands when its device is switched on: at zero, or as near as its range lets it."""
    return min(max(0.0, low), high)
