"""What a bench file may say (docs/reference/bench-file.md)."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, PositiveFloat, field_validator, model_validator
from typing_extensions import TypedDict

from hil.daq.calibration import Calibration
from hil.daq.channel import Pwm, Terminal
from hil.rig import SWITCHED, ConditionRole
from hil.safety.interlock import Action
from hil.strict import Strict

Role = Literal["command", "response", ConditionRole, "emergency stop", "other"]
CONDITIONS: tuple[ConditionRole, ...] = get_args(ConditionRole)
SET_BY_HAND = tuple(role for role in CONDITIONS if role not in SWITCHED)
EMERGENCY_STOP: Role = "emergency stop"


class DwellLimit(Strict):
    """Beyond ±`level` for `longest_s` at most."""

    level: float = Field(ge=0.0)
    longest_s: PositiveFloat


class OutputLimits(Strict):
    """Where an output may go, how fast, and how long it may stay there, in the channel's unit."""

    low: FiniteFloat
    high: FiniteFloat
    slew_per_s: PositiveFloat | None = None
    dwell: tuple[DwellLimit, ...] = ()

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"low {self.low:g} must be below high {self.high:g}")
        return self


class Valve(Strict):
    """The valve under test.

    Attributes:
        plant: the installed plant, or the model file, that is its nominal model.
        serial: of the unit, or `ask`: each run is told, by `--serial` or on the terminal.
        settling_s: after a change of the command, its answer has died away in so long.
        limits: of its command, in that channel's unit; they tighten those of the channel.
        operating_point: where procedures swing when nobody says where, in the unit of its command: where it follows.
        integrates: whether its response moves on for as long as the command is off neutral: a cylinder in an open loop.
        amplifier: settings of its electronics: dither, ramps, dead-band compensation.
    """

    name: str
    plant: str
    serial: str = ""
    settling_s: PositiveFloat = 1.0
    limits: OutputLimits | None = None
    operating_point: FiniteFloat | None = None
    integrates: bool = False
    amplifier: str = ""


class Device(BaseModel):
    """A device: a real one by its `driver`, or a `simulated` one. What else is said are its own settings.

    `late_s`: what was sent to it and not answered arrives so late at most; after a lost answer an output is called safe
    when it is read back later than that. 1 s, and 5 s behind a serial server, gateway or CAN hub, if not given.
    """

    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)

    driver: str = ""
    simulated: str = ""
    late_s: float | None = Field(default=None, gt=0.0, le=60.0)

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if bool(self.driver) == bool(self.simulated):
            raise ValueError('a device has either driver = "…" or simulated = "…"')
        return self

    @property
    def settings(self) -> dict[str, Any]:
        """What is left for the driver or simulated device itself."""
        return dict(self.model_extra or {})


class CalibrationLine(Strict):
    """value = slope · raw + offset, with `uncertainty` (k = 2) in the channel's unit.

    `source` is the certificate or the reference; `operator` who calibrated.
    """

    slope: FiniteFloat
    offset: FiniteFloat = 0.0
    uncertainty: float | None = Field(None, ge=0.0)
    date: dt.date | None = None
    due: dt.date | None = None
    source: str = ""
    operator: str = ""
    lag_s: float | None = Field(None, ge=0.0)

    @model_validator(mode="after")
    def _usable(self) -> Self:
        if self.slope == 0.0:
            raise ValueError("slope 0 makes every reading the same; give the unit per V (or A)")
        return self


class PwmDrive(Strict):
    """Carrier and dither of a PWM current output; the amplitude is the peak about the mean, in A."""

    carrier_hz: PositiveFloat
    dither_hz: PositiveFloat | None = None
    dither_amplitude: float = Field(0.0, ge=0.0)

    def drive(self) -> Pwm:
        """As the device takes it."""
        return Pwm(self.carrier_hz, self.dither_hz, self.dither_amplitude)


class ByHand(Strict):
    """A condition that somebody sets by hand: from `low` to `high`, unless asked for at `usual`.

    What is confirmed must be read within ± `tolerance`, all in the channel's unit.
    """

    low: FiniteFloat
    high: FiniteFloat
    usual: FiniteFloat
    tolerance: PositiveFloat

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low <= self.usual <= self.high or self.low == self.high:
            raise ValueError(f"low {self.low:g}, usual {self.usual:g}, high {self.high:g} must rise")
        return self


