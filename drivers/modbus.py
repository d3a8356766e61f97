"""Modbus TCP and RTU: any device with registers, by its description."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import FiniteFloat

from drivers._described import ByDescription
from drivers._edge import reply_faults
from drivers._modbus_client import LineSettings
from drivers._modbus_link import ModbusLink
from drivers._modbus_model import Model, Register, described_by, levels_of
from drivers._ports import host_and_port
from hil.daq.channel import Wiring
from hil.description.modbus import TIMES, ModbusDescription
from hil.description.named import Described, description_faults

__all__ = [
    "LineSettings", "ModbusLink", "Model", "Register", "Settings", "faults", "has_watchdog", "levels_of",
    "line_faults", "line_needs", "not_read_back", "open_link", "terminals",
]  # fmt: skip
PROBES = "modbus"
_devices = ByDescription("modbus")
terminals, has_watchdog, not_read_back = _devices.terminals, _devices.has_watchdog, _devices.not_read_back
watchdog_levels = _devices.watchdog_levels


class Settings(LineSettings, Described):
    """What `[devices.NAME]` may say: how the device is reached, and which it is.

    Attributes:
        model: the name of an installed description, or a file beside the bench file.
        description: one that stands in the bench file itself.
        watchdog_level: where the device was set to put its outputs when its watchdog expires, in the unit of its
            terminals; as it is delivered if not given.
    """

    watchdog_level: FiniteFloat | None = None


def faults(settings: Settings) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong beyond the types."""
    yield from description_faults(settings, "modbus")
    yield from line_faults(settings, _devices.described(settings)) if _devices.is_sound(settings) else ()
    yield from _devices.watchdog_faults(settings)


def line_faults(settings: LineSettings, model: ModbusDescription | Model) -> Iterator[tuple[tuple[str, ...], str]]:
    """What is wrong with the settings of a device of this model."""
    described = described_by(model)
    arm = described.watchdog.arm if described.watchdog else ()
    if settings.transport == "tcp" and host_and_port(settings.address) is None:
        yield ("address",), f"'{settings.address}' is not host:port, such as 192.168.1.10:502"
    if settings.watchdog_s is not None and not described.outputs:
        yield ("watchdog_s",), "this model has no outputs that a watchdog could make safe; take this away"
    times = [step.value for step in arm if step.value in TIMES]
    per_second = TIMES[str(times[0])] if times else 10.0
    if settings.watchdog_s is not None and not _counted(settings.watchdog_s * per_second, bool(arm)):
        steps = f"{1.0 / per_second:g} … {0xFFFF / per_second:g} s in steps of {1.0 / per_second:g} s"
        yield ("watchdog_s",), f"{settings.watchdog_s:g} s: the device counts {steps}"
    if settings.echo and settings.transport == "tcp":
        yield ("echo",), "only a serial line echoes; take this away"
    yield from reply_faults(settings)


def _counted(count: float, is_sent: bool) -> bool:
    """Whether the device can count such a time; one that is set there by other means may be any."""
    return not is_sent or (abs(count - round(count)) < 1e-6 and 1 <= round(count) <= 0xFFFF)


def has_checksum(settings: Settings) -> bool:
    """Whether answers have one: on a serial line."""
    return settings.transport == "rtu"


def has_numbers(settings: Settings) -> bool:
    """Whether answers have one: on Modbus TCP."""
    return settings.transport == "tcp"


def probe() -> Any:
    """Who is on such a line (see `hil.daq.probe`)."""
    from drivers import _probe_modbus

    return _probe_modbus


def line_needs(settings: LineSettings) -> tuple[str, ...]:
    """Packages that must be installed for a device that is reached so."""
    is_port = settings.transport == "rtu" and not settings.address.startswith("socket://")
    return ("pymodbus", "serial") if is_port else ("pymodbus",)


needs = line_needs


def open_link(settings: Settings, wiring: Wiring) -> ModbusLink:
    """The device, connected, its watchdog armed."""
    return ModbusLink(settings, wiring, _devices.described(settings), _devices.level(settings))
