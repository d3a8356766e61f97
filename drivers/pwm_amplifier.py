"""PWM current amplifiers for one solenoid on Modbus: set current, carrier, dither, watchdog (register map of our own).

No public manual of such an amplifier with its registers was at hand. **Every address, scale and range, in the
description `pwm-amplifier`, is our choice**: the least that an amplifier of this kind has to offer. A real one is
described by the numbers of its manual, with `driver = "modbus"`.
"""

from __future__ import annotations

from collections.abc import Iterator

from drivers.modbus import LineSettings, ModbusLink, line_faults, line_needs
from hil.daq.channel import Terminal, Wiring
from hil.description.modbus import ModbusDescription
from hil.description.named import Described, description_of

needs = line_needs


class Settings(LineSettings):
    """What `[devices.NAME]` may say: how the amplifier is reached. Carrier and dither are the channel's `pwm`."""


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    yield from line_faults(settings, _described())


def terminals(_settings: Settings) -> dict[str, Terminal]:
    """The current that it drives, and what it measures at the coil: means over a period of the PWM."""
    return _described().ports


def open_link(settings: Settings, wiring: Wiring) -> ModbusLink:
    """The amplifier, its watchdog armed, carrier and dither set. It makes the dither by itself."""
    return ModbusLink(settings, wiring, _described())


def _described() -> ModbusDescription:
    found: ModbusDescription = description_of(Described(model="pwm-amplifier"), "modbus")
    return found