class ChannelEntry(Strict):
    """A signal of the bench. An output is what has a `safe` value.

    Attributes:
        device, terminal: where it is connected.
        role: `command` is what procedures drive, `response` what they look at; one of each. `supply pressure`, `load
            orifice`, `tank pressure`, `oil temperature` are outputs that procedures adjust, or inputs that read what
            somebody sets `by_hand`. `electronics supply` and `feedback` are outputs of relays that `fail_safe` opens.
            `emergency stop` is the feedback contact of the hardware's own stop, closed while nobody has pressed it.
        pressed_below: of an emergency stop: below it the contact is open. A digital line needs none.
        unit: of everything said about it. Other than the terminal's own it needs a `calibration`.
        range: narrower than the terminal's, in the terminal's unit: a smaller input range resolves more.
        safe: where an output goes on every exit.
        on: where it stands while the bench is open: an enable relay, a pressure set point.
        ramp_to_safe_per_s: how fast it goes there; without, it jumps.
        witness: the input that answers to an output; it is safe only when that is back at what it read at rest.
        settles_s: of an input that is a witness: so long after the safe value it is back; 1 s if not given. Of an
            output that procedures adjust: so long after a change it has come about; the valve's if not given.
        source: the instrument, in words.
        by_hand: of an input with such a role.
        calibration_history: what `calibration` said before, the oldest first.
    """

    device: str
    terminal: str
    role: Role = "other"
    unit: str = "V"
    calibration: CalibrationLine | None = None
    range: tuple[FiniteFloat, FiniteFloat] | None = None
    source: str = ""
    safe: FiniteFloat | None = None
    on: FiniteFloat | None = None
    limits: OutputLimits | None = None
    ramp_to_safe_per_s: PositiveFloat | None = None
    pwm: PwmDrive | None = None
    witness: str | None = None
    settles_s: PositiveFloat | None = None
    pressed_below: FiniteFloat | None = None
    by_hand: ByHand | None = None
    calibration_history: tuple[CalibrationLine, ...] = ()

    @property
    def is_output(self) -> bool:
        """Whether it is driven."""
        return self.safe is not None

    @property
    def open_below(self) -> float:
        """Of an emergency stop: below it the contact is open; half of what a closed digital line reads."""
        return 0.5 if self.pressed_below is None else self.pressed_below

    def raw_range(self, terminal: Terminal) -> tuple[float, float]:
        """What it can give or take at this terminal, in the terminal's unit."""
        return self.range or (terminal.low, terminal.high)

    def range_at(self, terminal: Terminal) -> tuple[float, float]:
        """The same in the channel's unit."""
        return self.line.range_of(*self.raw_range(terminal))

    @property
    def line(self) -> Calibration:
        """From raw to the channel's unit and back."""
        given = self.calibration
        if given is None:
            return Calibration(self.unit)
        day, due = (str(day) if day else "" for day in (given.date, given.due))
        return Calibration(self.unit, given.slope, given.offset, given.uncertainty, day, due, given.source, given.lag_s)


class While(Strict):
    """A channel within a range."""

    channel: str
    low: float = -float("inf")
    high: float = float("inf")


class InterlockEntry(Strict):
    """What must hold, and what happens when it does not (see `hil.safety.interlock.Interlock`).

    `low` and `high` are in the channel's unit, `raw_low` and `raw_high` in the terminal's (live zero).
    """

    channel: str
    action: Action
    low: FiniteFloat | None = None
    high: FiniteFloat | None = None
    raw_low: FiniteFloat | None = None
    raw_high: FiniteFloat | None = None
    minus: str = ""
    for_s: float = Field(0.0, ge=0.0)
    only_while: While | None = None
    stale_s: PositiveFloat | None = None

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if all(given is None for given in (self.low, self.high, self.raw_low, self.raw_high, self.stale_s)):
            raise ValueError("nothing is asked for; give low, high, raw_low, raw_high or stale_s")
        return self


