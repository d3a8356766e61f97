"""PWM current amplifiers for one solenoid on Modbus: set current, carrier, dither, watchdog (register map of our own).

No public manual of such an amplifier with its registers was at hand. **Every address, scale and range, here
and in the description `pwm-amplifier`, is our choice**: the least that an amplifier of this kind has to offer. To drive
a real one, put the numbers of its manual in their place and, from the manual again, into the twin.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from drivers._edge import edge
from drivers.modbus import LineSettings, ModbusLink, line_faults, line_needs
from hil.daq.channel import OutputChannel, Terminal, Wiring
from hil.description.modbus import ModbusDescription
from hil.description.named import Described, description_of
from hil.errors import SettingError

DESCRIPTION = "pwm-amplifier"
"""What it has beside carrier and dither: set current, measured current and voltage, watchdog, faults."""
CARRIER = 1
"""First of three holding registers: carrier [Hz], dither [0.1 Hz], its peak [mA]."""
_MODULATION = ("carrier", "dither", "peak of the dither")
_CARRIER_HZ, _DITHER_HZ, _DITHER_A = (100.0, 5000.0), (10.0, 500.0), (0.0, 0.5)


class Settings(LineSettings):
    """What `[devices.NAME]` may say: how the amplifier is reached. Carrier and dither are the channel's `pwm`."""


def faults(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong beyond the types."""
    yield from line_faults(settings, _described())


def terminals(_settings: Settings) -> dict[str, Terminal]:
    """The current that it drives, and what it measures at the coil: means over a period of the PWM."""
    return _described().ports


def needs(settings: Settings) -> tuple[str, ...]:
    """Packages that must be installed."""
    return line_needs(settings)


def open_link(settings: Settings, wiring: Wiring) -> PwmAmplifierLink:
    """The amplifier, its watchdog armed, carrier and dither set."""
    return PwmAmplifierLink(settings, wiring)


@edge
class PwmAmplifierLink(ModbusLink):
    """An amplifier (see `hil.daq.link.Link`). It makes the dither by itself, so that polling need not be fast.

    Raises:
        SettingError: a carrier or dither that it does not make.
    """

    def __init__(self, settings: Settings, wiring: Wiring) -> None:
        self._modulation = [count for channel in wiring.outputs.values() for count in modulation(channel)]
        super().__init__(settings, wiring, _described())

    def _opened(self, identity: str) -> None:
        super()._opened(identity)
        if self._modulation:
            self._ask(16, CARRIER, values=self._modulation)

    def _put(self, values: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """The current; carrier and dither stand as they were set when it was opened."""
        yield from super()._put(values)
        yield from zip(_MODULATION, self._modulation, strict=False)

    def _held(self) -> dict[str, float]:
        """The current, and counts of carrier and dither."""
        counts = self._ask(3, CARRIER, count=len(self._modulation)) if self._modulation else []
        return {**super()._held(), **dict(zip(_MODULATION, counts, strict=False))}


def read_back_requests(wiring: Wiring) -> int:
    """The current, and what makes it: carrier and dither."""
    return 2 * len(wiring.outputs)


def modulation(channel: OutputChannel) -> list[int]:
    """Carrier, dither frequency and dither amplitude as the registers have them.

    Raises:
        SettingError: one is beyond what the amplifier makes.
    """
    pwm = channel.pwm
    if pwm is None:
        return []
    checks = [("carrier_hz", pwm.carrier_hz, "Hz", _CARRIER_HZ)]
    if pwm.dither_hz is not None:
        checks += [
            ("dither_hz", pwm.dither_hz, "Hz", _DITHER_HZ),
            ("dither_amplitude", pwm.dither_amplitude, "A", _DITHER_A),
        ]
    for key, value, unit, (low, high) in checks:
        if not low <= value <= high:
            raise SettingError(
                f"'{channel.name}': pwm.{key} = {value:g} {unit}; the amplifier makes {low:g} … {high:g} {unit}"
            )
    dither_hz, amplitude = (0.0, 0.0) if pwm.dither_hz is None else (pwm.dither_hz, pwm.dither_amplitude)
    return [round(pwm.carrier_hz), round(10.0 * dither_hz), round(1000.0 * amplitude)]


def _described() -> ModbusDescription:
    found: ModbusDescription = description_of(Described(model=DESCRIPTION), "modbus")
    return found
