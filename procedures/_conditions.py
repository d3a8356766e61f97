"""Conditions of a test that the bench adjusts: found by their role, adjusted for a while, brought back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from hil.errors import SettingError
from hil.rig import ConditionRole, Rig, RoleChannel

Values = Mapping[ConditionRole, float]

SUPPLY: ConditionRole = "supply pressure"
LOAD: ConditionRole = "load orifice"
TANK: ConditionRole = "tank pressure"
OIL: ConditionRole = "oil temperature"


def adjusting(rig: Rig, role: ConditionRole, needing: str) -> RoleChannel:
    """The channel that adjusts a condition. Raises `SettingError`, which names the role, where the bench has none."""
    found = rig.adjustable.get(role)
    if found is None:
        have = ", ".join(rig.adjustable) or "nothing"
        raise SettingError(f'{needing} needs an output with role = "{role}"; this bench adjusts: {have}')
    return found


def usual(channel: RoleChannel) -> float:
    """Where a condition stands unless it is adjusted, in its unit."""
    return channel.safe if channel.operating_point is None else channel.operating_point


def check_within(channel: RoleChannel, setting: str, values: Sequence[float]) -> None:
    """Raise `SettingError` for a value to which a condition may not be brought."""
    for value in values:
        if not channel.low <= value <= channel.high:
            raise SettingError(
                f"setting {setting}: {value:.4g} {channel.unit} is outside the range of '{channel.name}', "
                f"{channel.low:g} … {channel.high:g} {channel.unit}"
            )


def adjusting_s(rig: Rig, ways: Sequence[Values]) -> float:
    """Bench time of all adjustments, each from where the bench has its conditions, and back."""
    return 2.0 * sum(max(_takes_s(rig.adjustable[role], value) for role, value in way.items()) for way in ways if way)


@contextmanager
def adjusted(rig: Rig, values: Values, rate_hz: float) -> Iterator[None]:
    """With conditions at these values; afterwards where the bench has them. An error leaves them to the guard."""
    if values:
        units = {role: rig.adjustable[role].unit for role in values}
        rig.progress(0.0, ", ".join(f"{role} to {value:.4g} {units[role]}" for role, value in values.items()))
        rig.adjust(values, rate_hz)
    yield
    if values:
        rig.adjust({role: usual(rig.adjustable[role]) for role in values}, rate_hz)


def _takes_s(channel: RoleChannel, value: float) -> float:
    return channel.settles_s + abs(value - usual(channel)) / (channel.slew_per_s or float("inf"))