class ProtectionEntry(Strict):
    """How often inputs are judged and recorded (`block_s`), and how long a `hold` is waited for.

    A program that gives no sign of life for `watchdog_s` while outputs are driven is killed by its watchdog process,
    which makes them safe; 0: there is no such process. `overdue` says what becomes of a run with a calibration that was
    due before: it carries a deviation, or is refused. Outputs in `shutdown_order` go to their safe values one after
    another, and to their `on` values in the reverse order.
    """

    block_s: PositiveFloat = 0.1
    patience_s: PositiveFloat = 600.0
    watchdog_s: float = Field(default=10.0, ge=0.0)
    overdue: Literal["deviation", "refuse"] = "deviation"
    shutdown_order: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _beats_in_time(self) -> Self:
        if 0.0 < self.watchdog_s < 3.0 * self.block_s:
            raise ValueError(f"watchdog_s {self.watchdog_s:g}: at least three times block_s = {self.block_s:g}, or 0")
        return self


class Conditions(Strict):
    """Conditions of the test, as a report on ISO 10770-1 states them.

    What a channel measures (oil temperature, supply pressure) is taken from there. A run in which one leaves its entry
    in `ranges` carries a deviation.
    """

    fluid: str = ""
    viscosity_class: str = ""
    cleanliness: str = ""
    fluid_temperature_c: float | None = None
    ambient_temperature_c: float | None = None
    supply_pressure_bar: float | None = None
    return_pressure_bar: float | None = None
    pressure_drop_bar: float | None = None
    notes: str = ""
    ranges: dict[
        Literal["fluid_temperature_c", "ambient_temperature_c", "supply_pressure_bar", "return_pressure_bar"],
        tuple[FiniteFloat, FiniteFloat],
    ] = Field(default_factory=dict)

    @field_validator("ranges")
    @classmethod
    def _rising(cls, ranges: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        for name, (low, high) in ranges.items():
            if low > high:
                raise ValueError(f"{name}: {low:g} is above {high:g}")
        return ranges


class InstrumentEntry(Strict):
    """An instrument for the report: what it is, which channel it feeds, and when it was calibrated."""

    name: str
    channel: str = ""
    serial: str = ""
    calibrated: dt.date | None = None
    due: dt.date | None = None
    uncertainty: str = ""


class AcceptanceLimit(Strict):
    """Where a measured quantity must lie, in its own unit."""

    low: FiniteFloat | None = None
    high: FiniteFloat | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low is None and self.high is None:
            raise ValueError("nothing is asked for; give low, high or both")
        if self.low is not None and self.high is not None and self.low > self.high:
            raise ValueError(f"low {self.low:g} must not be above high {self.high:g}")
        return self


class SimulationTable(TypedDict, total=False):
    """What simulated devices are told of the world behind them; each of them says what else it knows."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    plant: str
    parameters: dict[str, FiniteFloat]
    effects: list[dict[str, Any]]
    seed: Annotated[int, Field(ge=0)]
    instruments: dict[str, dict[str, Any]]


class Bench(Strict):
    """A bench, whole and without faults.

    `acceptance` has, by procedure and measured quantity, the limits of this valve. `presets` has, by
    procedure and name, settings that are chosen together.
    """

    name: str = Field(min_length=1)
    sample_rate_hz: PositiveFloat
    valve: Valve
    devices: dict[str, Device]
    channels: dict[str, ChannelEntry]
    interlocks: dict[str, InterlockEntry] = Field(default_factory=dict)
    protection: ProtectionEntry = Field(default_factory=ProtectionEntry)
    conditions: Conditions = Field(default_factory=Conditions)
    instruments: tuple[InstrumentEntry, ...] = ()
    acceptance: dict[str, dict[str, AcceptanceLimit]] = Field(default_factory=dict)
    presets: dict[str, dict[str, dict[str, Any]]] = Field(default_factory=dict)
    simulation: SimulationTable = Field(default_factory=SimulationTable)
    made_with: str = ""

    @property
    def roles(self) -> dict[str, str]:
        """The channel of each role."""
        return {channel.role: name for name, channel in self.channels.items() if channel.role != "other"}
