"""Settings in per cent of full command, and what they are in the unit of the command."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hil.errors import SettingError
from hil.rig import Rig, RoleChannel

MOST_POLES = 5


@dataclass(frozen=True, slots=True)
class Scale:
    """What per cent mean on a bench: a valve driven in %, A, V or mm is asked for in the same numbers.

    Attributes:
        command: the valve's command and its range.
        full: 100 %, in the unit of the command, counted from neutral.
        moving: name of a response that moves on for as long as the command is off neutral; empty for all others.
    """

    command: RoleChannel
    full: float
    moving: str = ""

    @property
    def neutral(self) -> float:
        """Where the command rests: its safe value."""
        return self.command.safe

    @property
    def both_ways(self) -> bool:
        """Whether the command goes to both sides of neutral."""
        return self.command.low < self.neutral < self.command.high

    @property
    def centre(self) -> float:
        """Neutral of a command that goes both ways, the middle of the range of one that does not."""
        return self.neutral if self.both_ways else (self.command.low + self.command.high) / 2.0

    def percent(self, level: float) -> float:
        """A level of the command in per cent, counted from neutral."""
        return 100.0 * (level - self.neutral) / self.full

    def label(self, level: float) -> str:
        """The same as it names a part of a run: `+50 %`."""
        return f"{self.percent(level):+.3g} %"

    def size(self, setting: str, percent: float) -> float:
        """A distance, an amplitude for example, in the unit of the command. Raises `SettingError` unless above 0."""
        if not percent > 0.0:
            raise SettingError(f"setting {setting}: {percent:g} % of full command; it must be above 0 %")
        return percent / 100.0 * self.full

    def level(self, setting: str, percent: float) -> float:
        """A level, counted from neutral, in the unit of the command. Raises `SettingError` when out of range."""
        value = self.neutral + percent / 100.0 * self.full
        return self.within(setting, f"{percent:g} %", value, value)

    def levels(self, setting: str, percents: Sequence[float] | None, share: float = 1.0) -> list[float]:
        """Levels off neutral, in the unit of the command; so far towards the ends of its range when none are given.

        Raises:
            SettingError: none, one at neutral, or one out of range.
        """
        if percents is None:
            ends = (self.command.high, self.command.low)
            return [self.neutral + share * (end - self.neutral) for end in ends if end != self.neutral]
        found = [self.level(setting, percent) for percent in percents]
        if not found or self.neutral in found:
            raise SettingError(f"setting {setting}: each must differ from 0 %, and at least one is needed")
        return found

    def amplitude_about(self, setting: str, percent: float, middle: float) -> float:
        """An amplitude about a level, in the unit of the command.

        Raises:
            SettingError: it is not above 0, or the command may not go so far.
        """
        size = self.size(setting, percent)
        self.within(setting, f"{percent:g} % about {self.percent(middle):g} %", middle - size, middle + size)
        return size

    def middle(self, setting: str, percent: float) -> float:
        """A level to swing about. Raises `SettingError` where the response would run away from there."""
        if self.moving and percent != 0.0:
            raise SettingError(
                f"setting {setting}: {percent:g} %; {_runs_away(self)}, so only 0 % is allowed: sine_position and "
                "velocity_steps measure it under way"
            )
        return self.level(setting, percent)

    def within(self, setting: str, given: str, low: float, high: float) -> float:
        """`low` again, when the command may go from `low` to `high`.

        Raises:
            SettingError: it may not; names the setting, what was given, and what is allowed.
        """
        rounding = 1e-9 * (self.command.high - self.command.low)
        if not (self.command.low - rounding <= low and high <= self.command.high + rounding):
            unit = self.command.unit
            asked = f"{low:.4g} {unit}" if low == high else f"{low:.4g} … {high:.4g} {unit}"
            is_own = unit == "%" and (self.full, self.neutral) == (100.0, 0.0)
            scale = "" if is_own else f" (100 % is {self.full:g} {unit} from neutral, {self.neutral:g} {unit})"
            raise SettingError(
                f"setting {setting}: {given} is {'' if asked == given else f'{asked}, '}outside the range of "
                f"'{self.command.name}', {self.command.low:g} … {self.command.high:g} {unit}{scale}"
            )
        return low


def scale_of(rig: Rig, full_command: float | None) -> Scale:
    """The scale of a bench; 100 % is the farther end of the command's range when it is not given.

    Raises:
        SettingError: `full_command` is not above 0.
    """
    command, response = rig.command, rig.response
    moving = response.name if response.integrates else ""
    if full_command is None:
        return Scale(command, max(command.high - command.safe, command.safe - command.low), moving)
    return Scale(command, full_command, moving)


def check_stands(scale: Scale, needing: str, instead: str = "run velocity_steps") -> None:
    """Raise `SettingError` where the response of the bench never stands while the command is off neutral."""
    if scale.moving:
        raise SettingError(f"{needing} needs a response that comes to stand; {_runs_away(scale)}: {instead}")


def _runs_away(scale: Scale) -> str:
    return f"'{scale.moving}' moves on for as long as '{scale.command.name}' is off neutral"


def about_levels(
    scale: Scale, amplitudes: Sequence[float], biases: Sequence[float] | None
) -> tuple[tuple[float, float], ...]:
    """Every (bias, amplitude) in the unit of the command, bias by bias.

    Biases that are not given are the operating point of the bench; where it names none ±50 %, because many valves are
    dead about neutral, the middle of a command that goes one way, or neutral where the response moves on elsewhere.

    Raises:
        SettingError: nothing given, an amplitude not above 0, or the command may not go there.
    """
    levels = _default_biases(scale) if biases is None else [scale.middle("biases", percent) for percent in biases]
    found = tuple(
        (bias, scale.amplitude_about("amplitudes", percent, bias)) for bias in levels for percent in amplitudes
    )
    if not found:
        raise SettingError("settings amplitudes and biases: at least one of each is needed")
    return found


def _default_biases(scale: Scale) -> list[float]:
    if (point := scale.command.operating_point) is not None:
        return [point]
    if scale.both_ways and not scale.moving:
        return [scale.level("biases", percent) for percent in (50.0, -50.0)]
    return [scale.neutral if scale.moving else scale.centre]


def check_above(setting: str, least: float, value: float, unit: str = "") -> None:
    """Raise `SettingError` unless a value is above what it must exceed."""
    if not least < value < math.inf:
        raise SettingError(f"setting {setting}: {value:g}{unit and ' '}{unit}; it must be above {least:g}")


def check_at_least(setting: str, least: float, value: float, unit: str = "") -> None:
    """Raise `SettingError` unless a value is at least so much."""
    if not least <= value < math.inf:
        raise SettingError(f"setting {setting}: {value:g}{unit and ' '}{unit}; it must be at least {least:g}")


def check_form_asked(poles: int | None, zeros: int | None) -> None:
    """Raise `SettingError` unless a transfer function can have so many poles and zeros."""
    if poles is not None and not 1 <= poles <= MOST_POLES:
        raise SettingError(f"setting poles: {poles}; allowed are 1 to {MOST_POLES}")
    most = MOST_POLES if poles is None else poles
    if zeros is not None and not 0 <= zeros <= most:
        raise SettingError(f"setting zeros: {zeros}; allowed are 0 to {most}, no more than poles")
